"""twist_mux: the only publisher of the base's velocity, with the collision guard behind it.

Matches twist_mux 3.1 (Noetic): `~topics` and `~locks` (name, topic, timeout, priority), `cmd_vel_out`.

Differs:
- Whatever the source, the base gives way to people that it would cross (`~give_way`).
- The chosen command goes through the collision guard (`~guard`, true). It slows or stops for obstacles in the direction
  of motion, seen by `scan` and the range sensors of `~range_topics`. It checks a command again with each scan, not only
  when it comes. A scan without information, or from a tilted laser, counts as none: the base creeps, and /diagnostics
  and the log say why.
- When every source has fallen silent, or a lock closes, a zero is published; upstream publishes nothing.
- A topic that has lost its last publisher is silent at once: on one host the death of a program is noticed within
  milliseconds. The time-out remains for a program that hangs, or a host that has gone.
- Only the planar part of a Twist is passed on.
"""

from __future__ import annotations

import dataclasses
import logging
import math
import threading
import time
from dataclasses import dataclass
from functools import partial

import rospy
from geometry_msgs.msg import Twist
from sensor_msgs.msg import LaserScan as LaserScanMsg
from sensor_msgs.msg import Range
from std_msgs.msg import Bool

from rosbot_patrol.control.collision_guard import Cause, CollisionGuard, GuardParams, RangeReading, Verdict
from rosbot_patrol.control.give_way import GiveWay, GiveWayParams
from rosbot_patrol.control.movers import MoverParams, MoverWatch
from rosbot_patrol.control.mux import Choice, LockParams, MuxParams, SourceParams, TwistMux
from rosbot_patrol.errors import TransformError
from rosbot_patrol.geometry import STOP, Pose2D, Twist2D, compose
from rosbot_patrol.params import param
from rosbot_patrol.ros.messages.convert import scan_from_msg, twist_from_msg, twist_to_msg
from rosbot_patrol.ros.runtime.diagnostics import OK, WARN, Health
from rosbot_patrol.ros.runtime.latest import Latest
from rosbot_patrol.ros.runtime.node import load_params, now, run_node
from rosbot_patrol.ros.runtime.process import Priority
from rosbot_patrol.ros.runtime.transforms import Transforms
from rosbot_patrol.scan import LaserScan, level_scan
from rosbot_patrol.scan_check import ScanCheck
from rosbot_patrol.tf.frames import NO_FRAME

log = logging.getLogger(__name__)

STEP = 0.04  # longest wall time between two checks without input [s]
REPEAT_STOP = 0.2  # period of a lock's repeated zero [s]
REPEAT_LOG = 15.0


@dataclass(frozen=True, kw_only=True)
class TwistMuxParams(MuxParams):
    """Parameters of twist_mux."""

    guard: bool = param(True, doc="slow down and stop for obstacles that the lidar sees")
    base_frame: str = param("base_link", doc="frame of the footprint")
    odom_frame: str = param("odom", doc="frame in which motion between scans is measured")
    range_topics: tuple[str, ...] = param(
        (), doc="topics of sensor_msgs/Range near the floor; the guard stops for them, too"
    )
    collision_guard: GuardParams = dataclasses.field(default_factory=GuardParams)
    give_way: GiveWayParams = dataclasses.field(default_factory=lambda: GiveWayParams(horizon=1.5))
    movers: MoverParams = dataclasses.field(default_factory=MoverParams)


