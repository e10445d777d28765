"""The whole house as a child process, driven and observed from outside: for system tests, benchmarks, campaigns.

It uses only a user's means: `roslaunch`, topics and services. One process may run several houses one after another on
one master.
"""

from __future__ import annotations

import contextlib
import itertools
import math
import os
import signal
import subprocess
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import rosgraph
import rosnode
import rospy
from geometry_msgs.msg import Pose2D as Pose2DMsg
from nav_msgs.msg import Odometry

from rosbot_patrol.errors import PatrolError
from rosbot_patrol.geometry import Pose2D, wrap_angle
from rosbot_patrol.msg import Alert, Contacts, EspTrigger, PatrolState
from rosbot_patrol.ros.campaign.ports import free_port
from rosbot_patrol.ros.messages.convert import pose2d_from_pose
from rosbot_patrol.srv import MoveActor, RemoveActor, SpawnActor


class HouseError(PatrolError):
    """The house did not start, or an expected event did not happen."""


class Master:
    """Our own roscore, with this process as a node on wall time.

    Args:
        log: log file of the roscore.
        host: name or address of this machine, for nodes on other machines.
    """

    def __init__(self, log: Path, host: str = "localhost") -> None:
        self.port = free_port()
        os.environ["ROS_MASTER_URI"] = f"http://{host}:{self.port}"
        os.environ["ROS_HOSTNAME"] = host
        with log.open("wb") as out:
            self._core = subprocess.Popen(
                ["roscore", "-p", str(self.port)], stdout=out, stderr=subprocess.STDOUT, start_new_session=True
            )
        deadline = time.monotonic() + 20.0
        while not rosgraph.is_master_online():
            if time.monotonic() > deadline or self._core.poll() is not None:
                raise HouseError(f"roscore does not answer on port {self.port}, see {log}")
            time.sleep(0.1)
        rospy.set_param("/use_sim_time", False)
        rospy.init_node("house_watch", anonymous=True, disable_signals=True)

    def kill(self) -> None:
        """Kill it at once, as `kill -9` does."""
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self._core.pid, signal.SIGKILL)

    def stop(self) -> None:
        """End the roscore."""
        rospy.signal_shutdown("done")
        end_group(self._core)


def end_group(process: subprocess.Popen[bytes], grace_s: float = 20.0) -> None:
    """End a process that leads its own group: interrupt it, then kill the rest of the group."""
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGINT)
    with contextlib.suppress(subprocess.TimeoutExpired):
        process.wait(grace_s)
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()


def child_pids(pid: int) -> list[int]:
    """Direct children of a process."""
    try:
        return [int(p) for p in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()] + [
            int(p)
            for task in Path(f"/proc/{pid}/task").iterdir()
            if int(task.name) != pid
            for p in (task / "children").read_text().split()
        ]
    except OSError:
        return []


@dataclass
class Mission:
    """Observations of one mission, from ground truth.

    Attributes:
        look: begin and end of the look-around at the room's point, before any further viewpoint [s].
        headings: true heading of the robot by time [s, rad].
    """

    room: int
    states: list[str] = field(default_factory=list)
    verdict: str = ""
    why: list[str] = field(default_factory=list)
    arrival: Pose2D | None = None
    look: tuple[float, float] = (math.inf, math.inf)
    headings: list[tuple[float, float]] = field(default_factory=list)
    end: Pose2D | None = None
    alerts: list[Alert] = field(default_factory=list)
    contacts: list[tuple[str, str]] = field(default_factory=list)
    sim_seconds: float = 0.0
    wall_seconds: float = 0.0

    @property
    def turned(self) -> float:
        """Angle of the look-around at the room's point, by the stamps of states and headings [rad]."""
        begin, end = self.look
        headings = [yaw for stamp, yaw in self.headings if begin <= stamp <= end]
        return sum(wrap_angle(after - before) for before, after in itertools.pairwise(headings))

    def note_state(self, state: PatrolState) -> None:
        """Record a state of the patrol."""
        stamp = state.header.stamp.to_sec()
        is_at_point = state.state == PatrolState.LOOKING and "further viewpoint" not in state.why
        begin, end = self.look
        if math.isinf(begin) and is_at_point:
            self.look = (stamp, math.inf)
        elif math.isfinite(begin) and math.isinf(end) and not is_at_point:
            self.look = (begin, stamp)
        self.states.append(state.state)
        self.why.append(state.why)
        if state.state == PatrolState.IDLE:
            self.verdict = state.last_verdict


