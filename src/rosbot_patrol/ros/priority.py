"""How a node stands to the other processes of its machine."""

from __future__ import annotations

import enum
import os
from pathlib import Path

_AUTOGROUP = Path("/proc/self/autogroup")
_RR = 1  # the least of the real-time priorities: before all that is ordinary, behind who asked for more


class Priority(enum.Enum):
    """Whom a node goes before: the nice value of each."""

    ORDINARY = 0
    RAISED = -5  # before other ordinary ones
    CONTROL = -15  # before all that is ordinary, where the system permits real-time scheduling


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
