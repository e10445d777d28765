"""scripts/dependencies: what it reads and writes, a local package index, and the list of Debian's packages."""

from __future__ import annotations

import json
import re
import subprocess
import sys
import threading
from collections.abc import Iterator
from datetime import date
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib.machinery import SourceFileLoader
from importlib.util import module_from_spec, spec_from_loader
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[3]
HASH = "0" * 64
FILE = f"""\
# About the file.
# hold numpy: Debian's
numpy==1.24.2 \\
    --hash=sha256:{HASH}
Some.Package==1.0 \\
    --hash=sha256:{HASH} \\
    --hash=sha256:{"1" * 64}
# Dependencies of the packages above
old-one==3
kept==2
"""


@pytest.fixture(scope="module")
def program() -> ModuleType:
    loader = SourceFileLoader("dependencies_program", str(ROOT / "scripts" / "dependencies"))
    spec = spec_from_loader(loader.name, loader)
    assert spec is not None
    module = module_from_spec(spec)
    sys.modules[loader.name] = module  # dataclasses look there
    sys.dont_write_bytecode, before = True, sys.dont_write_bytecode
    loader.exec_module(module)
    sys.dont_write_bytecode = before
    return module


@pytest.fixture
def index() -> Iterator[tuple[str, dict[str, Any]]]:
    """A package index: its address, and its files by package."""
    packages: dict[str, Any] = {}

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            name = self.path.strip("/").split("/")[-1]
            body = json.dumps({"files": packages[name]}).encode() if name in packages else b"<html>"
            self.send_response(200 if name in packages or name == "html" else 404)
            self.send_header("Content-Length", str(len(body)))
            self.end_headers()
            self.wfile.write(body)

        def log_message(self, *_: object) -> None:
            """Nothing is logged."""

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield f"http://127.0.0.1:{server.server_port}/simple", packages
    server.shutdown()
    server.server_close()


def test_a_requirements_file_is_read_and_written(program: ModuleType, tmp_path: Path) -> None:
    path = tmp_path / "requirements.txt"
    path.write_text(FILE, encoding="utf-8")
    pins = program.Pins.read(path)
    assert pins.direct == {"numpy": "1.24.2", "some-package": "1.0"}
    assert pins.needed == {"old-one": "3", "kept": "2"}
    assert pins.holds == {"numpy": "Debian's"}
    assert [len(pins.hashes[name]) for name in pins.direct] == [1, 2]
    pins.write({"numpy": "1.24.2", "some-package": "2.0", "kept": "2"}, {"new": "5"})
    lines = path.read_text(encoding="utf-8").splitlines()
    assert lines[2:] == ["numpy==1.24.2", "Some.Package==2.0", program.NEEDED, "kept==2", "new==5"]


def test_the_files_of_this_checkout_are_understood(program: ModuleType) -> None:
    for suffix in program.FILES:
        path = program.requirements(suffix)
        pins = program.Pins.read(path)
        pinned = re.findall(r"^[^#\s]\S+==\S+", path.read_text(encoding="utf-8"), re.MULTILINE)
        assert len(pins.all) == len(pinned) > 0
        assert set(pins.holds) <= set(pins.direct)
        assert all(pins.hashes[name] for name in pins.all)


def test_ages_come_from_the_index(program: ModuleType, index: tuple[str, dict[str, Any]]) -> None:
    address, packages = index
    wheel = {"upload-time": "2026-01-02T03:04:05.123456Z"}
    packages["thing"] = [
        {"filename": "thing-0.1.tar.gz", "requires-python": ">=3.6.*", **wheel},
        {"filename": "thing-1.0-py3-none-any.whl", "upload-time": "2025-05-06T07:08:09Z"},
        {"filename": "thing-1.0.tar.gz", **wheel},
        {"filename": "thing-2.0-py3-none-any.whl", "requires-python": ">=3.9", **wheel},
        {"filename": "thing-2.1-py3-none-any.whl", "yanked": "broken", **wheel},
        {"filename": "thing-2.2rc1-py3-none-any.whl", **wheel},
        {"filename": "thing-3.0-py3-none-any.whl", "requires-python": ">=3.14", **wheel},
        {"filename": "thing.exe", **wheel},
    ]
    pinned, newest = program.releases("thing", "1.0", address)
    assert pinned == program.Release(version="1.0", day=date(2025, 5, 6))
    assert newest == program.Release(version="2.0", day=date(2026, 1, 2))
    del packages["thing"][1]["upload-time"], packages["thing"][2]["upload-time"]
    assert program.releases("thing", "1.0", address)[0].day is None


@pytest.mark.parametrize("name", ["missing", "html"])
def test_an_index_that_says_nothing_is_a_sentence(
    program: ModuleType, index: tuple[str, dict[str, Any]], name: str
) -> None:
    with pytest.raises(program.DependencyError, match=f"the package index says nothing usable about {name}"):
        program.releases(name, "1.0", index[0])


def test_debian_packages_with_what_they_need(program: ModuleType) -> None:
    found = {name for name, _, _ in program.debian_packages()}
    assert {"python3-rospy", "catkin", "libc6"} <= found


@pytest.mark.long
def test_report_and_list_of_parts(tmp_path: Path) -> None:
    target = tmp_path / "sbom.json"
    subprocess.run([ROOT / "scripts" / "dependencies", "sbom", target], check=True, timeout=300.0)
    tree = json.loads(target.read_text(encoding="utf-8"))
    assert tree["specVersion"] == "1.6"
    assert tree["metadata"]["component"]["name"] == "rosbot_patrol"
    kinds = [part["purl"].partition("/")[0] for part in tree["components"]]
    assert kinds.count("pkg:pypi") > 50
    assert kinds.count("pkg:deb") > 200
    done = subprocess.run(
        [ROOT / "scripts" / "dependencies", "report"], capture_output=True, text=True, check=False, timeout=300.0
    )
    assert done.returncode in (0, 1), done.stderr
    assert re.search(r"\d+ packages, \d+ of them known to pip-audit here", done.stdout)
