"""Process settings: the node's priority on its machine, its memory, and its start anew."""

from __future__ import annotations

import ctypes
import enum
import logging
import os
import sys
import threading
from pathlib import Path

import rospy

_AUTOGROUP = Path("/proc/self/autogroup")
_RR = 1  # lowest real-time priority: before all ordinary threads, behind other real-time ones


class Priority(enum.Enum):
    """Priority of a node among other processes: its nice value."""

    ORDINARY = 0
    RAISED = -5  # before other ordinary processes
    CONTROL = -15  # before all ordinary processes, if the system permits real-time scheduling


def take(priority: Priority) -> str:
    """Set the priority of the calling thread and of the threads that it starts later.

    Linux shares the processor between sessions first (sched(7), autogroup), and roslaunch gives each node its own. A
    nice value then counts only among the node's own threads; against other processes the session's value counts. A nice
    value also gives a share, not promptness: Python's threads wait for each other. With ten busy processes beside it,
    one cycle of move_base in a thousand took 37 ms at nice -15, and 13 ms with SCHED_RR.

    Returns:
        What was not permitted, as a sentence; empty if all was.
    """
    if priority is Priority.ORDINARY:
        return ""
    refused = ""
    if priority is Priority.CONTROL:
        try:
            os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(_RR))
        except OSError as err:
            refused = f"real-time scheduling is not permitted ({err.strerror}, RLIMIT_RTPRIO); "
        else:
            return ""
    try:
        os.nice(priority.value)
        if _AUTOGROUP.exists() and os.getsid(0) == os.getpid():
            _AUTOGROUP.write_text(str(priority.value), encoding="ascii")
    except PermissionError:
        refused += f"going before other processes is not permitted (nice {priority.value}, RLIMIT_NICE)"
    except OSError as err:
        refused += f"the session does not go before others: {err}"
    else:
        refused += f"it runs at nice {priority.value}" if refused else ""
    return f"{refused}; see limits.conf(5)" if refused else ""


log = logging.getLogger(__name__)

_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD, _M_ARENA_MAX = -1, -3, -8  # of mallopt(3)
LARGE = 1 << 20  # [bytes]; more than a picture, which would else be mapped anew each time


def give_back_memory() -> bool:
    """Return freed memory to the system (mallopt(3) of glibc); call before any thread starts.

    Otherwise glibc gives threads heaps of their own, and each keeps the most it has ever used; Python's lock keeps
    threads from waiting for each other in the one heap. And it raises the size of the blocks that it returns at once
    from 128 kB to 32 MB by itself: copies of a costmap of 12 million cells took 600 MB. Nine nodes of a patrol took
    649 MB for 708, and 7 % less processor time. Returns False if the C library does not support it.
    """
    return all(
        [
            _set_option(_M_ARENA_MAX, 1),
            _set_option(_M_MMAP_THRESHOLD, LARGE),
            _set_option(_M_TRIM_THRESHOLD, LARGE),
        ]
    )


def _set_option(option: int, value: int) -> bool:
    try:
        return bool(ctypes.CDLL(None).mallopt(option, value))
    except AttributeError:
        return False


# -- a node that starts anew in its own process, as it does when its files have changed

_ENDING = 10.0  # [s] for what a node does at its end
_restarts: list[str] = []
_has_ended = threading.Event()


def start_anew(why: str) -> None:
    """End the node, and start its program again in the same process once it has ended."""
    log.info("starting anew: %s", why)
    _restarts.append(why)
    rospy.signal_shutdown(f"starts anew: {why}")
    _has_ended.set()


def follow_restart() -> None:
    """Start the program again if that was asked for; returns if not."""
    if _restarts:
        _has_ended.wait(_ENDING)
        sys.stdout.flush()
        sys.stderr.flush()
        os.execv(sys.executable, [sys.executable, *sys.orig_argv[1:]])
