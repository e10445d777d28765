"""A camera that hangs proves nothing once the robot has moved."""

from __future__ import annotations

from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.patrol.intruder.frozen_camera import FrozenCamera
from rosbot_patrol.patrol.records.inputs import Eye, Frame


def frame(x: float = 0.0, yaw: float = 0.0, *, same: bool = False, lens: bool = True) -> Frame:
    eye = Eye(pose=Pose2D(x, 0.0, yaw), width=1.0) if lens else None
    return Frame(stamp=1.0, eye=eye, is_same=same)


def test_new_pictures_count_wherever_the_robot_is():
    frames = (frame(0.0), frame(1.0), frame(1.0, 2.0))
    assert FrozenCamera().left(frames) == frames


def test_the_same_picture_counts_as_long_as_the_robot_stands():
    frames = (frame(), frame(0.01, 0.01, same=True), frame(same=True))
    assert FrozenCamera().left(frames) == frames


def test_the_same_picture_counts_no_more_once_the_robot_has_driven_or_turned(caplog):
    pictures = FrozenCamera()
    assert len(pictures.left([frame(), frame(0.03, same=True)])) == 1 + 1
    assert pictures.left([frame(0.1, same=True), frame(0.0, 0.1, same=True)]) == ()
    assert pictures.left([frame(0.5, same=True)]) == ()
    assert caplog.text.count("the camera shows the same picture though the robot moves") == 1
    new = frame(0.6)
    assert pictures.left([new, frame(0.6, same=True)]) == (new, frame(0.6, same=True))


def test_where_the_camera_is_not_known_pictures_count():
    frames = (frame(lens=False), frame(1.0, same=True), frame(2.0, lens=False, same=True))
    assert FrozenCamera().left(frames) == frames
