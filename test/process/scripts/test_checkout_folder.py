"""A checkout's folder: a name that catkin cannot build in is refused at once, before anything is installed."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest

SCRIPTS = Path(__file__).resolve().parents[3] / "scripts"
BLANK = "has a blank"


def checkout(folder: Path) -> Path:
    shutil.copytree(SCRIPTS, folder / "scripts")
    return folder


def run(
    program: Path | str, *arguments: str, cwd: Path | None = None, path: str = ""
) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "PATH": f"{path}:{os.environ['PATH']}" if path else os.environ["PATH"], "LC_ALL": "C"}
    return subprocess.run(
        [program, *arguments],
        cwd=cwd,
        env=environment,
        capture_output=True,
        text=True,
        errors="replace",
        check=False,
        timeout=60,
    )


@pytest.mark.parametrize("script", ["patrol", "test", "bootstrap", "docs"])
def test_the_first_line_names_the_cause(tmp_path: Path, script: str) -> None:
    folder = checkout(tmp_path / "my house")
    said = run(folder / "scripts" / script)
    assert said.returncode != 0
    first, *others = (said.stdout + said.stderr).splitlines()
    assert "the name of the folder is the cause" in first
    assert f'"{folder}" {BLANK}' in first
    assert "move or clone the checkout" in first
    assert others == []
    assert not (folder / ".ws").exists()


@pytest.mark.parametrize("mark", list("'\"$`\\#&;:=|<>()[]{}*?!^"))
def test_marks_of_shells_makefiles_and_cmake_are_refused(mark: str) -> None:
    said = run(SCRIPTS / "check_folder", f"/home/you/a{mark}b")
    assert said.returncode == 1
    assert f"has the character {mark}," in said.stderr


@pytest.mark.parametrize("name", ["a\tb", "a\nb", "a\x07b"])
def test_control_characters_are_refused_in_one_line(name: str) -> None:
    said = run(SCRIPTS / "check_folder", f"/home/you/{name}")
    assert said.returncode == 1
    assert '"/home/you/a?b" has a control character' in said.stderr
    assert len(said.stderr.splitlines()) == 1


def test_a_name_that_is_no_utf_8_is_refused() -> None:
    said = subprocess.run([SCRIPTS / "check_folder", b"/home/r\xe4ume"], capture_output=True, check=False)
    assert said.returncode == 1
    assert b"is not UTF-8" in said.stderr


@pytest.mark.parametrize("name", ["räume", "rau\u0308me", "Łódź", "家", "-dash", "a+b,c@d%e~g", "v1.2_x-y"])
def test_letters_of_every_script_and_harmless_marks_are_taken(name: str) -> None:
    said = run(SCRIPTS / "check_folder", f"/home/you/{name}")
    assert (said.returncode, said.stderr) == (0, "")


@pytest.mark.parametrize(("letter", "fits", "too_many"), [("x", 232, 233), ("ä", 116, 117)])
def test_the_path_of_an_interpreter_has_to_fit_into_the_kernels_line(letter: str, fits: int, too_many: int) -> None:
    assert run(SCRIPTS / "check_folder", "/" + letter * fits).returncode == 0
    said = run(SCRIPTS / "check_folder", "/" + letter * too_many)
    assert said.returncode == 1
    assert "bytes long" in said.stderr


def test_the_folder_that_a_link_leads_to_counts(tmp_path: Path) -> None:
    good = checkout(tmp_path / "good")
    (good / "scripts" / "check_folder").write_text('#!/bin/sh\necho "checked $1"\nexit 1\n')
    (tmp_path / "my house").symlink_to(good)
    assert run(tmp_path / "my house" / "scripts" / "bootstrap").stdout == f"checked {good}\n"
    bad = checkout(tmp_path / "bad house")
    (tmp_path / "link").symlink_to(bad)
    assert f'"{bad}" {BLANK}' in run(tmp_path / "link" / "scripts" / "bootstrap").stderr


@pytest.mark.parametrize(
    ("script", "arguments"), [("patrol", []), ("bootstrap", []), ("test", []), ("record", ["x.yaml", "x.bag"])]
)
def test_a_leading_dash_is_no_option(tmp_path: Path, script: str, arguments: list[str]) -> None:
    """Typed from the folder above, as `-house/scripts/patrol`, the shell has to take it for a file."""
    folder = checkout(tmp_path / "-house")
    (folder / "scripts" / "check_folder").write_text('#!/bin/sh\necho "checked $1"\nexit 1\n')
    said = run(f"-house/scripts/{script}", *arguments, cwd=tmp_path)
    assert said.stdout == f"checked {folder}\n", said.stderr


@pytest.mark.parametrize("is_link", [False, True])
def test_a_checkout_that_was_moved_is_built_anew(tmp_path: Path, is_link: bool) -> None:
    folder = checkout(tmp_path / "house")
    programs = tmp_path / "bin"
    programs.mkdir()
    for name in ("apt-get", "sudo"):  # where this test ends it
        (programs / name).write_text("#!/bin/sh\nexit 1\n")
        (programs / name).chmod(0o755)
    (folder / "scripts" / "apt-packages.txt").write_text("no-package-of-debian\n")
    ws = folder / ".ws"
    (ws / "build").mkdir(parents=True)
    (ws / "devel").mkdir()
    (tmp_path / "venv").mkdir()
    if is_link:
        (ws / "venv").symlink_to(tmp_path / "venv")
    else:
        (ws / "venv").mkdir()
    cache = ws / "build" / "CMakeCache.txt"
    cache.write_text(f"CMAKE_CACHEFILE_DIR:INTERNAL={ws}/build\n")
    assert "moved" not in run(folder / "scripts" / "bootstrap", path=str(programs)).stdout
    assert cache.is_file()
    cache.write_text("CMAKE_CACHEFILE_DIR:INTERNAL=/home/you/before/.ws/build\n")
    assert "moved or copied from another folder" in run(folder / "scripts" / "bootstrap", path=str(programs)).stdout
    assert not cache.exists()
    assert not (ws / "devel").exists()
    assert (ws / "venv").exists() == is_link
