"""Priority and memory of a node's process.

Memory matters for nodes that work on large arrays, or pictures, in several threads.
"""

from __future__ import annotations

import ctypes
import enum
import logging
import os
from pathlib import Path

_AUTOGROUP = Path("/proc/self/autogroup")
_RR = 1  # the lowest real-time priority: before all ordinary processes


class Priority(enum.Enum):
    """Priority of a node, with its nice value."""

    ORDINARY = 0
    RAISED = -5  # before other ordinary processes
    CONTROL = -15  # before all ordinary processes, if the system permits real-time scheduling


def take(priority: Priority) -> str:
    """Set the priority of the calling thread, and of the threads that it starts from now on.

    Linux shares the processor between sessions first (sched(7), autogroup), and roslaunch gives each node its own: a
    nice value then counts only among the node's own threads, and what counts before others is that of the session. A
    nice value gives a share, too, not promptness: Python's threads wait for each other, and with ten busy processes
    beside it one cycle of move_base in a thousand took 37 ms at nice -15, and 13 ms with SCHED_RR.

    Returns:
        What was not permitted, in a sentence; empty where all was.
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

_M_MMAP_THRESHOLD, _M_ARENA_MAX = -3, -8  # of mallopt(3)
LARGE = 1 << 20  # [bytes]


def share_one_heap() -> bool:
    """Let all threads share one heap; call it before there are any.

    Otherwise glibc gives threads places of their own, each of which keeps what it has ever used: republish came to 178
    instead of 172 MB within a quarter of an hour. Python's lock keeps the threads from waiting for one another there.
    Returns whether the C library knows of it.
    """
    return _set_option(_M_ARENA_MAX, 1)


def give_back_large_blocks(size: int = LARGE) -> bool:
    """Return freed blocks of at least a size [bytes] to the system at once (mallopt(3) of glibc).

    Otherwise glibc raises that bound to 32 MB by itself, and each thread keeps what it has ever used: the copies of a
    costmap of 12 million cells came to 600 MB. Returns whether the C library knows of it.
    """
    done = _set_option(_M_MMAP_THRESHOLD, size)
    if not done:
        log.info("this C library keeps freed memory: nodes with large costmaps take more of it")
    return done


def _set_option(option: int, value: int) -> bool:
    try:
        return bool(ctypes.CDLL(None).mallopt(option, value))
    except AttributeError:
        return False
