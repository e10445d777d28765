"""What a robot installs from a package index is what was tried: exact versions, and the hash of each file."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
FILES = (
    "requirements.txt",
    "requirements-console.txt",
    "requirements-simulator.txt",
    "requirements-test.txt",
    "requirements-no-deps.txt",
)
HASHED = re.compile(r"(?P<name>[\w.-]+)==(?P<version>[\w.+!-]+)(?P<hashes>( --hash=sha256:[0-9a-f]{64})+)")
NO_WHEEL = {"moderngl", "glcontext", "pybullet"}  # on aarch64: built from the source there


def requirements(name: str) -> list[str]:
    """The logical lines, as pip joins them."""
    text = (ROOT / "scripts" / name).read_text(encoding="utf-8")
    lines = [line for line in text.splitlines() if not line.startswith("#")]
    return [" ".join(line.split()) for line in "\n".join(lines).replace("\\\n", " ").splitlines() if line.strip()]


@pytest.mark.parametrize("name", FILES)
def test_every_package_has_a_version_and_hashes(name: str) -> None:
    for line in requirements(name):
        found = HASHED.fullmatch(line)
        assert found, line
        hashes = found["hashes"].split()
        assert len(hashes) == len(set(hashes)), line
        assert found["name"] not in NO_WHEEL or len(hashes) == 2, line


def test_no_package_stands_twice() -> None:
    names = [re.sub(r"[-_.]+", "-", line.partition("=")[0]).lower() for name in FILES for line in requirements(name)]
    assert sorted(names) == sorted(set(names))


def test_the_bootstrap_takes_nothing_without_a_hash() -> None:
    installs = re.findall(r"pip install[^\n]*", (ROOT / "scripts" / "bootstrap").read_text("utf-8"))
    assert installs
    assert all("--require-hashes" in command for command in installs)
