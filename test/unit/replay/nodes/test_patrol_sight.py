"""Where a replay takes the detector's boxes to be, without depth."""

from __future__ import annotations

import numpy as np
import pytest

from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.patrol.house.rooms import Room, Rooms
from rosbot_patrol.patrol.intruder.measure import Lens
from rosbot_patrol.patrol.mission.params import EyesTopics, InputParams
from rosbot_patrol.patrol.records.inputs import Box, Frame
from rosbot_patrol.replay.nodes.patrol_records import LensRecord
from rosbot_patrol.replay.nodes.patrol_sight import HELD, PatrolSight
from rosbot_patrol.scan import LaserScan
from rosbot_patrol.tf.tree import Edge, TransformTree

LENS = LensRecord("camera", Lens(fx=500.0, fy=500.0, cx=320.0, cy=240.0, width=640, height=480))
ROOMS = Rooms((Room(id=0, name="home", pose=Pose2D()), Room(id=1, name="hall", pose=Pose2D(3.0))), source="rooms")
OPTICAL = (-0.5, 0.5, -0.5, 0.5)  # z ahead, x right, y down


def sight(*, known_until: float = 10.0) -> PatrolSight:
    """A camera half a metre over the floor at (1, 0), looking along x."""
    tree = TransformTree()
    tree.add(Edge("base_link", "camera", 0.0, 0.0, 0.0, 0.5, *OPTICAL), is_static=True)
    tree.add(Edge("map", "odom", 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0), is_static=True)
    for stamp in (9.0, known_until):
        tree.add(Edge("odom", "base_link", stamp, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0))
    found = PatrolSight(EyesTopics(floor_height=0.0), InputParams(), ROOMS, ["person"], tree)
    found.hear_lens(LENS)
    return found


def person(label: str = "person") -> Frame:
    return Frame(stamp=9.5, boxes=(Box(label=label, probability=0.9, xmin=300, ymin=100, xmax=340, ymax=340),))


def test_a_person_stands_where_the_box_meets_the_floor() -> None:
    eyes = sight()
    eyes.hear_frame(person(), 9.5, 9.6)
    (frame,) = eyes.take(9.6, is_busy=True)
    measured = frame.boxes[0].measured
    assert measured is not None
    assert measured.source == "floor"
    assert (measured.x, measured.y) == (pytest.approx(3.5, abs=0.2), pytest.approx(0.0, abs=0.05))
    assert frame.eye is not None
    assert frame.eye.pose == pytest.approx((1.0, 0.0, 0.0))


def test_others_are_not_measured_and_nobody_is_without_a_mission() -> None:
    eyes = sight()
    eyes.hear_frame(person("cat"), 9.5, 9.6)
    assert eyes.take(9.6, is_busy=True)[0].boxes[0].measured is None
    eyes.hear_frame(person(), 9.5, 9.6)
    assert eyes.take(9.6, is_busy=False) == (person(),)


def test_a_picture_waits_for_the_robots_place_but_not_for_long() -> None:
    eyes = sight(known_until=9.2)
    eyes.hear_frame(person(), 9.5, 9.6)
    assert eyes.take(9.7, is_busy=True) == ()
    (frame,) = eyes.take(9.6 + HELD, is_busy=True)
    assert frame.eye is None


def test_a_scan_has_its_place_in_map() -> None:
    eyes = sight()
    scan = LaserScan(
        stamp=9.5,
        frame_id="base_link",
        angle_min=0.0,
        angle_increment=0.1,
        range_min=0.1,
        range_max=9.0,
        ranges=np.ones(3),
    )
    view = eyes.look(scan)
    assert view is not None
    assert view.map_from_laser == Pose2D(1.0, 0.0, 0.0)
    assert eyes.look(scan) is view
    assert eyes.look(None) is None


def test_a_transform_as_a_matrix() -> None:
    tree = TransformTree()
    tree.add(Edge("a", "b", 0.0, 1.0, 2.0, 3.0, *OPTICAL), is_static=True)
    matrix = tree.transform("a", "b").matrix
    assert (matrix @ [0.0, 0.0, 1.0, 1.0]).tolist() == pytest.approx([2.0, 2.0, 3.0, 1.0])
