"""Nodes that an earlier roslaunch has left behind when it was killed: they hold ports, devices and the state folder."""

from __future__ import annotations

import os
import selectors
import signal
import time
from pathlib import Path

_MARK = b"\0__name:="  # roslaunch gives each node its name


def find(master_uri: str, proc: Path = Path("/proc")) -> dict[int, str]:
    """This user's nodes of a master: process id and node's name. Processes above this one are none."""
    found = {}
    for process in proc.iterdir():
        if not process.name.isdigit():
            continue
        try:
            if process.stat().st_uid != os.geteuid():
                continue
            words = (process / "cmdline").read_bytes()
            environ = (process / "environ").read_bytes()
        except (FileNotFoundError, PermissionError, ProcessLookupError):
            continue  # it has ended, or is not ours to see
        name = words.partition(_MARK)[2].partition(b"\0")[0].decode(errors="replace")
        is_master = b"rosmaster\0--core" in words
        if (name or is_master) and b"ROS_MASTER_URI=" + master_uri.encode() in environ.split(b"\0"):
            found[int(process.name)] = name or "the master"
    return found


def end(processes: dict[int, str], patience: float = 5.0) -> None:
    """End processes: with SIGTERM, and those that are still there after `patience` [s] with SIGKILL."""
    handles = [handle for process in processes if (handle := _open(process)) is not None]
    for number, seconds in ((signal.SIGTERM, patience), (signal.SIGKILL, 1.0)):
        for handle in handles:
            try:
                signal.pidfd_send_signal(handle, number)
            except ProcessLookupError:
                continue  # it has ended
        handles = _wait(handles, seconds)
    for handle in handles:
        os.close(handle)


def _open(process: int) -> int | None:
    try:
        return os.pidfd_open(process)
    except ProcessLookupError:
        return None


def _wait(handles: list[int], seconds: float) -> list[int]:
    """Wait for processes to end; returns the handles of those that still run."""
    with selectors.DefaultSelector() as waiting:
        for handle in handles:
            waiting.register(handle, selectors.EVENT_READ)
        until = time.monotonic() + seconds
        while waiting.get_map() and (left := until - time.monotonic()) > 0.0:
            for key, _ in waiting.select(left):
                waiting.unregister(key.fd)
                os.close(key.fd)
        return [key.fd for key in waiting.get_map().values()]
