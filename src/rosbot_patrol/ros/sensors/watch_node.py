"""sensor_watch: supervises the motion sensors and the ROS graph; reports what is wrong on its topics and to the owner.

It subscribes to /motion_trigger from any publisher, to the bridges' /sensors/links and to the patrol's /patrol/alive: a
dead or hanging patrol cannot report itself. The patrol's /patrol/arming lists the guarded rooms; without that message,
or without a patrol, all rooms count as guarded. It publishes /sensors/states (latched), /sensors/events and
/diagnostics. Notices to the owner go through the outbox in ~state_dir. The outbox is shared with the patrol, but needs
no other node to deliver.

All durations are wall time: sensors send their heartbeats in real time, whatever /clock does.
"""

from __future__ import annotations

import logging
import time
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import rospy
from std_msgs.msg import Empty

from rosbot_patrol.alerts.channels.params import MailParams
from rosbot_patrol.alerts.dispatch.safe_outbox import RETRY
from rosbot_patrol.alerts.outbox.notice import Notice
from rosbot_patrol.counts import count_of
from rosbot_patrol.errors import StateError
from rosbot_patrol.files import read_json, write_json
from rosbot_patrol.host.watchdog import Systemd
from rosbot_patrol.msg import Arming as ArmingMsg
from rosbot_patrol.msg import EspTrigger, SensorEvent, SensorLinks, SensorStates
from rosbot_patrol.params import declared, param
from rosbot_patrol.patrol.house.own_files import CHANNELS, ROOMS, SENSORS, own_file, watched_files
from rosbot_patrol.patrol.house.rooms import load_rooms
from rosbot_patrol.ros.bridge.links import links_from_msg
from rosbot_patrol.ros.post.owner_post import OwnerPost, refuse_passwords
from rosbot_patrol.ros.runtime.diagnostics import Health
from rosbot_patrol.ros.runtime.file_watch import FileWatch
from rosbot_patrol.ros.runtime.node import Worker, load_params, private_params, run_node, sender_of
from rosbot_patrol.ros.runtime.private_files import keep_private
from rosbot_patrol.ros.runtime.process import start_anew
from rosbot_patrol.ros.runtime.state_folder import state_folder
from rosbot_patrol.ros.sensors.graph_reader import GraphParams, GraphReader
from rosbot_patrol.ros.sensors.heartbeat import Heartbeat, HeartbeatParams
from rosbot_patrol.ros.sensors.reports import Reports, event_to_msg, look_to_msg, states_to_msg
from rosbot_patrol.sensors.looks import Looks
from rosbot_patrol.sensors.notices import Notices, SensorReport
from rosbot_patrol.sensors.problems import SERIOUS, Kind
from rosbot_patrol.sensors.sensor_file import SensorList, load_sensors
from rosbot_patrol.sensors.settings import LookTimes, NoticeTimes, WatchTimes
from rosbot_patrol.sensors.supervisor import SensorStatus, Supervisor
from rosbot_patrol.simulation.sensors.sensor_places import read_sensors

log = logging.getLogger(__name__)

STEP = 0.25  # [s] of the wall
REPORT_EVERY = 4  # steps
STATES_EVERY = 20  # steps between messages if nothing changes
_HELD_UP_BY = (Kind.PATROL_GONE, Kind.BRIDGE_GONE)
MAX_WAITING = 20_000  # messages between two steps; far above the rate of a flood


@dataclass(frozen=True, kw_only=True)
class SensorWatchParams:
    """The node's own parameters; mail, times and looks have their own declarations."""

    path_to_params: str = param(doc="points file with the names of the rooms")
    sensors: str = param("", doc="sensors file; empty or missing: a sensor's id is the number of its room")
    motion_sensors: str = param("", doc="the simulator's sensors file, compared with `sensors`; empty: none")
    state_dir: str = param(
        "", doc="folder of waiting notices, the patrol's own; empty: rosbot_patrol(-NAMESPACE) in ROS's home"
    )


GROUPS = (SensorWatchParams, WatchTimes, NoticeTimes, LookTimes, MailParams, GraphParams, HeartbeatParams)


def load_group(cls: type, tree: Mapping[str, Any]) -> Any:
    """Load one of the groups that share the node's flat namespace; only the first warns of unknown names."""
    others = {name for other in GROUPS if other is not cls for name, *_ in declared(other)}
    return load_params(cls, tree=dict(tree), ignore=others | (set(tree) if cls is not GROUPS[0] else set()))


