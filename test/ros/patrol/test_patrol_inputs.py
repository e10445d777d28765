"""What the patrol's callbacks keep reaches its senses in the next step; depth is listened to while they want it."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("rospy", reason="ROS is not on the path: `. scripts/env` first")

import rospy
from darknet_ros_msgs.msg import BoundingBox, BoundingBoxes, ObjectCount
from rosbot_patrol.msg import EspTrigger, SensorEvent
from sensor_msgs.msg import BatteryState, CameraInfo, Image

from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.patrol.house.rooms import Room, Rooms
from rosbot_patrol.patrol.records.inputs import Guarded
from rosbot_patrol.patrol.records.request import Origin
from rosbot_patrol.patrol.senses.health import NoHealth
from rosbot_patrol.patrol.senses.params import EyesTopics, InputParams
from rosbot_patrol.patrol.senses.senses import PatrolSenses
from rosbot_patrol.patrol.senses.sensor_rooms import SensorRooms
from rosbot_patrol.ros.messages.convert import scan_from_msg, scan_to_msg
from rosbot_patrol.ros.patrol import inputs as patrol_inputs
from rosbot_patrol.ros.patrol import sight_topics
from rosbot_patrol.ros.patrol.calls import CallDesk
from rosbot_patrol.ros.patrol.inputs import PatrolInputs
from rosbot_patrol.scan import LaserScan
from rosbot_patrol.sensors.sensor_file import SensorList
from rosbot_patrol.tf.tree import Edge, TransformTree

ROOMS = Rooms(tuple(Room(id=i, name=f"name {i}", pose=Pose2D(float(i))) for i in range(3)))
NOW = 10.0


class Topics:
    """The subscribers that are there, by topic."""

    def __init__(self) -> None:
        self.open: dict[str, object] = {}
        self.publishers = 1

    def subscribe(self, topic, _kind, callback, **_options):
        self.open[topic] = callback
        return SimpleNamespace(unregister=lambda: self.open.pop(topic), get_num_connections=lambda: self.publishers)


class Desk(CallDesk):
    """Calls without a disk."""

    def __init__(self) -> None:
        store = SimpleNamespace(taken=0, is_handled=lambda *_: False, note_latched=lambda *_: None)
        journal = SimpleNamespace(left=[], add=lambda *_: 1, drop=lambda _taken: None)
        super().__init__(ROOMS, store, journal, latched_window=10.0, wake=lambda: None)


@pytest.fixture
def topics(monkeypatch: pytest.MonkeyPatch) -> Topics:
    found = Topics()
    monkeypatch.setattr(rospy, "Subscriber", found.subscribe)
    monkeypatch.setattr(patrol_inputs, "now", lambda: NOW)
    monkeypatch.setattr(sight_topics, "now", lambda: NOW)
    monkeypatch.setattr(sight_topics.Worker, "start", lambda self: None)
    return found


@pytest.fixture
def inputs(topics: Topics) -> PatrolInputs:
    tree = TransformTree()
    tree.add(Edge("base_link", "camera", 0.0, 0.0, 0.0, 0.5, -0.5, 0.5, -0.5, 0.5), is_static=True)
    tree.add(Edge("map", "odom", 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0), is_static=True)
    for stamp in (9.0, 11.0):
        tree.add(Edge("odom", "base_link", stamp, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0))
    eyes = EyesTopics(depth_topic="/depth", depth_info_topic="/depth_info", camera_info_topic="/info")
    senses = PatrolSenses(InputParams(), eyes, tree, rooms=ROOMS, alarm_classes=["person"], health=NoHealth())
    sensor_rooms = SensorRooms(SensorList(None, {}))
    made = PatrolInputs(InputParams(), eyes, senses=senses, calls=Desk(), sensor_rooms=sensor_rooms, wake=lambda: None)
    made.start()
    return made


def take(inputs: PatrolInputs, *, is_busy: bool = False):
    return inputs.take(NOW, Guarded(), "", is_busy=is_busy)


def stamped(message, stamp: float = 9.5, frame: str = ""):
    message.header.stamp, message.header.frame_id = rospy.Time.from_sec(stamp), frame
    return message


def test_calls_requests_battery_and_pictures_reach_the_next_step(inputs, topics) -> None:
    told = []
    inputs.on_boxes = lambda stamp, boxes: told.append((stamp, boxes))
    topics.open["motion_trigger"](EspTrigger(id=2, move=True))
    topics.open["motion_trigger"](EspTrigger(id=1, move=False))  # a heartbeat
    topics.open["sensors/events"](SensorEvent(kind=SensorEvent.LOOK, active=True, room=1, text="it has gone"))
    topics.open["sensors/events"](SensorEvent(kind=SensorEvent.LOOK, active=False, room=1, text="it is back"))
    topics.open["battery"](BatteryState(voltage=12.4))
    box = BoundingBox(Class="person", probability=0.9, xmin=1, ymin=2, xmax=30, ymax=40)
    seen = BoundingBoxes(bounding_boxes=[box])
    seen.image_header.stamp = rospy.Time.from_sec(9.5)
    topics.open["darknet_ros/bounding_boxes"](seen)
    topics.open["darknet_ros/found_object"](stamped(ObjectCount(count=1)))
    topics.open["darknet_ros/found_object"](stamped(ObjectCount(count=0), 9.7))
    found = take(inputs)
    assert found.triggers == (2,)
    assert [(r.room_id, r.origin, r.note) for r in found.requests] == [(1, Origin.SILENT_SENSOR, "it has gone")]
    assert (found.battery.voltage, found.battery.at) == (12.4, NOW)
    assert [(frame.stamp, len(frame.boxes)) for frame in found.frames] == [(9.5, 1), (None, 0)]
    assert found.frames[0].boxes[0].ymax == 40
    assert found.detector_at == NOW
    assert told == [(9.5, found.frames[0].boxes)]
    assert [event.text for event in inputs.take_heard()] == [
        "motion sensor 2 sees motion",
        "it has gone",
        "it is back",
    ]
    again = take(inputs)
    assert (again.triggers, again.requests, again.frames) == ((), (), ())
    assert again.battery == found.battery


def scan_message(**changes):
    values = {"stamp": 9.9, "frame_id": "base_link", "angle_min": -1.0, "angle_increment": 0.02}
    limits = {"range_min": 0.2, "range_max": 12.0, "ranges": np.ones(101)}
    return scan_to_msg(LaserScan(**{**values, **limits, **changes}))


def test_a_scan_is_converted_once_and_only_while_a_mission_runs(inputs, topics, monkeypatch) -> None:
    converted = []
    monkeypatch.setattr(patrol_inputs, "scan_from_msg", lambda m: converted.append(m) or scan_from_msg(m))
    topics.open["scan"](scan_message())
    assert take(inputs).scan is None
    assert not converted
    first = take(inputs, is_busy=True)
    assert first.clearance == pytest.approx(1.0)
    assert take(inputs, is_busy=True).scan is first.scan
    assert len(converted) == 1


def test_a_message_without_a_stamp_has_none_as_a_record() -> None:
    assert math.isnan(scan_from_msg(scan_message(stamp=0.0)).stamp)
    assert scan_from_msg(scan_message(ranges=np.array([math.nan, 1.0]))).ranges == pytest.approx(
        [math.nan, 1.0], nan_ok=True
    )


def camera_info() -> CameraInfo:
    return stamped(CameraInfo(width=640, height=480, K=[500, 0, 320, 0, 500, 240, 0, 0, 1]), frame="/camera")


def test_a_lens_is_heard_once_and_one_that_is_none_is_told(inputs, topics, caplog) -> None:
    topics.open["/info"](CameraInfo(width=640))
    assert "a camera_info of width 640 and focal length 0 tells no lens" in caplog.text
    assert "/info" in topics.open
    topics.open["/info"](camera_info())
    assert "/info" not in topics.open


def test_depth_is_listened_to_from_the_first_box_to_the_missions_end(inputs, topics) -> None:
    topics.open["/info"](camera_info())
    box = BoundingBox(Class="person", probability=0.9, xmin=300, ymin=100, xmax=340, ymax=340)
    seen = BoundingBoxes(bounding_boxes=[box])
    seen.image_header.stamp = rospy.Time.from_sec(9.5)
    assert "/depth" not in topics.open
    topics.open["darknet_ros/bounding_boxes"](seen)
    assert take(inputs, is_busy=True).frames == ()  # it waits for its depth
    picture = Image(height=48, width=64, encoding="16UC1", step=128, data=np.full(48 * 64, 2000, np.uint16).tobytes())
    topics.open["/depth"](stamped(picture))
    (frame,) = take(inputs, is_busy=True).frames
    assert frame.boxes[0].measured.source == "depth"
    assert frame.boxes[0].measured.x == pytest.approx(3.1, abs=0.1)
    assert "/depth" in topics.open
    take(inputs, is_busy=False)
    assert "/depth" not in topics.open
