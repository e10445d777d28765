"""What a step is told of what arrived."""

from __future__ import annotations

import math

import numpy as np
import pytest
from senses_world import ROOMS, Health, LaserFrames, robot_tree

from rosbot_patrol.patrol.records.inputs import Battery, Box, Frame, Guarded
from rosbot_patrol.patrol.records.request import Origin, Request
from rosbot_patrol.patrol.senses.health import OK, WARN
from rosbot_patrol.patrol.senses.params import EyesTopics, InputParams
from rosbot_patrol.patrol.senses.records import BoxesRecord, CountRecord, LookRecord, Moment, lens_record
from rosbot_patrol.patrol.senses.senses import PatrolSenses
from rosbot_patrol.patrol.senses.sensor_rooms import SensorRooms
from rosbot_patrol.scan import LaserScan
from rosbot_patrol.sensors.sensor_file import SensorList, SensorSpec
from rosbot_patrol.tf.frames import Frames

BOX = Box(label="person", probability=0.9, xmin=300, ymin=100, xmax=340, ymax=340)


def made(frames: Frames | None = None) -> tuple[PatrolSenses, Health]:
    health = Health()
    transforms = robot_tree() if frames is None else frames
    senses = PatrolSenses(InputParams(), EyesTopics(), transforms, rooms=ROOMS, alarm_classes=["person"], health=health)
    return senses, health


def at(now: float) -> Moment:
    return Moment(now=now, steady=now + 500.0, wall=now + 1.7e9)


def test_calls_and_requests_are_taken_once_in_their_order() -> None:
    senses, _ = made()
    for room in (2, 1, 2):
        senses.hear_call(room)
    senses.ask(Request(room_id=3))
    senses.ask(None)
    inputs = senses.take(at(10.0), Guarded(), "", is_busy=False)
    assert inputs.triggers == (2, 1, 2)
    assert [request.room_id for request in inputs.requests] == [3]
    assert inputs.wall == 10.0 + 1.7e9
    again = senses.take(at(10.1), Guarded(), "", is_busy=False)
    assert (again.triggers, again.requests) == ((), ())


def test_what_is_armed_and_the_stop_are_given_on() -> None:
    senses, _ = made()
    guarded = Guarded(mode="night")
    inputs = senses.take(at(10.0), guarded, "pressed", is_busy=False)
    assert inputs.guarded is guarded
    assert inputs.stop == "pressed"


def test_each_picture_counts_once_though_boxes_and_count_both_come() -> None:
    senses, _ = made()
    senses.hear_detector(BoxesRecord(9.5, (BOX,)), at(9.6))
    senses.hear_detector(CountRecord(9.5, 1), at(9.61))
    senses.hear_detector(BoxesRecord(9.7, ()), at(9.8))
    senses.hear_detector(CountRecord(9.7, 0), at(9.81))
    inputs = senses.take(at(10.0), Guarded(), "", is_busy=False)
    assert inputs.frames == (Frame(stamp=9.5, boxes=(BOX,)), Frame())
    assert inputs.detector_at == 9.81


def test_boxes_without_a_time_are_of_the_moment_they_came() -> None:
    senses, _ = made()
    senses.hear_detector(BoxesRecord(0.0, (BOX,)), at(9.6))
    assert senses.take(at(10.0), Guarded(), "", is_busy=False).frames[0].stamp == 9.6


def test_the_battery_is_of_when_it_was_heard() -> None:
    senses, _ = made()
    assert senses.take(at(10.0), Guarded(), "", is_busy=False).battery is None
    senses.hear_battery(Battery(share=0.5, voltage=12.4), 7.0)
    assert senses.take(at(10.0), Guarded(), "", is_busy=False).battery == Battery(share=0.5, voltage=12.4, at=7.0)


def test_a_pose_that_is_lost_is_told_and_so_is_one_that_is_found() -> None:
    senses, health = made()
    inputs = senses.take(at(10.2), Guarded(), "", is_busy=False)
    assert inputs.pose == pytest.approx((1.0, 0.0, 0.0))
    assert inputs.yaw == 0.0
    assert health.parts["pose"] == (OK, "the robot's pose is known")
    for _ in range(3):
        assert senses.take(at(12.0), Guarded(), "", is_busy=False).pose is None
    level, text = health.parts["pose"]
    assert level == WARN
    assert "the newest is 2.0 s old" in text
    assert [part for part, *_ in health.told] == ["pose", "pose"]


def test_scans_are_looked_at_while_a_mission_runs() -> None:
    senses, health = made(LaserFrames())
    scan = LaserScan(
        stamp=10.0,
        frame_id="laser",
        angle_min=0.0,
        angle_increment=0.1,
        range_min=0.1,
        range_max=9.0,
        ranges=np.ones(3),
    )
    senses.lidar.hear(scan, 10.0)
    resting = senses.take(at(10.0), Guarded(), "", is_busy=False)
    assert (resting.scan, resting.clearance) == (None, None)
    busy = senses.take(at(10.1), Guarded(), "", is_busy=True)
    assert busy.scan is not None
    assert busy.clearance is not None
    assert health.parts["lidar"][0] == OK
    stale = senses.take(at(11.2), Guarded(), "", is_busy=True)
    assert (stale.scan, stale.clearance) == (None, None)


# -- records


def test_a_sensors_event_asks_for_a_look_or_for_nothing() -> None:
    assert LookRecord(-1, "it is well again").request(7.0) is None
    request = LookRecord(3, "it has gone").request(7.0)
    assert request is not None
    assert (request.room_id, request.origin, request.note, request.wall) == (
        3,
        Origin.SILENT_SENSOR,
        "it has gone",
        7.0,
    )


@pytest.mark.parametrize(("width", "focal"), [(0, 500.0), (640, 0.0), (640, -1.0)])
def test_a_camera_info_that_describes_no_lens_is_refused(width: int, focal: float) -> None:
    k = [focal, 0.0, 320.0, 0.0, focal, 240.0, 0.0, 0.0, 1.0]
    with pytest.raises(ValueError, match=f"width {width} and focal length {focal:g} tells no lens"):
        lens_record("/camera", k, width=width, height=480)


def test_a_camera_info_tells_frame_and_lens() -> None:
    found = lens_record("/camera", [500.0, 0.0, 320.0, 0.0, 510.0, 240.0, 0.0, 0.0, 1.0], width=640, height=480)
    assert found.frame == "camera"
    assert (found.lens.fx, found.lens.fy, found.lens.cx, found.lens.cy) == (500.0, 510.0, 320.0, 240.0)
    assert found.lens.view_width == pytest.approx(2.0 * math.atan(0.64))


# -- rooms of sensors


def test_without_a_file_a_sensor_calls_to_the_room_of_its_number() -> None:
    assert SensorRooms(SensorList(None, {})).room_of(7, 0.0) == 7


def test_a_sensor_that_the_file_lacks_is_refused_and_told_now_and_then(caplog: pytest.LogCaptureFixture) -> None:
    rooms = SensorRooms(SensorList([SensorSpec(id=4, room=2)], {2: "hall"}, "sensors.yaml"))
    assert rooms.room_of(4, 0.0) == 2
    for now in (0.0, 5.0, 11.0):
        assert rooms.room_of(9, now) is None
    assert [record.getMessage() for record in caplog.records] == [
        "motion trigger refused: sensors.yaml has no sensor with id 9"
    ] * 2