class Eyes:
    """Inputs of the guard: scans, ranges, and the robot's motion since then."""

    def __init__(self, params: TwistMuxParams, wake: threading.Event) -> None:
        self.guard = CollisionGuard(params.collision_guard)
        self._movers = MoverWatch(params.movers)
        self._give_way = GiveWay(params.give_way)
        self._params = params
        self._transforms = Transforms()
        self._scans: Latest[LaserScanMsg] = Latest()
        self._check = ScanCheck("the collision guard lets the base creep only")
        self._mounts: dict[str, Pose2D] = {}
        self._logged_at = float("-inf")
        self._wake = wake
        self._ranges: dict[str, Latest[Range]] = {topic: Latest() for topic in params.range_topics}
        rospy.Subscriber("scan", LaserScanMsg, self._on_scan, queue_size=1, tcp_nodelay=True)
        for topic in self._ranges:
            rospy.Subscriber(topic, Range, partial(self._on_range, topic), queue_size=1, tcp_nodelay=True)

    def look(self) -> bool:
        """Pass the newest scan and ranges to the guard; returns whether there was a scan."""
        for topic, latest in self._ranges.items():
            reading = latest.take()
            if reading is not None:
                self._look_low(topic, reading, latest.stamp)
        message = self._scans.take()
        return message is not None and self._look_round(scan_from_msg(message), self._scans.stamp)

    def _look_round(self, scan: LaserScan, stamp: float) -> bool:
        """Pass a scan received at a time [s] to the guard; returns whether it was usable."""
        base = self._params.base_frame
        if not self._check.accepts(scan, stamp):
            self.guard.refuse(self._check.problem)
            return False
        try:
            level = level_scan(scan, self._transforms.transform(base, scan.frame_id), base)
        except TransformError as err:
            self._check.refuse(f"the collision guard cannot place the scan: {err}", stamp)
            self.guard.refuse(str(err))
            return False
        self._check.clear(stamp)
        pose = self.pose(scan.stamp)
        self.guard.see(level.scan, level.pose, stamp, pose)
        if pose is not None:
            self._movers.see(level.scan, compose(pose, level.pose))
        return True

    def _look_low(self, topic: str, message: Range, stamp: float) -> None:
        if math.isfinite(message.range) and message.range < 0.0:
            self._complain("%s says %g m, as a broken sensor does: the reading is left out", topic, message.range)
        mount = self._mount(message.header.frame_id, topic)
        if mount is not None:
            reading = RangeReading(message.range, message.min_range, message.max_range, mount)
            self.guard.see_range(topic, reading, stamp, self.pose(message.header.stamp.to_sec()))

    def _mount(self, frame: str, what: str) -> Pose2D | None:
        """base_from_sensor of a range sensor, None (with a log line) if it is unknown."""
        frame = frame.lstrip("/")
        if not frame:
            self._complain("the collision guard cannot place %s: its messages name no frame: %s", what, NO_FRAME)
            return None
        try:
            if frame not in self._mounts:
                self._mounts[frame] = self._transforms.lookup(self._params.base_frame, frame)
        except TransformError as err:
            self._complain("the collision guard cannot place %s: %s", what, err)
            return None
        return self._mounts[frame]

    def _complain(self, text: str, *args: object) -> None:
        if time.monotonic() - self._logged_at > REPEAT_LOG:
            self._logged_at = time.monotonic()
            log.warning(text, *args)

    def limit(self, wish: Twist2D, current: float) -> Verdict:
        """Limit a command to its safe part."""
        pose = self.pose()
        if pose is not None and abs(current - self._movers.stamp) < self._params.collision_guard.stale_after:
            someone = self._give_way.waits(wish, self._movers.movers(current), pose, current)
            if someone:
                return Verdict(STOP, 0.0, Cause.SOMEONE, someone)
        return self.guard.limit(wish, current, pose)

    def pose(self, stamp: float | None = None) -> Pose2D | None:
        """odom_from_base at a time, else the newest, None if there is none."""
        odom, base = self._params.odom_frame, self._params.base_frame
        for when in (stamp, None):
            try:
                return self._transforms.lookup(odom, base, when)
            except TransformError:
                if when is None:
                    return None
        return None

    def _on_range(self, topic: str, message: Range) -> None:
        self._ranges[topic].set(message, now())

    def _on_scan(self, message: LaserScanMsg) -> None:
        self._scans.set(message, now())
        self._wake.set()


