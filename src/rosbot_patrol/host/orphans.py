"""Nodes that an earlier roslaunch has left behind when it was killed: they hold ports, devices and the state folder."""

from __future__ import annotations

import contextlib
import os
import selectors
import signal
import time
from collections.abc import Iterable
from pathlib import Path

MASTER = "the master"
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
            found[int(process.name)] = name or MASTER
    return found


def end(processes: Iterable[int], patience: float = 5.0) -> None:
    """Kill processes, and wait until they have ended, `patience` [s] at most.

    SIGKILL, because they belong to a run that was ended by force; the next start takes up the mission and the calls.
    """
    handles = [handle for process in processes if (handle := _open(process)) is not None]
    for handle in handles:
        with contextlib.suppress(ProcessLookupError):  # it has ended
            signal.pidfd_send_signal(handle, signal.SIGKILL)
    for handle in _wait(handles, patience):
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
