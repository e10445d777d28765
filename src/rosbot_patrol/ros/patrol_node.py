"""patrol_robot: drives to the room whose motion sensor calls, looks around, mails what it finds, comes home.

Matches `patrol_robot` and `patrol_robot_simulation` of the tutorial: topics /motion_trigger,
/darknet_ros/bounding_boxes, /cmd_vel, action move_base, parameters ~path_to_params, ~email_to, ~email_from.

Differs: see rosbot_patrol.patrol.manager, .patrol.rooms, .patrol.spin and .alerts.mail; beyond the original it
publishes /patrol/state and /patrol/alerts, keeps its outbox, queue and incidents in ~state_dir, and stops the robot
and gives up its goal when it is ended. Only one action client, one tf listener and one publisher are made.
"""

from __future__ import annotations

import logging
import signal
import threading
import time
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import rospy
from darknet_ros_msgs.msg import BoundingBoxes, ObjectCount
from geometry_msgs.msg import Twist
from sensor_msgs.msg import LaserScan as LaserScanMsg

from rosbot_patrol.alerts.album import Sighting
from rosbot_patrol.alerts.channels import MailParams
from rosbot_patrol.alerts.evidence import EvidenceParams
from rosbot_patrol.alerts.incident import Event
from rosbot_patrol.alerts.mail import one_line
from rosbot_patrol.alerts.picture import LabelledBox
from rosbot_patrol.alerts.retention import RetentionParams
from rosbot_patrol.errors import TransformError
from rosbot_patrol.geometry import STOP, Pose2D, Twist2D, transform_points
from rosbot_patrol.msg import EspTrigger, PatrolState, SensorEvent
from rosbot_patrol.params import declared, param
from rosbot_patrol.patrol.battery import BatteryParams, check_battery
from rosbot_patrol.patrol.chronicle import Chronicle
from rosbot_patrol.patrol.commands import Commands, Report
from rosbot_patrol.patrol.coverage import CoverageParams
from rosbot_patrol.patrol.drive import DriveParams
from rosbot_patrol.patrol.eyes import Eyes, EyesParams
from rosbot_patrol.patrol.inputs import Box, Frame, Inputs
from rosbot_patrol.patrol.judge import Judge, JudgeParams
from rosbot_patrol.patrol.known_objects import load_known
from rosbot_patrol.patrol.look import LookParams
from rosbot_patrol.patrol.manager import ManagerParams, PatrolManager
from rosbot_patrol.patrol.mission import Phase
from rosbot_patrol.patrol.people import PeopleParams
from rosbot_patrol.patrol.queueing import PriorityParams
from rosbot_patrol.patrol.repeats import Repeats
from rosbot_patrol.patrol.rooms import Rooms, load_rooms
from rosbot_patrol.patrol.spin import SpinParams
from rosbot_patrol.patrol.store import PatrolStore
from rosbot_patrol.patrol.track import TrackParams
from rosbot_patrol.patrol.viewpoints import ViewpointParams
from rosbot_patrol.patrol.watch import WatchParams
from rosbot_patrol.patrol.witness import WitnessParams
from rosbot_patrol.ros import convert
from rosbot_patrol.ros.diagnostics import OK, WARN, Health
from rosbot_patrol.ros.incident_keeper import IncidentKeeper, RecordParams
from rosbot_patrol.ros.inputs import Latest
from rosbot_patrol.ros.node import Loop, load_params, now, ros_home, run_node
from rosbot_patrol.ros.owner_mail import OwnerPost, refuse_passwords
from rosbot_patrol.ros.patrol_alerts import AlertDesk
from rosbot_patrol.ros.patrol_eyes import EyesTopics, PatrolEyes
from rosbot_patrol.ros.patrol_goal import MoveBase
from rosbot_patrol.ros.patrol_images import PictureRing
from rosbot_patrol.ros.people_markers import PeopleMarkers
from rosbot_patrol.ros.transforms import Transforms
from rosbot_patrol.scan import scan_points
from rosbot_patrol.sensors.sensor_file import load_sensors

log = logging.getLogger(__name__)

P = TypeVar("P")
T = TypeVar("T")


