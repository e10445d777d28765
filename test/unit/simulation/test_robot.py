"""URDF robots: the shipped one, and the sentence for what cannot be driven."""

from __future__ import annotations

from pathlib import Path

import pytest

from rosbot_patrol.errors import WorldError
from rosbot_patrol.simulation.matrices import to_pose2d
from rosbot_patrol.simulation.robot import load_robot, parse_robot

URDF = Path(__file__).parents[3] / "urdf" / "rosbot.urdf"


def two_wheels(extra: str = "", *, right: str = "-0.1") -> str:
    joints = "".join(
        f"<joint name='{side}_joint' type='continuous'><origin xyz='0 {y} 0'/><parent link='base'/>"
        f"<child link='{side}'/></joint><link name='{side}'><collision><geometry>"
        f"<cylinder radius='0.05' length='0.02'/></geometry></collision></link>"
        for side, y in (("left", "0.1"), ("right", right))
    )
    return f"<robot name='r'><link name='base'/>{joints}{extra}</robot>"


def test_the_rosbot_has_its_figures() -> None:
    robot = load_robot(URDF)
    assert robot.mass == pytest.approx(7.01)
    assert robot.track == pytest.approx(0.192)
    assert robot.base_height == pytest.approx(0.04)
    assert [(w.x, w.y) for w in robot.wheels] == [(0.05, 0.11), (0.05, -0.11), (-0.055, 0.11), (-0.055, -0.11)]
    laser = robot.frame("laser")
    assert to_pose2d(laser) == pytest.approx((0.02, 0.0, 3.14159265))
    assert laser[2, 3] == pytest.approx(0.058)
    optical = robot.frame("camera_rgb_frame")
    assert optical[:3, 2] == pytest.approx((1.0, 0.0, 0.0), abs=1e-6)  # z looks ahead
    assert optical[:3, 1] == pytest.approx((0.0, 0.0, -1.0), abs=1e-6)  # y looks down


def test_a_two_wheeled_robot_is_read() -> None:
    robot = parse_robot(two_wheels())
    assert robot.base == "base"
    assert [w.radius for w in robot.wheels] == [0.05, 0.05]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("<robot", "is not XML"),
        ("<sdf/>", "is no URDF"),
        ("<robot name='r'/>", "has no links"),
        (two_wheels("<link name='loose'/>"), "no single tree"),
        (two_wheels("<joint name='j' type='fixed'><parent link='base'/><child link='gone'/></joint>"), "'gone'"),
        (two_wheels().replace("0 0.1 0", "0 up 0"), "expected 3 numbers"),
    ],
)
def test_what_cannot_be_driven_is_told(text: str, words: str) -> None:
    with pytest.raises(WorldError, match="robot_description") as caught:
        parse_robot(text)
    assert words in str(caught.value)


def test_a_sensor_without_its_link_is_told() -> None:
    with pytest.raises(WorldError, match="has no link 'laser'"):
        parse_robot(two_wheels()).frame("laser")
