"""Programs typed by hand: without a ROS master they end with one sentence; launched by roslaunch, they wait."""

from __future__ import annotations

import sys
import threading
import time
from typing import Any

import rosgraph
import rospy

from rosbot_patrol.errors import PatrolError

PATIENCE = 5.0  # [s]


class NobodyThere(PatrolError):
    """Error: a program that should answer is not running."""


def is_launched() -> bool:
    """Whether roslaunch started this program: it gives a name of a log file."""
    return any(word.startswith("__log:=") for word in sys.argv)


def require_master(program: str, *, patience: float = PATIENCE, status: int = 1) -> None:
    """End the program with one sentence if no ROS master answers; no effect under roslaunch.

    Args:
        program: its name.
        patience: longest wait for the master [s].
        status: exit status.
    """
    problem = "" if is_launched() else master_problem(patience)
    if problem:
        print(f"{program}: {problem}", file=sys.stderr, flush=True)
        sys.exit(status)


def master_problem(patience: float = PATIENCE) -> str:
    """Reason why no ROS master can be asked, "" if one answers within `patience` [s]."""
    uri = ""
    try:
        uri = rosgraph.get_master_uri()
        master = rosgraph.Master("/by_hand", master_uri=uri)
    except (ValueError, OSError):
        return f"ROS_MASTER_URI is '{uri}', expected http://HOST:PORT"
    answered = threading.Event()
    # On a thread: an unresolvable host or a port that never answers would block for minutes.
    threading.Thread(target=_ask, args=(master, answered, time.monotonic() + patience), daemon=True).start()
    if answered.wait(patience):
        return ""
    return f"no ROS master answers at {uri}: start the launch file first, or set ROS_MASTER_URI"


def _ask(master: Any, answered: threading.Event, until: float) -> None:
    while time.monotonic() < until:
        if master.is_online():
            answered.set()
            return
        time.sleep(0.2)


def require_publisher(subscriber: rospy.Subscriber, who: str, *, patience: float = PATIENCE) -> None:
    """Wait until somebody publishes the subscriber's topic.

    Args:
        subscriber: subscriber of the topic.
        who: the program that should publish it.
        patience: longest wait [s].

    Raises:
        NobodyThere: there is no publisher.
    """
    until = time.monotonic() + patience
    while not rospy.is_shutdown() and not subscriber.get_num_connections():
        if time.monotonic() >= until:
            raise NobodyThere(f"nobody publishes {subscriber.resolved_name}: is {who} running?")
        time.sleep(0.05)