@dataclass(frozen=True, kw_only=True)
class NodeParams:
    """The node's own parameters; those of mail, drive, look, turn and watch come beside them."""

    path_to_params: str = param(doc="points file (the tutorial's name)")
    sensors: str = param("", doc="file of the sensors; empty or none: a sensor's id is the number of its room")
    state_dir: str = param("", doc="folder of outbox, incidents and queue; empty: rosbot_patrol in ROS's home")
    image_topic: str = param("/camera/rgb/image_raw", doc="camera for the mail's picture; empty: none")
    alarm_classes: list[str] = param(["person", "fire hydrant"], doc="classes of objects that alarm")
    own_motion_radius: float = param(
        2.0, unit="m", lo=0.0, doc="so near to a room's point the moving robot is what its sensor sees"
    )
    own_motion_memory: float = param(
        2.0, unit="s", lo=0.0, hi=60.0, doc="so long after it was near the robot is still what the sensor saw"
    )
    resume_max_age: float = param(
        43200.0, unit="s", lo=0.0, doc="a call that is older than this after a restart is reported, not followed"
    )
    base_frame: str = param("base_link", doc="the robot")
    odom_frame: str = param("odom", doc="frame in which a turn is measured")
    map_frame: str = param("map", doc="frame of the points file")
    pose_timeout: float = param(0.5, unit="s", lo=0.05, doc="an older odom -> base_link is not known")
    scan_timeout: float = param(1.0, unit="s", lo=0.05, doc="an older scan says nothing of obstacles")
    rate: float = param(25.0, unit="Hz", lo=5.0, hi=100.0, doc="steps of the patrol, at most")
    latched_window: float = param(
        10.0, unit="s", lo=0.0, doc="so long after its start a latched trigger that it had before is not taken again"
    )
    look_around: str = param(
        "full", choices=("full", "spin"), doc="full: from further viewpoints, too; spin: one turn at the room's point"
    )
    clear_share: float = param(
        0.5, lo=0.0, hi=1.0, doc="with less of the floor seen a room is not clear but unverified"
    )
    known_objects: str = param("", doc="file of things that look like somebody (patrol/known_objects); empty: none")
    watch: WatchParams = WatchParams()
    judge: JudgeParams = JudgeParams()
    coverage: CoverageParams = CoverageParams()
    viewpoints: ViewpointParams = ViewpointParams()
    witness: WitnessParams = WitnessParams()
    track: TrackParams = TrackParams()
    people: PeopleParams = PeopleParams()
    eyes: EyesTopics = EyesTopics()


RECORDS = (EvidenceParams, RetentionParams, RecordParams)
FLAT = (NodeParams, MailParams, DriveParams, LookParams, SpinParams, PriorityParams, BatteryParams, *RECORDS)


def load_flat(cls: type[P], tree: dict[str, Any]) -> P:
    """One of the groups that share the node's flat namespace; only NodeParams' warns of unknown names."""
    others = {name for other in FLAT if other is not cls for name, *_ in declared(other)}
    return load_params(cls, tree=tree, ignore=others | (set(tree) if cls is not NodeParams else set()))


