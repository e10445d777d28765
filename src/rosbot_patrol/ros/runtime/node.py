"""Start and end of a node, and its loop on wall or ROS time."""

from __future__ import annotations

import logging
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import rospy
from rospy.core import is_shutdown_requested
from rospy.rostime import is_wallclock

from rosbot_patrol import params
from rosbot_patrol.errors import ParamError, PatrolError, StateError
from rosbot_patrol.files import read_json
from rosbot_patrol.ros.runtime import connections, greeting, logs
from rosbot_patrol.ros.runtime.by_hand import require_master
from rosbot_patrol.ros.runtime.process import Priority, follow_restart, give_back_memory, take

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

SERVICE_PARAMS = "ROSBOT_PATROL_PARAMS"
FROM_FILE = frozenset(
    {
        *("patrolling_node", "sensor_watch", "console", "home_assistant", "twist_mux", "map_server"),
        *("esp_client1", "esp_client2", "esp_client3"),
    }
)
T = TypeVar("T", bound="DataclassInstance")

log = logging.getLogger(__name__)


def run_node(
    name: str,
    body: Callable[[], None],
    *,
    priority: Priority = Priority.ORDINARY,
    by_hand: bool = False,
    **init_options: Any,
) -> None:
    """Start a node and run `body`; a PatrolError or a bad file is logged in one sentence and the program exits 1.

    Args:
        name: name of the node if the launch file gives none.
        body: builds and runs it; returns on shutdown.
        priority: among the processes of the machine, as far as the system permits.
        by_hand: people type this program: without a ROS master it ends, unless roslaunch started it.
        init_options: further arguments of `rospy.init_node`.
    """
    if by_hand:
        require_master(name)
    refused = take(priority)  # before any thread starts: threads inherit it
    gives_back = give_back_memory()
    greeting.install()
    connections.install()
    rospy.init_node(name, **init_options)
    logs.install()
    if refused:
        log.info("%s", refused)
    if not gives_back:
        log.info("this C library keeps freed memory: the node takes more of it than need be")
    threading.excepthook = _end_with_worker
    ending = _Ending()
    try:
        body()
        ending.finish()
        follow_restart()
    except (PatrolError, OSError) as err:
        rospy.logfatal("%s: %s", rospy.get_name(), err)
        time.sleep(0.3)  # another thread sends /rosout
        rospy.signal_shutdown(str(err))
        sys.stdout.flush()
        os._exit(1)
    except rospy.ROSException:  # sleep or publish during shutdown; topics close before is_shutdown is true
        if not is_shutdown_requested():
            raise
        ending.finish()


class _Ending:
    """End the node on a thread of its own when a signal comes.

    rospy ends it within the signal handler, on the main thread. If that thread just waits for the master, it holds
    rospy's lock around the master, and the node never ends. The main thread must not block without checking
    `rospy.is_shutdown`.
    """

    def __init__(self) -> None:
        self._read, self._write = os.pipe()
        self._rospys: dict[int, Any] = {}
        self._has_come = False
        self._done = threading.Event()
        for number in (signal.SIGINT, signal.SIGTERM):
            self._rospys[number] = signal.signal(number, self._note)
        threading.Thread(target=self._work, name="ending", daemon=True).start()

    def finish(self) -> None:
        """Let a running shutdown unregister at the master."""
        if self._has_come:
            self._done.wait(5.0)

    def _note(self, number: int, _frame: object) -> None:
        self._has_come = True
        os.write(self._write, bytes([number]))  # takes no lock

    def _work(self) -> None:
        while True:
            number = os.read(self._read, 1)[0]
            handler = self._rospys[number]
            if callable(handler):
                handler(number, None)
            else:
                rospy.signal_shutdown(f"signal {number}")
            self._done.set()


def load_params(cls: type[T], *, ignore: Iterable[str] = (), tree: dict[str, Any] | None = None) -> T:
    """Load the node's private parameters through their declaration (one round trip to the master)."""
    if tree is None:
        tree = private_params()
    return params.load(cls, tree, name=rospy.get_name() + "/", ignore=ignore)


