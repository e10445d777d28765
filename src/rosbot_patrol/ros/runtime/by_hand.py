"""Programs started by hand: they end with a sentence if a required program is missing; under roslaunch they wait."""

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
    """A required program is not running."""


def is_launched() -> bool:
    """Whether roslaunch started this program: it gives a name of a log file."""
    return any(word.startswith("__log:=") for word in sys.argv)


def require_master(program: str, *, patience: float = PATIENCE, status: int = 1) -> None:
    """End the program with one sentence if no ROS master answers; under roslaunch do nothing.

    Args:
        program: its name.
        patience: how long to wait for the master [s].
        status: the exit status.
    """
    problem = "" if is_launched() else master_problem(patience)
    if problem:
        print(f"{program}: {problem}", file=sys.stderr, flush=True)
        sys.exit(status)


def master_problem(patience: float = PATIENCE) -> str:
    """Reason why no ROS master is available, "" if one answers within `patience` [s]."""
    uri = ""
    try:
        uri = rosgraph.get_master_uri()
        master = rosgraph.Master("/by_hand", master_uri=uri)
    except (ValueError, OSError):
        return f"ROS_MASTER_URI is '{uri}', expected http://HOST:PORT"
    answered = threading.Event()
    # On a thread: an unresolvable host or a silent port would block for minutes.
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
    """Wait until a topic has a publisher.

    Args:
        subscriber: of the topic.
        who: name of the program that should publish it.
        patience: longest wait [s].

    Raises:
        NobodyThere: there is no publisher.
    """
    until = time.monotonic() + patience
    while not rospy.is_shutdown() and not subscriber.get_num_connections():
        if time.monotonic() >= until:
            raise NobodyThere(f"nobody publishes {subscriber.resolved_name}: is {who} running?")
        time.sleep(0.05)
