"""Where the camera was, and what depth, lidar and floor tell of the boxes in its pictures."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from senses_world import OPTICAL, ROOMS, Health, robot_tree

from rosbot_patrol.grid import Grid, GridInfo
from rosbot_patrol.patrol.intruder.measure import Lens
from rosbot_patrol.patrol.records.inputs import Box, Frame
from rosbot_patrol.patrol.senses.camera import HELD, Camera
from rosbot_patrol.patrol.senses.params import EyesTopics, InputParams
from rosbot_patrol.patrol.senses.records import ImageRecord, LensRecord
from rosbot_patrol.patrol.senses.senses import PatrolSenses
from rosbot_patrol.scan import LaserScan
from rosbot_patrol.tf.tree import Edge, TransformTree

LENS = LensRecord("camera", Lens(fx=500.0, fy=500.0, cx=320.0, cy=240.0, width=640, height=480))
NOW = 9.6


def senses(*, known_until: float = 10.0, depth_topic: str = "") -> PatrolSenses:
    """A camera half a metre over the floor at (1, 0), looking along x."""
    eyes = EyesTopics(floor_height=0.0, depth_topic=depth_topic)
    tree = robot_tree(known_until=known_until)
    made = PatrolSenses(InputParams(), eyes, tree, rooms=ROOMS, alarm_classes=["person"], health=Health())
    made.camera.hear_lens(LENS)
    return made


def person(label: str = "person", **changes: int) -> Frame:
    corners = {"xmin": 300, "ymin": 100, "xmax": 340, "ymax": 340, **changes}
    return Frame(stamp=9.5, boxes=(Box(label=label, probability=0.9, **corners),))


def seen(camera: Camera, frame: Frame, at: float = NOW) -> Frame:
    camera.hear(frame, 9.5, NOW)
    (found,) = camera.take(at, is_busy=True)
    return found


def depth_picture(metres: float, stamp: float = 9.5) -> ImageRecord:
    """Something as far everywhere, in mm."""
    rows = np.full((48, 64), round(metres * 1000.0), np.uint16)
    return ImageRecord(stamp, 48, 64, "16UC1", False, 128, rows.tobytes())


def test_a_person_stands_where_the_box_meets_the_floor() -> None:
    frame = seen(senses().camera, person())
    measured = frame.boxes[0].measured
    assert measured is not None
    assert measured.source == "floor"
    assert (measured.x, measured.y) == (pytest.approx(3.5, abs=0.2), pytest.approx(0.0, abs=0.05))
    assert frame.eye is not None
    assert frame.eye.pose == pytest.approx((1.0, 0.0, 0.0))
    assert frame.counts


def test_others_are_not_measured_and_nobody_is_without_a_mission() -> None:
    camera = senses().camera
    assert seen(camera, person("cat")).boxes[0].measured is None
    camera.hear(person(), 9.5, NOW)
    assert camera.take(NOW, is_busy=False) == (person(),)


def test_a_picture_waits_for_the_robots_place_but_not_for_long() -> None:
    camera = senses(known_until=9.2).camera
    camera.hear(person(), 9.5, NOW)
    assert camera.take(NOW + 0.1, is_busy=True) == ()
    (frame,) = camera.take(NOW + HELD, is_busy=True)
    assert frame.eye is None


def test_a_picture_without_a_time_or_a_lens_is_given_on_at_once() -> None:
    camera = senses().camera
    camera.hear(Frame(), 0.0, NOW)
    assert camera.take(NOW, is_busy=True) == (Frame(),)


def test_without_a_lens_a_picture_is_given_on_as_it_came() -> None:
    made = PatrolSenses(
        InputParams(), EyesTopics(), robot_tree(), rooms=ROOMS, alarm_classes=["person"], health=Health()
    )
    assert seen(made.camera, person()) == person()


def test_the_first_lens_counts() -> None:
    camera = senses().camera
    camera.hear_lens(LensRecord("elsewhere", LENS.lens))
    assert seen(camera, person()).eye is not None


# -- depth


def test_a_picture_waits_for_its_depth_which_tells_how_far_somebody_is() -> None:
    made = senses(depth_topic="/depth")
    made.camera.hear(person(), 9.5, NOW)
    assert made.camera.take(NOW, is_busy=True) == ()
    assert made.depth.is_on
    made.depth.hear(depth_picture(2.0))
    (frame,) = made.camera.take(NOW + 0.04, is_busy=True)
    measured = frame.boxes[0].measured
    assert measured is not None
    assert measured.source == "depth"
    assert measured.x == pytest.approx(3.1, abs=0.1)
    assert frame.counts


def test_a_picture_without_its_depth_proves_nothing_while_depth_comes() -> None:
    made = senses(depth_topic="/depth")
    made.camera.hear(person(), 9.5, NOW)
    made.camera.take(NOW, is_busy=True)
    (frame,) = made.camera.take(NOW + HELD, is_busy=True)  # before the first depth picture
    assert not frame.counts
    made.depth.hear(depth_picture(2.0, stamp=9.3))
    made.depth.hear(depth_picture(2.0, stamp=9.9))
    assert not seen(made.camera, person()).counts  # depth went past it


def test_somebody_too_far_off_for_depth_is_where_the_lidar_sees_nothing_new() -> None:
    made = senses(depth_topic="/depth")
    box = person(ymax=480)  # no feet in the picture
    assert doubt(made, box) is None  # neither scan nor map
    made.lidar.hear(wall_ahead(6.0), NOW)
    made.lidar.place(made.lidar.usable(NOW), NOW)
    made.house_map.hear(hall())
    x, y = doubt(made, box) or (math.nan, math.nan)
    assert (x, y) == (pytest.approx(1.0 + 6.0 - 0.2, abs=0.05), pytest.approx(0.0, abs=0.1))


def test_somebody_within_reach_of_depth_is_no_doubt() -> None:
    made = senses(depth_topic="/depth")
    made.lidar.hear(wall_ahead(3.0), NOW)
    made.lidar.place(made.lidar.usable(NOW), NOW)
    made.house_map.hear(hall())
    assert doubt(made, person(ymax=480)) is None


def test_without_a_depth_camera_nothing_is_doubted() -> None:
    made = senses()
    made.lidar.hear(wall_ahead(6.0), NOW)
    made.lidar.place(made.lidar.usable(NOW), NOW)
    made.house_map.hear(hall())
    assert doubt(made, person(ymax=480)) is None


def doubt(made: PatrolSenses, frame: Frame) -> tuple[float, float] | None:
    made.camera.hear(frame, 9.5, NOW)
    (found,) = made.camera.take(NOW, is_busy=True) or made.camera.take(NOW + HELD, is_busy=True)
    assert found.boxes[0].measured is None
    return found.boxes[0].doubt


def wall_ahead(metres: float) -> LaserScan:
    values: dict[str, Any] = {"stamp": 9.5, "frame_id": "base_link", "range_min": 0.1, "range_max": 12.0}
    return LaserScan(**values, angle_min=-0.5, angle_increment=0.01, ranges=np.full(101, metres))


def hall() -> Grid:
    """20 x 20 m of floor with a wall 6 m ahead of the camera."""
    cells = np.zeros((200, 200), np.int8)
    cells[:, 169:172] = 100
    return Grid(GridInfo(resolution=0.1, width=200, height=200, origin_x=-10.0, origin_y=-10.0), cells)


def test_a_transform_as_a_matrix() -> None:
    tree = TransformTree()
    tree.add(Edge("a", "b", 0.0, 1.0, 2.0, 3.0, *OPTICAL), is_static=True)
    matrix = tree.transform("a", "b").matrix
    assert (matrix @ [0.0, 0.0, 1.0, 1.0]).tolist() == pytest.approx([2.0, 2.0, 3.0, 1.0])
