"""The files of the owner's house: those that were given, or the console's copies of those that come with the program.

A file that comes with the program is never changed. What the owner changes of it on the console's pages is kept as a
copy in the guard's state folder, and counts instead. So does a file there where none was given.
"""

from __future__ import annotations

from pathlib import Path

from rosbot_patrol.package_files import package_file

HOUSE = "house"
"""Name of the folder in the guard's state folder."""


def own_file(given: str, state_dir: Path, name: str) -> str:
    """Path of the file that counts, "" for none.

    Args:
        given: path from the parameters; "" or "none" (roslaunch takes no empty argument) for none.
        state_dir: of the guard.
        name: of the file in the folder of the house, where none was given.
    """
    copy = place_to_write(given, state_dir, name)
    if copy.exists():
        return str(copy)
    return "" if given in ("", "none") else given


def place_to_write(given: str, state_dir: Path, name: str) -> Path:
    """Path that a changed file goes to: the given one, unless it comes with the program."""
    if given in ("", "none"):
        return state_dir / HOUSE / name
    path = Path(given).expanduser()
    return state_dir / HOUSE / path.name if is_shipped(path) else path


def is_shipped(path: Path) -> bool:
    """Whether a file comes with the program."""
    here = package_file("package.xml").resolve().parent
    return path.resolve().is_relative_to(here)