class House:
    """One launch of the guarded house.

    Args:
        folder: for logs, mails and state.
        launch: package and file for roslaunch.
        plain: pass only the arguments named here to the launch file.
        before: command that starts roslaunch, such as one that enters another host.
        arguments: arguments of the launch file; `ns` is the namespace of its topics.
    """

    def __init__(
        self, folder: Path, *launch: str, plain: bool = False, before: Sequence[str] = (), **arguments: Any
    ) -> None:
        self.folder = folder
        self.maildir = folder / "mail"
        self.log = folder / "roslaunch.log"
        command = list(launch) or ["rosbot_patrol", "rosbot_patrol.launch"]
        given: dict[str, Any] = (
            {}
            if plain
            else {
                "simulation": "true",
                "gui": "false",
                "transport": "maildir",
                "maildir": str(self.maildir),
                "state_dir": str(folder / "state"),
            }
        )
        if not launch and not plain:
            given["console"] = "false"  # nobody looks
        given.update(arguments)
        options = [f"{k}:={v}" for k, v in given.items()]
        self._command = [*before, "roslaunch", "--skip-log-check", *command, *options]
        self._process: subprocess.Popen[bytes] | None = None
        self._lock = threading.Lock()
        self._subscribers: list[rospy.Subscriber] = []
        self.state: PatrolState | None = None
        self.alerts: list[Alert] = []
        self.pose: Pose2D | None = None
        self.pose_stamp = 0.0
        self.contacts: list[tuple[str, str]] = []
        self._mission: Mission | None = None
        self._inside = f"/{arguments['ns']}/" if arguments.get("ns") else "/"
        self._trigger = rospy.Publisher(self.name("motion_trigger"), EspTrigger, queue_size=5)

    def __enter__(self) -> House:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def name(self, relative: str) -> str:
        """Absolute name of a topic or service of this house."""
        return self._inside + relative

    def start(self, environment: Mapping[str, str] | None = None) -> None:
        """Launch it, without waiting."""
        self.folder.mkdir(parents=True, exist_ok=True)
        with self.log.open("wb") as out:
            self._process = subprocess.Popen(
                self._command,
                stdout=out,
                stderr=subprocess.STDOUT,
                stdin=subprocess.DEVNULL,
                start_new_session=True,
                env={**os.environ, **(environment or {})},
            )
        self.started = time.monotonic()
        self._subscribers = [
            rospy.Subscriber(self.name("patrol/state"), PatrolState, self._on_state, queue_size=50),
            rospy.Subscriber(self.name("patrol/alerts"), Alert, self._on_alert, queue_size=50),
            rospy.Subscriber(self.name("ground_truth/odom"), Odometry, self._on_truth, queue_size=50),
            rospy.Subscriber(self.name("ground_truth/contacts"), Contacts, self._on_contacts, queue_size=50),
        ]

    def stop(self) -> None:
        """End all its processes."""
        for subscriber in self._subscribers:
            subscriber.unregister()
        self._subscribers = []
        if self._process is not None:
            end_group(self._process)
            self._process = None
        with contextlib.suppress(rosnode.ROSNodeIOException, OSError):
            rosnode.cleanup_master_blacklist(
                rosgraph.Master("/house"),
                [n for n in rosnode.get_node_names(self._inside) if "house_watch" not in n and n != "/rosout"],
            )

    def kill(self) -> None:
        """Kill all its processes at once, as `kill -9` does."""
        if self._process is not None:
            # roslaunch first, because it would end its nodes politely. The nodes lead their own groups.
            nodes = list(child_pids(self._process.pid))
            for pid in [self._process.pid, *nodes]:
                with contextlib.suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGKILL)
            self._process.wait()
            self._process = None

    @property
    def is_running(self) -> bool:
        """Whether the launch is still running."""
        return self._process is not None and self._process.poll() is None

    @property
    def pid(self) -> int:
        """Process id of roslaunch. Raises HouseError if there is none."""
        if self._process is None:
            raise HouseError("the house is not started")
        return self._process.pid

    def wait_ready(self, timeout: float = 60.0) -> float:
        """Wait until it is on guard; returns the seconds since the launch."""
        self.wait(lambda: self.state is not None and self.state.state == PatrolState.IDLE, timeout, "on guard")
        return time.monotonic() - self.started

    def wait(self, condition: Callable[[], bool], timeout: float, what: str) -> None:
        """Wait for a condition on wall time.

        Raises:
            HouseError: it did not become true, or the launch ended.
        """
        deadline = time.monotonic() + timeout
        while not condition():
            if self._process is None or self._process.poll() is not None:
                raise HouseError(f"roslaunch ended while waiting for: {what}\n{self.log_end()}")
            if time.monotonic() > deadline:
                state = "none" if self.state is None else f"{self.state.state} ({self.state.why})"
                raise HouseError(f"after {timeout:.0f} s still no: {what}; state: {state}\n{self.log_end()}")
            time.sleep(0.02)

    def log_end(self, lines: int = 40) -> str:
        """Last lines of the launch's output."""
        text = self.log.read_text(encoding="utf-8", errors="replace") if self.log.exists() else ""
        return "\n".join(text.splitlines()[-lines:])

    def trigger(self, room: int, move: bool = True) -> None:
        """Publish a motion trigger as `rostopic pub` does."""
        self.wait(
            lambda: self._trigger.get_num_connections() > 0, 10.0, f"a subscriber of {self.name('motion_trigger')}"
        )
        self._trigger.publish(EspTrigger(id=room, move=move))

    def spawn(
        self,
        name: str,
        x: float,
        y: float,
        *,
        yaw: float = 0.0,
        model: str = "person",
        look: str = "",
        posture: str = "",
    ) -> None:
        """Place an actor."""
        rospy.wait_for_service(self.name("simulator/spawn_actor"), 10.0)
        answer = rospy.ServiceProxy(self.name("simulator/spawn_actor"), SpawnActor)(
            name, model, look, posture, Pose2DMsg(x, y, yaw)
        )
        if not answer.success:
            raise HouseError(answer.message)

    def walk(self, name: str, points: list[tuple[float, float]], speed: float = 0.8, loop: bool = False) -> None:
        """Make an actor walk."""
        path = [Pose2DMsg(x, y, 0.0) for x, y in points]
        answer = rospy.ServiceProxy(self.name("simulator/move_actor"), MoveActor)(
            name=name, path=path, speed=speed, loop=loop
        )
        if not answer.success:
            raise HouseError(answer.message)

    def remove(self, name: str) -> None:
        """Remove an actor."""
        answer = rospy.ServiceProxy(self.name("simulator/remove_actor"), RemoveActor)(name)
        if not answer.success:
            raise HouseError(answer.message)

    def mission(self, room: int, timeout: float = 300.0, start: Callable[[], None] | None = None) -> Mission:
        """Trigger a room (or call `start`) and watch the mission until the robot is on guard again."""
        mission = Mission(room)
        begin, begin_sim = time.monotonic(), self.pose_stamp
        with self._lock:
            self._mission = mission
        (start or (lambda: self.trigger(room)))()
        self.wait(lambda: PatrolState.DRIVING in mission.states, 30.0, f"the robot driving to room {room}")
        self.wait(lambda: mission.states[-1] == PatrolState.IDLE, timeout, f"the end of the mission to room {room}")
        with self._lock:
            self._mission = None
        mission.end = self.pose
        mission.wall_seconds = time.monotonic() - begin
        mission.sim_seconds = self.pose_stamp - begin_sim
        return mission

    def pids(self) -> dict[str, int]:
        """Process id of every node of this master."""
        found = {}
        for name in rosnode.get_node_names():
            uri = rosnode.get_api_uri(rosgraph.Master("/house"), name, skip_cache=True)  # it may have been respawned
            if uri is None:
                continue
            with contextlib.suppress(OSError):
                code, _, pid = rospy.core.xmlrpcapi(uri).getPid("/house")
                if code == 1:
                    found[name] = int(pid)
        return found

    def mails(self) -> list[Path]:
        """Files in the Maildir, oldest first."""
        new = self.maildir / "new"
        return sorted(new.iterdir(), key=lambda p: p.stat().st_mtime) if new.is_dir() else []

    def _on_state(self, state: PatrolState) -> None:
        with self._lock:
            self.state = state
            mission = self._mission
            if mission is None:
                return
            if state.state == PatrolState.LOOKING and PatrolState.LOOKING not in mission.states:
                mission.arrival = self.pose
            if not mission.states and state.state == PatrolState.IDLE:
                return  # still the rest before the mission
            mission.note_state(state)

    def _on_alert(self, alert: Alert) -> None:
        if alert.kind == Alert.VERDICT:
            return  # the state reports it
        with self._lock:
            self.alerts.append(alert)
            if self._mission is not None:
                self._mission.alerts.append(alert)

    def _on_truth(self, odometry: Odometry) -> None:
        pose, stamp = pose2d_from_pose(odometry.pose.pose), odometry.header.stamp.to_sec()
        with self._lock:
            if self._mission is not None:
                self._mission.headings.append((stamp, pose.yaw))
            self.pose, self.pose_stamp = pose, stamp

    def _on_contacts(self, contacts: Contacts) -> None:
        touched = [(c.kind, c.other) for c in contacts.contacts]
        with self._lock:
            self.contacts += touched
            if self._mission is not None:
                self._mission.contacts += touched