def own_params(params: SensorWatchParams, state_dir: Path) -> SensorWatchParams:
    """The parameters with the owner's copies of files that come with the program."""
    sensors = own_file(params.sensors, state_dir, SENSORS)
    is_own = sensors not in (params.sensors, "")  # then the owner decides, not the simulator's file
    return replace(
        params,
        path_to_params=own_file(params.path_to_params, state_dir, ROOMS),
        sensors=sensors,
        motion_sensors="" if is_own else params.motion_sensors,
    )


def load_list(params: SensorWatchParams) -> SensorList:
    """Load the sensors, checked against rooms and simulator; raises ParamError."""
    rooms = load_rooms(Path(params.path_to_params).expanduser())
    sensors = load_sensors(params.sensors, {room.id: room.name for room in rooms}, rooms_source=rooms.source)
    if sensors.has_file and params.motion_sensors:
        sensors.check_places([(p.id, p.room) for p in read_sensors(params.motion_sensors)], params.motion_sensors)
    return sensors


def _files(params: SensorWatchParams, mail: MailParams, state_dir: Path) -> list[Path]:
    """All files that the node reads at its start, and the places where the owner's copies would be."""
    return watched_files({ROOMS: params.path_to_params, SENSORS: params.sensors, CHANNELS: mail.channels}, state_dir)


