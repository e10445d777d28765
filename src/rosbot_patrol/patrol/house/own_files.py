"""The files of the owner's house: those that were given, or the console's copies of those that come with the program.

A file that comes with the program is never changed. What the owner changes of it on the console's pages is kept as a
copy in the guard's state folder, and counts instead. So does a file there where none was given.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from rosbot_patrol.package_files import package_file

HOUSE = "house"
"""Name of the folder in the guard's state folder."""

ROOMS, SENSORS, ARMING, SCHEDULE, CHANNELS = (
    "rooms.yaml",
    "sensors.yaml",
    "arming.yaml",
    "schedule.yaml",
    "channels.yaml",
)
"""Names of the owner's files in that folder, where none was given."""


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


def watched_files(given: Mapping[str, str], state_dir: Path) -> list[Path]:
    """The files of paths from the parameters, by their names here, and the places of the owner's copies."""
    found = [Path(path).expanduser() for path in given.values() if path not in ("", "none")]
    found += [place_to_write(path, state_dir, name) for name, path in given.items()]
    return list(dict.fromkeys(found))


def is_shipped(path: Path) -> bool:
    """Whether a file comes with the program."""
    here = package_file("package.xml").resolve().parent
    return path.resolve().is_relative_to(here)
