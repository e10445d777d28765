"""Privacy of files: pictures of the house and the owner's addresses are readable by the robot's user only.

A program that writes into a `state_dir` calls `keep_private` first. Files outside are not touched: maps, rooms and
ROS's own logs keep the mode of the user's umask, unless such a program writes them.
"""

from __future__ import annotations

import logging
import os
import stat
from collections.abc import Iterator
from fnmatch import fnmatch
from pathlib import Path

log = logging.getLogger(__name__)

UMASK = 0o077
_FOLDERS = ("outbox", "held", "incidents")
_FILES = ("*.json*", "*.jsonl*", "incidents.*", "alive*", "*.lock", ".*.tmp")
_MAILDIR = ("cur", "new", "tmp")


def use_private_umask() -> None:
    """Make all files that this program writes from now on readable by its user only."""
    os.umask(UMASK)


def keep_private(state_dir: Path) -> None:
    """Make this program's future files, and the patrol's existing files in `state_dir`, readable by its user only.

    Only the patrol's own files are changed: other things in that folder (a home, /tmp) stay as they are. Files that
    cannot be changed are reported; the program goes on.
    """
    use_private_umask()
    try:
        ours, foreign = _sort(state_dir)
        loose = [path for path in ours if _is_open(path)]
    except FileNotFoundError:
        return
    except OSError as err:
        log.error("%s cannot be looked through: %s; other users may read it", state_dir, err)
        return
    if foreign and _is_open(state_dir):
        words = "is not the patrol's alone (%s), so others can look into it: give the patrol a folder of its own"
        log.warning(f"%s {words}", state_dir, ", ".join(sorted(foreign)[:3]))
    _tighten(state_dir, loose)


def _tighten(state_dir: Path, loose: list[Path]) -> None:
    problems = []
    for path in loose:
        try:
            path.chmod(stat.S_IMODE(path.lstat().st_mode) & ~UMASK)
        except FileNotFoundError:  # another program has removed it
            continue
        except OSError as err:
            problems.append(f"{path}: {err.strerror}")
    if problems:
        log.error("other users can still read %d of the files in %s: %s", len(problems), state_dir, problems[0])
    if done := len(loose) - len(problems):
        log.warning("other users could read %d of the files and folders in %s; no more", done, state_dir)


def _sort(state_dir: Path) -> tuple[list[Path], list[str]]:
    """The patrol's files with all below, and the names of other things there. Raises OSError."""
    ours: list[Path] = []
    foreign: list[str] = []
    for entry in os.scandir(state_dir):
        path = Path(entry)
        if entry.is_dir(follow_symlinks=False) and (entry.name in _FOLDERS or _is_our_maildir(path)):
            ours += _below(path)
        elif entry.is_file(follow_symlinks=False) and any(fnmatch(entry.name, pattern) for pattern in _FILES):
            ours.append(path)
        else:
            foreign.append(entry.name)
    if _is_everybodys(state_dir):
        foreign.append("it is a folder for everybody")
    return (ours if foreign else [state_dir, *ours]), foreign


def _below(folder: Path) -> Iterator[Path]:
    for place, _, files in os.walk(folder):  # does not follow links
        yield Path(place)
        yield from (path for name in files if not (path := Path(place, name)).is_symlink())


def _is_our_maildir(folder: Path) -> bool:
    return folder.name == "mail" and all((folder / part).is_dir() for part in _MAILDIR)


def _is_everybodys(folder: Path) -> bool:
    return bool(folder.stat().st_mode & stat.S_ISVTX) or folder.resolve() in (Path("/"), Path.home().resolve())


def _is_open(path: Path) -> bool:
    try:
        mode = path.stat().st_mode
    except FileNotFoundError:
        return False
    return bool(mode & UMASK) and (stat.S_ISREG(mode) or stat.S_ISDIR(mode))
