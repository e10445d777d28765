"""Lines of sight in space, held against PyBullet's rays, and what they mean for a motion sensor."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.simulation.actors.doors import Door, plain_door
from rosbot_patrol.simulation.engine import STEP
from rosbot_patrol.simulation.physics.bullet import pybullet
from rosbot_patrol.simulation.physics.bullet_shapes import shapes_of
from rosbot_patrol.simulation.scene.matrices import from_xyz_rpy, to_quaternion
from rosbot_patrol.simulation.scene.scene import Body, Collision, Shape
from rosbot_patrol.simulation.scene.sight import Obstruction, Sight
from rosbot_patrol.simulation.sensors.motion_sensors import SensorPlace

PLACE = SensorPlace(id=4, room=4, x=0.0, y=5.0, z=1.6, yaw=-math.pi / 2)


def block(x: float, y: float, z: float, size: tuple[float, float, float], name: str = "cupboard") -> Body:
    shape = Shape(kind="box", size=size)
    return Body(name=name, kind="furniture", pose=from_xyz_rpy((x, y, z)), collisions=(Collision(shape=shape),))


def scattered(rng: np.random.Generator) -> list[Body]:
    tetrahedron = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]) - 0.25
    faces = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    shapes = [
        Shape(kind="box", size=(0.6, 0.3, 1.1)),
        Shape(kind="mesh", vertices=tetrahedron, faces=faces),
        Shape(kind="box", size=(1.5, 0.02, 0.8)),
    ]
    bodies = []
    for i in range(30):
        pose = from_xyz_rpy(tuple(rng.uniform(-2.0, 2.0, 3)), tuple(rng.uniform(-3.0, 3.0, 3)))
        bodies.append(Body(name=f"b{i}", pose=pose, collisions=(Collision(shape=shapes[i % len(shapes)]),)))
    return bodies


def test_rays_meet_what_pybullets_meet() -> None:
    rng = np.random.default_rng(5)
    bodies = scattered(rng)
    client = pybullet.connect(pybullet.DIRECT)
    try:
        for body in bodies:
            for shape in shapes_of(body.collisions, client):
                pybullet.createMultiBody(
                    baseMass=0.0, baseCollisionShapeIndex=shape, basePosition=body.pose[:3, 3].tolist(),
                    baseOrientation=to_quaternion(body.pose), physicsClientId=client,
                )  # fmt: skip
        starts, ends = rng.uniform(-3.0, 3.0, (1000, 3)), rng.uniform(-3.0, 3.0, (1000, 3))
        hits = pybullet.rayTestBatch(starts.tolist(), ends.tolist(), physicsClientId=client)
        expected = np.array([hit[0] >= 0 for hit in hits])
    finally:
        pybullet.disconnect(client)
    scene = Obstruction(bodies)
    found = np.array([scene.hides(a, b) for a, b in zip(starts, ends, strict=True)])
    assert 0.2 < expected.mean() < 0.8
    # PyBullet's single precision, and starts within a body, of which it says nothing.
    assert (found != expected).mean() < 0.03
    assert not (expected & ~found).sum() > 5


def test_a_thin_board_hides_what_is_below_it() -> None:
    sight = Sight([block(0.0, 0.0, 0.74, (1.2, 0.8, 0.02))])
    assert sight.share((0.0, 1.0, 1.6), [(0.0, 0.0, 0.2)], ()) == 0.0
    assert sight.share((0.0, 3.0, 1.6), [(0.0, 0.9, 0.2)], ()) == 1.0
    assert sight.share((0.0, 1.0, 1.6), [(0.0, 0.0, 0.2), (0.0, 0.0, 1.0)], ()) == 0.5
    assert sight.share((0.0, 1.0, 1.6), [], ()) == 0.0


def test_a_door_hides_while_it_is_closed() -> None:
    door = Door(plain_door("door", Pose2D(-0.45, 0.0, 0.0)))
    sight = Sight([])
    eye, point = (0.0, -2.0, 1.6), (0.0, 2.0, 1.0)
    assert sight.share(eye, [point], [door]) == 0.0
    door.set(1.0, 0.0)
    assert sight.share(eye, [point], [door]) == 1.0
    door.set(0.0, 0.0)
    assert sight.share(eye, [point], [door]) == 0.0


@pytest.mark.parametrize(
    ("height", "model", "fires"),
    [(0.0, "cat", True), (0.6, "cat", False), (1.0, "person", True), (1.0, "dog", False), (2.4, "person", False)],
)
def test_low_furniture_hides_pets_and_not_people(build, height: float, model: str, fires: bool) -> None:
    things = (block(0.0, 2.6, height / 2.0, (6.0, 0.4, height)),) if height else ()
    engine = build(*things, sensors=(PLACE,))
    name = engine.population.spawn_actor("", model, "", Pose2D(-1.2, 2.2, 0.0))
    engine.population.move_actor(name, [Pose2D(1.2, 2.2, 0.0)], 0.8)
    changes = []
    for _ in range(round(3.5 / STEP)):
        engine.step()
        changes += engine.motion_sensors.changes(engine.now)
    assert ((4, True) in changes) == fires


def test_half_in_sight_is_noticed_less_far(build) -> None:
    def fires(y: float) -> bool:
        engine = build(block(0.0, y + 0.4, 0.55, (12.0, 0.2, 1.1)), sensors=(PLACE,), robot=False)
        name = engine.population.spawn_actor("", "person", "", Pose2D(-1.0, y, 0.0))
        engine.population.move_actor(name, [Pose2D(1.0, y, 0.0)], 0.8)
        changes = []
        for _ in range(round(3.0 / STEP)):
            engine.step()
            changes += engine.motion_sensors.changes(engine.now)
        return (4, True) in changes

    assert fires(1.5)
    assert not fires(-1.5)