class TwistMuxNode:
    """The node twist_mux: callbacks store and wake; one thread chooses, guards and publishes."""

    def __init__(self, params: TwistMuxParams) -> None:
        self._mux = TwistMux(params)
        self._lock = threading.Lock()
        self._wake = threading.Event()
        self._publisher = rospy.Publisher("cmd_vel_out", Twist, queue_size=1, tcp_nodelay=True)
        self._health = Health()
        self._eyes = Eyes(params, self._wake) if params.guard else None
        self._last: Choice = Choice(None, STOP)
        self._stopped_at = float("-inf")
        self._cause = Cause.NONE
        self._blind = ""
        self._logged_at = float("-inf")
        self._subscribers: dict[str, rospy.Subscriber] = {}
        for source in params.topics:
            self._listen(source)
        for lock in params.locks:
            self._listen_lock(lock)

    def run(self) -> None:
        """Choose and publish until shutdown, then stop the base."""
        while not rospy.is_shutdown():
            self._wake.wait(STEP)
            self._wake.clear()
            self._step(now())

    def stop(self) -> None:
        """Send a zero velocity."""
        self._publisher.publish(twist_to_msg(STOP))

    def _listen(self, source: SourceParams) -> None:
        def callback(message: Twist) -> None:
            with self._lock:
                self._mux.command(source.name, twist_from_msg(message), now())
            self._wake.set()

        self._subscribers[source.name] = rospy.Subscriber(source.topic, Twist, callback, queue_size=1, tcp_nodelay=True)

    def _listen_lock(self, lock: LockParams) -> None:
        def callback(message: Bool) -> None:
            with self._lock:
                self._mux.lock(lock.name, bool(message.data), now())
            self._wake.set()

        rospy.Subscriber(lock.topic, Bool, callback, queue_size=1)

    def _step(self, current: float) -> None:
        with self._lock:
            self._forget_the_gone()
            choice = self._mux.choose(current)
        seen = self._eyes.look() if self._eyes is not None else False
        self._blind = self._eyes.guard.blind(current) if self._eyes is not None else ""
        if choice.source is None:
            self._stand(choice, current)
        elif choice.fresh or seen:
            verdict = self._guarded(choice.twist, current)
            self._publisher.publish(twist_to_msg(verdict.twist))
            self._tell(choice, verdict)
        self._last = choice

    def _forget_the_gone(self) -> None:
        for name, subscriber in self._subscribers.items():
            if subscriber.get_num_connections() == 0 and self._mux.forget(name) and name == self._last.source:
                log.warning("%s has gone while it drove", name)

    def _stand(self, choice: Choice, current: float) -> None:
        """Publish a zero if the base was driven until now, and repeatedly while a lock holds."""
        due = choice.lock is not None and not 0.0 <= current - self._stopped_at < REPEAT_STOP
        if self._last.source is not None or due:
            self._stopped_at = current
            self.stop()
        text = f"{choice.lock} is locked" if choice.lock else "nobody commands"
        is_refused = self._eyes is not None and bool(self._blind and self._eyes.guard.problem)
        if is_refused:
            text += f"; {self._blind}"
        self._health.set("", WARN if choice.lock or is_refused else OK, text)
        if choice.lock and self._last.lock != choice.lock:
            log.warning("the base is stopped: %s is set", choice.lock)
        self._cause = Cause.NONE

    def _guarded(self, wish: Twist2D, current: float) -> Verdict:
        if self._eyes is None:
            return Verdict(wish, 1.0)
        return self._eyes.limit(wish, current)

    def _tell(self, choice: Choice, verdict: Verdict) -> None:
        is_held = verdict.scale < 0.05 or bool(self._blind)
        self._health.set(
            "",
            WARN if is_held else OK,
            f"{choice.source} drives" + (f"; {self._blind}" if self._blind else ""),
            {"guard": verdict.reason or "free", "part of the wish": f"{verdict.scale:.2f}"},
        )
        cause = Cause.BLIND if self._blind else verdict.cause
        if is_held and cause is not self._cause and time.monotonic() - self._logged_at > REPEAT_LOG:
            self._logged_at = time.monotonic()
            log.warning("%s is held back: %s", choice.source, verdict.reason)
        self._cause = cause


def body() -> None:
    """Run until shutdown."""
    node = TwistMuxNode(load_params(TwistMuxParams))
    rospy.on_shutdown(node.stop)
    node.run()


def main() -> None:
    """Run the node."""
    run_node("twist_mux", body, priority=Priority.CONTROL)
