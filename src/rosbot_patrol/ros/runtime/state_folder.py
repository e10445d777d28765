"""Folder of a guard's state: one per guard on a machine."""

from __future__ import annotations

import fcntl
import logging
import time
from pathlib import Path
from typing import IO

from rosbot_patrol.errors import ParamError
from rosbot_patrol.maps.zones import ZONES
from rosbot_patrol.patrol.house.own_files import HOUSE
from rosbot_patrol.ros.runtime.node import ros_home

log = logging.getLogger(__name__)

_PATIENCE = 5.0  # [s] for a program before this one to end
_held: list[IO[str]] = []  # locks must last as long as the process


def state_folder(given: str | Path | None, namespace: str) -> Path:
    """Folder of a guard's state: the given one, else one per namespace below ROS's home.

    Args:
        given: the parameter `state_dir`, empty for the default.
        namespace: namespace of the guard's nodes; "/" for none.
    """
    if given:
        return Path(given).expanduser()
    return ros_home() / "-".join(["rosbot_patrol", *filter(None, namespace.split("/"))])


def zones_file(given: str, namespace: str) -> Path | None:
    """The file of the owner's keep-out zones: the given one; for "state" the one in the state folder; None for ""."""
    if given == "state":
        return state_folder(None, namespace) / HOUSE / ZONES
    return Path(given).expanduser() if given else None


def claim_folder(folder: Path, name: str) -> None:
    """Lock a guard's state folder for this process, so that a second guard cannot mix its missions with ours.

    An unwritable folder is not locked; the program that writes there reports it.

    Args:
        folder: folder of the state.
        name: name of its parameter, for the error.

    Raises:
        ParamError: another patrol of this machine uses it.
    """
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        lock = (folder / "patrol.lock").open("a", encoding="utf-8")
    except OSError as err:
        log.warning("%s cannot be locked against a second patrol: %s", folder, err)
        return
    deadline = time.monotonic() + _PATIENCE
    while not _is_taken(lock):
        if time.monotonic() > deadline:
            lock.close()
            problem = f"is {folder}, which another patrol on this machine uses: give each guard a state_dir of its own"
            raise ParamError(name, f"{problem}, or a namespace (docs/two_guards.md)")
        time.sleep(0.1)
    _held.append(lock)


def _is_taken(lock: IO[str]) -> bool:
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError as err:  # a file system without locks
        log.warning("%s cannot be locked against a second patrol: %s", lock.name, err)
    return True