class SensorWatch:
    """The node sensor_watch: inputs, one thread that steps the supervisor, outputs."""

    def __init__(self) -> None:
        tree = private_params()
        refuse_passwords(tree)
        given, mail = load_group(SensorWatchParams, tree), load_group(MailParams, tree)
        folder = state_folder(given.state_dir, rospy.get_namespace())
        params = own_params(given, folder)
        sensors = load_list(params)
        keep_private(folder)
        self._memory = folder / "sensors.json"
        self._health = Health("motion sensors")
        self._files = FileWatch(_files(given, mail, folder), lambda: load_list(own_params(given, folder)), self._health)
        mail = replace(mail, channels=own_file(mail.channels, folder, CHANNELS))
        self._post = OwnerPost(mail, folder, self._health)
        self._watch = Supervisor(sensors, load_group(WatchTimes, tree), time.monotonic())
        self._guarded: frozenset[int] | None = None  # guarded rooms, None for all
        self._muted: frozenset[int] = frozenset()
        self._notices = Notices(
            load_group(NoticeTimes, tree), time.monotonic(), read_memory(self._memory), is_guarded=self._is_guarded
        )
        memory = read_memory(self._memory) or {}
        known = memory.get("addresses")
        self._watch.recall_addresses(known if isinstance(known, dict) else {})
        self._addresses = self._watch.addresses()
        self._looks = Looks(load_group(LookTimes, tree))
        self._reports = Reports(self._health)
        self._graph = GraphReader(load_group(GraphParams, tree))
        self._heartbeat = Heartbeat(load_group(HeartbeatParams, tree), self._health)
        self._systemd = Systemd()
        self._unwritten = False
        self._retry_at = 0.0
        named = f"{count_of(len(sensors), 'sensor')} of {sensors.source}"
        where = named if sensors.has_file else "whatever sensor is heard"
        log.info("watching %s", where)

    def run(self) -> None:
        """Supervise until shutdown."""
        self._triggers: deque[tuple[int, bool, str, float]] = deque(maxlen=MAX_WAITING)
        self._links: deque[tuple[SensorLinks, float, float]] = deque(maxlen=1000)
        self._patrol: deque[tuple[str, float]] = deque(maxlen=10)
        self._states = rospy.Publisher("sensors/states", SensorStates, queue_size=5, latch=True)
        self._events = rospy.Publisher("sensors/events", SensorEvent, queue_size=100)
        self._simulated = bool(rospy.get_param("/use_sim_time", False))
        rospy.Subscriber("motion_trigger", EspTrigger, self._on_trigger, queue_size=1000)
        rospy.Subscriber("patrol/alive", Empty, self._on_patrol, queue_size=10)
        rospy.Subscriber("patrol/arming", ArmingMsg, self._on_arming, queue_size=10)
        rospy.Subscriber("sensors/links", SensorLinks, self._on_links, queue_size=100)
        self._post.start()
        self._graph.start()
        self._heartbeat.start()
        Worker(self._work, name="watch").start()
        rospy.spin()

    # -- callbacks store

    def _on_trigger(self, message: EspTrigger) -> None:
        self._triggers.append((message.id, message.move, sender_of(message), time.monotonic()))

    def _on_patrol(self, message: Empty) -> None:
        self._patrol.append((sender_of(message), time.monotonic()))

    def _on_arming(self, message: ArmingMsg) -> None:
        self._guarded = None if message.all_rooms else frozenset(message.rooms)
        self._muted = frozenset(message.muted)

    def _on_links(self, message: SensorLinks) -> None:
        # in simulated time both stamps come from one clock
        offset = 0.0 if self._simulated else message.header.stamp.to_sec() - rospy.get_time()
        self._links.append((message, offset, time.monotonic()))

    # -- step

    def _is_guarded(self, room: int | None) -> bool:
        """Whether motion in a room is an alarm; an unknown room counts as guarded."""
        guarded = self._guarded
        if room in self._muted:
            return False
        is_patrol_gone = any(key.kind is Kind.PATROL_GONE for key in self._watch.problems())
        return guarded is None or room is None or room in guarded or is_patrol_gone

    def _work(self) -> None:
        count = 0
        while not rospy.is_shutdown():
            try:
                self._step(count)
            except rospy.ROSException:
                if rospy.is_shutdown():
                    return
                raise
            count += 1
            if self._files.has_news():
                start_anew("its files have changed")
                return
            time.sleep(STEP)

    def _step(self, count: int) -> None:
        self._take()
        self._watch.graph_seen(self._graph.findings)
        events = self._watch.tick(time.monotonic())
        for event in events:
            is_bad = event.active and event.problem.key.kind in SERIOUS
            log.log(logging.WARNING if is_bad else logging.INFO, "%s", event.text)
            self._events.publish(event_to_msg(event, self._watch))
        if count % REPORT_EVERY and not events:
            return
        statuses = self._watch.statuses()
        self._reports.update(statuses, self._watch)
        self._reports.update_graph(self._watch, self._graph.findings)
        if events or not count % STATES_EVERY:
            self._states.publish(states_to_msg(statuses, self._watch))
        self._report_life()
        self._tell_owner(statuses)
        for look in self._looks.update(self._watch, statuses, time.monotonic()):
            log.warning("%s: the robot is asked to look at room %d", look.text, look.room)
            self._events.publish(look_to_msg(look, self._watch))

    def _report_life(self) -> None:
        """Tell systemd and the heartbeat's service, once the patrol was heard, that all is at work, or well."""
        if not self._watch.patrol:
            return
        problems = self._watch.problems()
        gone = [self._watch.title(key) for key in problems if key.kind in _HELD_UP_BY]
        if not self._post.is_at_work:
            gone.append("the post")
        self._systemd.say(f"not at work: {', '.join(gone)}" if gone else "on guard")
        if not gone:
            self._systemd.feed()
        if not gone and not any(key.kind in SERIOUS for key in problems):
            self._heartbeat.all_is_well(time.monotonic())

    def _take(self) -> None:
        while self._triggers:
            sensor_id, move, sender, at = self._triggers.popleft()
            self._watch.heard(sensor_id, sender, at, move=move)
        while self._patrol:
            self._watch.patrol_heard(*self._patrol.popleft())
        while self._links:
            message, offset, at = self._links.popleft()
            self._watch.linked(message.bridge, links_from_msg(message), at, clock_offset=offset)

    def _tell_owner(self, statuses: list[SensorStatus]) -> None:
        now = time.monotonic()
        report = self._notices.update(self._watch, statuses, now, time.time())
        if report is not None:
            log.warning("notice to the owner: %s", report.subject)
            self._post.put(to_notice(report))
            self._unwritten, self._retry_at = True, now
        if self._watch.addresses() != self._addresses:
            self._addresses = self._watch.addresses()
            self._unwritten = True
        if self._unwritten and now >= self._retry_at and self._post.is_written:
            self._remember(now)

    def _remember(self, now: float) -> None:
        """Save what was reported, after the notices themselves are on disk."""
        try:
            write_json(self._memory, {**self._notices.snapshot(), "addresses": self._addresses})
        except OSError as err:
            log.error("what was told cannot be kept in %s: %s; trying on", self._memory, err)
            self._retry_at = now + RETRY
        else:
            self._unwritten = False


def to_notice(report: SensorReport) -> Notice:
    """Convert a report for the outbox."""
    return Notice(id=report.id, wall=time.time(), kind="sensor", subject=report.subject, text=report.text)


def read_memory(path: Path) -> Mapping[str, Any] | None:
    """Load what was reported before the restart; None if there is nothing valid."""
    try:
        return read_json(path)
    except StateError as err:
        log.warning("%s; starting afresh", err)
        return None


def main() -> None:
    """Run the node."""
    run_node("sensor_watch", lambda: SensorWatch().run())
