"""Worlds of many things: what is left out for speed changes nothing."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from rosbot_patrol.geometry import Pose2D, Twist2D
from rosbot_patrol.simulation.engine import Engine
from rosbot_patrol.simulation.physics.bullet_shapes import bounds_of, touchable
from rosbot_patrol.simulation.physics.near_bodies import NearBodies
from rosbot_patrol.simulation.robot.description import load_robot
from rosbot_patrol.simulation.scene.matrices import from_xyz_rpy
from rosbot_patrol.simulation.scene.scene import Body, Collision, Shape
from rosbot_patrol.simulation.scene.slices import Slice, slice_bodies
from rosbot_patrol.simulation.sdf.world import World

ROBOT = Path(__file__).parents[4] / "urdf" / "rosbot.urdf"


def box(name: str, at: tuple[float, float, float], size: tuple[float, float, float], yaw: float = 0.0) -> Body:
    shape = Shape(kind="box", size=size)
    return Body(name=name, pose=from_xyz_rpy(at, (0, 0, yaw)), collisions=(Collision(shape=shape),))


def many(count: int = 2000) -> list[Body]:
    rng = np.random.default_rng(3)
    bodies = []
    for i in range(count):
        angle, away = rng.uniform(0, math.tau), rng.uniform(2.0, 30.0)
        at = (away * math.cos(angle), away * math.sin(angle), 0.5)
        bodies.append(box(f"box_{i}", at, (*rng.uniform(0.1, 0.6, 2), 1.0), rng.uniform(0, 3)))
    return bodies


@pytest.fixture
def engine() -> Iterator[Engine]:
    made = Engine(World(bodies=(*many(), box("goal", (1.0, 0.0, 0.5), (0.2, 1.0, 1.0)))))
    made.spawn_robot(load_robot(ROBOT))
    yield made
    made.close()


def test_beams_that_pass_over_groups_are_as_long_as_those_that_meet_every_segment() -> None:
    cut = slice_bodies(many(), 0.16)
    plain = Slice(cut.segments, cut.circles)
    assert len(cut.segments) == 8000
    assert len(cut.groups) > 400
    rng = np.random.default_rng(1)
    for x, y, first in rng.uniform(-30, 30, (60, 3)):
        fan = (x, y, first, math.tau / 719, 720)
        assert np.array_equal(cut.cast(*fan, longest=math.inf), plain.cast(*fan, longest=math.inf))
        end = tuple(rng.uniform(-30, 30, 2))
        assert cut.is_blocked((x, y), end) == plain.is_blocked((x, y), end)


def test_a_cut_with_something_added_keeps_its_groups() -> None:
    cut = slice_bodies(many(), 0.16)
    wall = Slice(np.array([[0.5, -5.0, 0.5, 5.0]]), np.zeros((0, 3)))
    beams = cut.plus(wall).cast(0.0, 0.0, 0.0, 0.1, 1, longest=50.0)
    assert beams[0] == pytest.approx(0.5)


def test_a_wall_seen_from_its_end_is_as_far_as_its_end() -> None:
    wall = Slice(np.array([[3.0, 1.5, 3.0, 2.5], [5.0, 0.0, 4.0, 0.0]]), np.zeros((0, 3)))
    assert wall.cast(3.0, 0.5, math.pi / 2, 0.1, 1, longest=50.0)[0] == pytest.approx(1.0)
    assert wall.cast(3.0, 0.0, 0.0, 0.1, 1, longest=50.0)[0] == pytest.approx(1.0)
    assert wall.cast(3.0, 0.0, math.pi, 0.1, 1, longest=50.0)[0] == 50.0


def test_turned_and_upside_down_boxes_are_cut_alike() -> None:
    upright = slice_bodies([box("a", (1.0, 2.0, 0.5), (0.4, 0.8, 1.0), 0.3)], 0.2)
    over = Body(
        name="a",
        pose=from_xyz_rpy((1.0, 2.0, 0.5), (math.pi, 0, 0.3)),
        collisions=(Collision(shape=Shape(kind="box", size=(0.4, 0.8, 1.0))),),
    )
    for cut in (upright, slice_bodies([over], 0.2)):
        assert len(cut.segments) == 4
        assert cut.cast(-5.0, 2.0, 0.0, 0.1, 1, longest=50.0)[0] == pytest.approx(6.0 - 0.2 / math.cos(0.3), abs=1e-6)
    assert not len(slice_bodies([over], 1.2).segments)


def test_a_contact_names_the_one_of_many_that_is_touched(engine: Engine) -> None:
    for _ in range(600):
        engine.command(Twist2D(0.4, 0.0, 0.0))
        engine.step()
    assert {touch.other for touch in engine.touches()} == {"goal"}
    assert engine.pose.x < 0.9


def test_what_is_far_from_the_start_stops_it_too(engine: Engine) -> None:
    far = box("far", (0.0, 40.0, 0.5), (1.0, 0.2, 1.0))
    engine.close()
    other = Engine(World(bodies=(far,)))
    other.spawn_robot(load_robot(ROBOT))
    other.carry(Pose2D(0.0, 37.0, math.pi / 2))
    for _ in range(2000):
        other.command(Twist2D(0.5, 0.0, 0.0))
        other.step()
    touched = {touch.other for touch in other.touches()}
    place = other.pose
    other.close()
    assert touched == {"far"}
    assert place.y < 40.0


def test_near_bodies_come_and_go() -> None:
    near = NearBodies()
    near.set_reach(1.0)
    for i in range(10):
        near.add(f"b{i}", np.array([[i * 2.0, 0.0, 0.0], [i * 2.0 + 0.5, 0.5, 1.0]]))
    assert near.update(0.0, 0.0) == (["b0", "b1"], [])
    assert near.update(0.3, 0.0) == ([], [])
    assert near.update(4.0, 0.0) == (["b2", "b3"], ["b0"])
    near.remove("b2")
    assert near.update(4.0, 0.0) == ([], [])
    assert near.update(90.0, 0.0) == ([], ["b1", "b3"])


def test_floors_and_what_hangs_high_cannot_be_touched() -> None:
    carpet = box("carpet", (0.0, 0.0, 0.0), (3.0, 3.0, 0.015))
    lamp = box("lamp", (0.0, 0.0, 2.4), (0.3, 0.3, 0.2))
    table = box("table", (0.0, 0.0, 0.35), (1.0, 1.0, 0.7), math.pi / 4)
    assert touchable(carpet)[0] == []
    assert touchable(lamp)[0] == []
    parts, bounds = touchable(table)
    assert len(parts) == 1
    assert bounds[1] == pytest.approx([math.sqrt(0.5), math.sqrt(0.5), 0.7])


@pytest.mark.parametrize(
    ("shape", "half"),
    [
        (Shape(kind="cylinder", size=(0.2, 1.0)), (0.2, 0.2, 0.5)),
        (Shape(kind="sphere", size=(0.3,)), (0.3, 0.3, 0.3)),
        (Shape(kind="capsule", size=(0.2, 1.0)), (0.2, 0.2, 0.7)),
        (
            Shape(kind="mesh", vertices=np.array([[-1.0, -2, -3], [1, 2, 3], [0, 0, 0]]), faces=np.array([[0, 1, 2]])),
            (1.0, 2.0, 3.0),
        ),
    ],
    ids=lambda v: getattr(v, "kind", ""),
)
def test_bounds_hold_the_shape(shape: Shape, half: tuple[float, ...]) -> None:
    bounds = bounds_of(Collision(shape=shape), from_xyz_rpy((1.0, 2.0, 3.0)))
    assert bounds == pytest.approx(np.array([np.subtract((1, 2, 3), half), np.add((1, 2, 3), half)]))


def test_a_body_of_many_boxes_and_a_mesh_stops_the_robot_with_each_of_them() -> None:
    parts = [
        Collision(shape=Shape(kind="box", size=(0.1, 0.1, 0.5)), pose=from_xyz_rpy((3.0, 0.3 * i, 0.25)))
        for i in range(30)
    ]
    corners = np.array([[1.0, -1, 0.3], [1.0, 1, 0.3], [1.0, 0, -0.2], [1.4, 0, -0.2]])
    faces = np.array([[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]])
    parts.append(Collision(shape=Shape(kind="mesh", vertices=corners, faces=faces)))
    engine = Engine(World(bodies=(Body(name="many", collisions=tuple(parts)),)))
    engine.spawn_robot(load_robot(ROBOT))
    reached = []
    for start in (Pose2D(), Pose2D(2.0, 29 * 0.3, 0.0)):
        engine.carry(start)
        for _ in range(800):
            engine.command(Twist2D(0.4, 0.0, 0.0))
            engine.step()
        reached.append(engine.pose.x)
    engine.close()
    assert reached[0] < 0.95
    assert 2.7 < reached[1] < 2.95