class PatrolNode:
    """Inputs, one thread that steps the manager, outputs."""

    def __init__(self) -> None:
        tree = rospy.get_param("~", {}) or {}
        refuse_passwords(tree)
        self.params = load_flat(NodeParams, tree)
        mail = load_flat(MailParams, tree)
        battery = load_flat(BatteryParams, tree)
        check_battery(battery, rospy.get_name() + "/")
        rooms = load_rooms(Path(self.params.path_to_params).expanduser())
        names = {room.id: room.name for room in rooms}
        self.sensors = load_sensors(self.params.sensors, names, rooms_source=rooms.source)
        folder = Path(self.params.state_dir).expanduser() if self.params.state_dir else ros_home() / "rosbot_patrol"
        self.health = Health()
        evidence = load_flat(EvidenceParams, tree)
        self.pictures = PictureRing(self.params.image_topic, evidence)
        self.chronicle = Chronicle()
        self.keeper = IncidentKeeper(
            folder,
            self.pictures,
            self.health,
            evidence=evidence,
            retention=load_flat(RetentionParams, tree),
            records=load_flat(RecordParams, tree),
            on_verdict=lambda incident: self.desk.tell_verdict(incident),
        )
        self.desk = AlertDesk(OwnerPost(mail, folder, self.health), self.pictures, self.keeper)
        self.store = PatrolStore(folder / "patrol.json", str(rospy.get_param("/run_id", "")))
        views = Eyes(
            EyesParams(
                look_around=self.params.look_around,
                clear_share=self.params.clear_share,
                coverage=self.params.coverage,
                viewpoints=self.params.viewpoints,
                witness=self.params.witness,
            )
        )
        self.manager = PatrolManager(
            rooms,
            ManagerParams(
                alarm_classes=tuple(self.params.alarm_classes),
                own_motion_radius=self.params.own_motion_radius,
                own_motion_memory=self.params.own_motion_memory,
                resume_max_age=self.params.resume_max_age,
                priorities=load_flat(PriorityParams, tree),
                battery=battery,
                drive=load_flat(DriveParams, tree),
                look=load_flat(LookParams, tree),
                spin=load_flat(SpinParams, tree),
                watch=self.params.watch,
                people=self.params.people,
                track=self.params.track,
            ),
            memory=self.store.memory,
            needs_camera=self.pictures.is_wanted,
            views=views,
            viewpoints=views.instead,
            judge=Judge(self.params.judge, load_known(self.params.known_objects)),
        )
        log.info("%d rooms in %s", len(rooms), rooms.source)
        self._make_ends(rooms)

    def _make_ends(self, rooms: Rooms) -> None:
        self._triggers: deque[tuple[int, str]] = deque(maxlen=1000)  # room, sender where it latches
        self._heard: deque[Event] = deque(maxlen=1000)
        self._detector: Latest[int] = Latest()
        self._scan: Latest[LaserScanMsg] = Latest()
        self._stepping = threading.Lock()
        self._is_over = False
        self._is_signalled = False
        self._unsaved = False
        self._turning = False
        self._started = time.monotonic()
        self._first_heard: set[str] = set()
        self._refused = Repeats()
        self._report: Report | None = None
        self.transforms = Transforms()
        self.eyes = PatrolEyes(
            self.params.eyes,
            rooms,
            self.params.alarm_classes,
            self.transforms,
            map_frame=self.params.map_frame,
            odom_frame=self.params.odom_frame,
            health=self.health,
        )
        self.markers = PeopleMarkers(self.params.map_frame)
        self._shown = ""
        self._nearest: tuple[LaserScanMsg, float | None] | None = None
        self.move_base = MoveBase(self.params.map_frame)
        self._cmd_vel = rospy.Publisher("/cmd_vel", Twist, queue_size=1)
        self._state = rospy.Publisher("/patrol/state", PatrolState, queue_size=10, latch=True)
        rospy.Subscriber("/motion_trigger", EspTrigger, self._on_trigger, queue_size=100)
        rospy.Subscriber("/sensors/events", SensorEvent, self._on_sensor_event, queue_size=100)
        rospy.Subscriber("/darknet_ros/bounding_boxes", BoundingBoxes, self._on_boxes, queue_size=10)
        rospy.Subscriber("/darknet_ros/found_object", ObjectCount, self._on_count, queue_size=10)
        rospy.Subscriber("/scan", LaserScanMsg, self._on_scan, queue_size=1, buff_size=1 << 18)

    def run(self) -> None:
        """Patrol until shutdown."""
        for number in (signal.SIGINT, signal.SIGTERM):
            self._note_signal(number)
        rospy.on_shutdown(self._stop)
        mission = [self.manager.mission.id] if self.manager.mission is not None else []
        self.keeper.start([*mission, *(request.id for request in self.manager.queue if request.id)])
        self.desk.start()
        Loop(self.params.rate, self._step, name="patrol").start()
        rospy.spin()

    # -- callbacks store

    def _on_trigger(self, message: EspTrigger) -> None:
        if not message.move:
            return  # a heartbeat
        header = getattr(message, "_connection_header", None) or {}
        sender = str(header.get("callerid", ""))
        is_latched = header.get("latching") == "1"
        is_first = sender not in self._first_heard
        self._first_heard.add(sender)
        is_early = time.monotonic() - self._started < self.params.latched_window
        room = self._room_of(message.id)
        if room is None:
            return
        self._hear(f"motion sensor {message.id} sees motion", sensor=message.id, room=room)
        if is_latched and is_first and is_early and self.store.is_handled(sender, room):
            log.info("the latched trigger for room %d from %s was taken before the restart", room, sender)
            return
        self._triggers.append((room, sender if is_latched else ""))

    def _room_of(self, sensor_id: int) -> int | None:
        """The room that a sensor calls to; without a file its id, which the manager knows or refuses."""
        if not self.sensors.has_file:
            return sensor_id
        room = self.sensors.room_of(sensor_id)
        if room is None and self._refused.is_news(sensor_id, now()):
            log.error("motion trigger refused: %s", self.sensors.refusal(sensor_id))
        return room

    def _hear(self, text: str, **data: object) -> None:
        self._heard.append(Event(wall=time.time(), kind="sensor", text=text, data=data))

    def _on_sensor_event(self, message: SensorEvent) -> None:
        if message.text:
            self._hear(message.text, sensor=message.id, room=message.room, what=message.kind)
        if message.kind == SensorEvent.LOOK and message.active and message.room >= 0:
            log.warning("%s: the robot looks at room %d", message.text, message.room)
            self._triggers.append((message.room, ""))

    def _on_boxes(self, message: BoundingBoxes) -> None:
        time_now = now()
        self._detector.set(1, time_now)
        if not message.bounding_boxes:
            return  # the count, which always comes, has said so
        stamp = message.image_header.stamp.to_sec() or message.header.stamp.to_sec() or time_now
        boxes = tuple(
            Box(label=b.Class, probability=b.probability, xmin=b.xmin, ymin=b.ymin, xmax=b.xmax, ymax=b.ymax)
            for b in message.bounding_boxes
        )
        self.eyes.add(Frame(stamp=stamp, boxes=boxes), stamp)
        self._note_sighting(stamp, boxes)

    def _note_sighting(self, stamp: float, boxes: Sequence[Box]) -> None:
        alarms = [box for box in boxes if box.label in self.params.alarm_classes]
        if alarms and self.manager.mission is not None:
            drawn = [
                LabelledBox(
                    text=f"{one_line(b.label)} {b.probability:.2f}", xmin=b.xmin, ymin=b.ymin, xmax=b.xmax, ymax=b.ymax
                )
                for b in alarms
            ]
            self.keeper.note(Sighting(stamp=stamp, probability=max(b.probability for b in alarms), boxes=drawn))

    def _on_count(self, message: ObjectCount) -> None:
        self._detector.set(1, now())
        if message.count == 0:  # other counts come with their boxes
            self.eyes.add(Frame(), message.header.stamp.to_sec())

    def _on_scan(self, message: LaserScanMsg) -> None:
        self._scan.set(message, now())

    # -- step

    def _step(self, time_now: float) -> None:
        with self._stepping:
            if not self._is_over:
                inputs = self._inputs(time_now)
                self._publish(time_now, inputs, self.manager.step(time_now, inputs))

    def _inputs(self, time_now: float) -> Inputs:
        busy = self.manager.mission is not None
        scan = self._fresh_scan(time_now) if busy else None
        view = self.eyes.look(scan)
        return Inputs(
            wall=time.time(),
            triggers=self._take_triggers(),
            frames=tuple(self.eyes.take(is_busy=busy)),
            yaw=self._yaw(time_now),
            pose=self._pose(),
            clearance=self._clearance(scan),
            scan=view,
            house=self.eyes.house,
            link=self.move_base.link(),
            detector_at=self._detector.stamp,
            camera_at=self.pictures.seen_at,
            camera_changed_at=self.pictures.changed_at,
        )

    def _take_triggers(self) -> tuple[int, ...]:
        taken = _drain(self._triggers)
        for room_id, sender in taken:
            if sender:
                self.store.note_latched(sender, room_id)
                self._unsaved = True
        return tuple(room_id for room_id, _ in taken)

    def _yaw(self, time_now: float) -> float | None:
        try:
            pose, stamp = self.transforms.lookup_stamped(self.params.odom_frame, self.params.base_frame)
        except TransformError:
            return None
        return pose.yaw if abs(time_now - stamp) <= self.params.pose_timeout else None

    def _pose(self) -> Pose2D | None:
        try:
            return self.transforms.lookup(self.params.map_frame, self.params.base_frame)
        except TransformError:
            return None

    def _fresh_scan(self, time_now: float) -> LaserScanMsg | None:
        return self._scan.get() if self._scan.fresh(time_now, self.params.scan_timeout) else None

    def _clearance(self, message: LaserScanMsg | None) -> float | None:
        """From the robot's centre to the nearest thing [m]; reckoned once for each scan."""
        if message is None:
            return None
        if self._nearest is None or self._nearest[0] is not message:
            scan = convert.scan_from_msg(message)
            try:
                base_from_laser = self.transforms.lookup(self.params.base_frame, scan.frame_id)
            except TransformError:
                return None
            points = transform_points(base_from_laser, scan_points(scan))
            self._nearest = message, float(np.hypot(*points.T).min()) if len(points) else None
        return self._nearest[1]

    # -- publish

    def _publish(self, time_now: float, inputs: Inputs, commands: Commands) -> None:
        if commands.cancel:
            self.move_base.cancel()
        if commands.goal is not None:
            self.move_base.send(commands.goal)
        self._turn(commands.speed)
        if commands.report is not None:
            self._publish_state(time_now, commands.report)
        for notice in commands.notices:
            self.desk.take(notice, time_now)
        self._record(time_now, commands, inputs.pose)
        self._show_people(time_now, commands)
        if self.manager.mission is not None or self.keeper.needs_pictures:
            self.pictures.start()
        elif self.desk.is_recorded:
            self.pictures.stop()
        self._save(commands.changed)

    def _record(self, time_now: float, commands: Commands, pose: Pose2D | None = None) -> None:
        mission = self.manager.mission
        entries = self.chronicle.step(
            now=time_now, wall=time.time(), mission=mission, commands=commands, pose=pose, heard=_drain(self._heard)
        )
        self.keeper.put(entries)
        self.keeper.look(mission.id if mission is not None and mission.phase is Phase.LOOKING else "")

    def _show_people(self, time_now: float, commands: Commands) -> None:
        mission = self.manager.mission
        if mission is not None and mission.id != self._shown:
            self._shown = mission.id
            self.markers.clear()
        if commands.people:
            self.markers.show(commands.people, time_now, mission.room.title if mission else "")

    def _turn(self, speed: float | None) -> None:
        if speed is None:
            if self._turning:
                self._cmd_vel.publish(convert.twist_to_msg(STOP))
            self._turning = False
            return
        self._turning = True
        self._cmd_vel.publish(convert.twist_to_msg(Twist2D(wz=speed)))

    def _publish_state(self, time_now: float, report: Report) -> None:
        if self._report is None or (report.phase, report.why) != (self._report.phase, self._report.why):
            log.info("%s: %s", report.phase.value, report.why)
        self._report = report
        message = PatrolState(
            state=report.phase.value,
            mission=report.mission,
            room_id=report.room_id,
            room_name=report.room_name,
            origin=report.origin,
            why=report.why,
            queue=bytes(report.queue),
            verdict=report.verdict,
            last_verdict=report.last_verdict,
            share_seen=-1.0,
            mode=report.mode,
        )
        mission = self.manager.mission
        if mission is not None:
            message.share_seen = -1.0 if mission.share_seen is None else mission.share_seen
            message.phases, message.seconds = list(mission.times), list(mission.times.values())
        message.header.stamp = convert.time_to_msg(time_now)
        self._state.publish(message)
        self.health.set("", OK if report.phase is not Phase.STARTING else WARN, f"{report.phase.value}: {report.why}")

    def _save(self, changed: bool) -> None:
        if changed or self._unsaved:
            self._unsaved = False
            memory = self.manager.snapshot()
            self.desk.remember(lambda: self.store.save(memory))

    def _note_signal(self, number: int) -> None:
        rospys = signal.getsignal(number)

        def note(received: int, frame: Any) -> None:
            self._is_signalled = True
            if callable(rospys):
                rospys(received, frame)

        signal.signal(number, note)

    def _stop(self) -> None:
        """Leave the robot at rest: goal given up, wheels still.

        A signal (Ctrl-C, the end of the launch) gives up missions, too; after anything else (`rosnode kill`) the
        respawned node goes on with them.
        """
        with self._stepping:
            self._is_over = True
            if self._is_signalled:
                self._record(now(), self.manager.abandon("the patrol was ended"))
            self.move_base.cancel()
            if self._turning:
                self._cmd_vel.publish(convert.twist_to_msg(STOP))
            self._save(changed=True)
        self.keeper.finish()
        deadline = time.monotonic() + 2.0
        while not (self.desk.is_recorded and self.keeper.is_written) and time.monotonic() < deadline:
            time.sleep(0.02)
        time.sleep(0.1)  # let the two messages leave


def _drain(source: deque[T]) -> list[T]:
    items = []
    while source:
        items.append(source.popleft())
    return items


def main() -> None:
    """Run the node."""
    run_node("patrol_robot", lambda: PatrolNode().run())