def private_params() -> dict[str, Any]:
    """The node's private parameters: from the parameter server, or where it runs as a service, from the service's file.

    Anybody who reaches the master can change parameters there, and a node that starts again would take them. The
    service (`host/serve.py`) writes what the launch file sets into a file. Nodes with dynamic_reconfigure still read
    the server, where their changes outlast a restart.

    Raises:
        ParamError: the file cannot be used.
    """
    path = os.environ.get(SERVICE_PARAMS, "")
    name = rospy.get_name()
    if path and name.rpartition("/")[2] in FROM_FILE:
        try:
            tree: Any = read_json(Path(path)) or {}
        except StateError as err:
            raise ParamError(name, str(err)) from err
        for part in name.strip("/").split("/"):
            tree = tree.get(part, {}) if isinstance(tree, dict) else {}
        return dict(tree)
    return dict(rospy.get_param("~", {}) or {})


def ros_home() -> Path:
    """ROS's folder for a user's files."""
    return Path(os.environ.get("ROS_HOME") or "~/.ros").expanduser()


def sender_of(message: object) -> str:
    """Name of the node that published a message, "" if it did not come from a topic."""
    header = getattr(message, "_connection_header", None) or {}
    return str(header.get("callerid", ""))


def now() -> float:
    """ROS time [s]."""
    return float(rospy.get_time())


class Worker(threading.Thread):
    """A thread that the node needs: an exception that leaves it is logged and ends the node.

    Otherwise the node would look alive with half of it dead; the launch file's respawn restarts it whole. `run_node`
    ends the process.
    """

    def __init__(self, target: Callable[[], None] | None = None, *, name: str) -> None:
        super().__init__(target=target, name=name, daemon=True)


def _end_with_worker(args: threading.ExceptHookArgs) -> None:
    if args.exc_type is not SystemExit and isinstance(args.thread, Worker):
        if rospy.is_shutdown() and issubclass(args.exc_type, rospy.ROSException):
            return
        what = (args.exc_type, args.exc_value or args.exc_type(), args.exc_traceback)
        log.critical("%s: '%s' failed, the node ends", rospy.get_name(), args.thread.name, exc_info=what)
        time.sleep(0.3)  # another thread sends /rosout
        os._exit(1)
    threading.__excepthook__(args)


_LONGEST_S = 0.1  # sleep of a loop [s of the wall]
_SHORTEST_S = 0.001  # the same while simulated time is awaited
_PACE_S = 0.2  # over which the pace of simulated time is taken [s of the wall]


class Loop(Worker):
    """Call `step(now)` at a rate of ROS time on its own thread; it does not hang if simulated time stops.

    After a step that takes too long the next follows at once; missed steps are not repeated. On the wall's time it
    sleeps until the next step. Simulated time comes in ticks and at a pace of its own: there each sleep is half of what
    is left at the pace so far, as waking at each tick would cost more than most steps.
    """

    def __init__(self, rate: float, step: Callable[[float], None], *, name: str = "loop") -> None:
        super().__init__(name=name)
        self._period = 1.0 / rate
        self._step = step
        self._wake = threading.Event()
        self._pace = 1.0  # seconds of ROS time in one of the wall
        self._paced = time.monotonic(), 0.0  # wall and ROS time from which on it is taken

    def set_rate(self, rate: float) -> None:
        """Change the rate from the next step on."""
        self._period = 1.0 / rate

    def hurry(self) -> None:
        """Request an extra step at once; callable from any thread."""
        self._wake.set()

    def run(self) -> None:
        """Run until shutdown."""
        due = now()
        while not rospy.is_shutdown():
            current = now()
            if current + self._period + 1.0 < due:  # time went back
                due = current
            if current >= due:
                due = max(due + self._period, current)
            elif not self._wake.is_set():
                self._wait(current, due)
                continue
            self._wake.clear()
            self._step(current)

    def _wait(self, current: float, due: float) -> None:
        seconds = due - current
        if not is_wallclock():
            seconds = max(0.5 * seconds / self._measured_pace(current), _SHORTEST_S)
        self._wake.wait(min(seconds, _LONGEST_S))

    def _measured_pace(self, current: float) -> float:
        wall, (since, before) = time.monotonic(), self._paced
        if wall - since >= _PACE_S:
            self._pace = max((current - before) / (wall - since), 1.0)
            self._paced = wall, current
        return self._pace
