"""Doors: how they swing, what stops them, and who meets them."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from rosbot_patrol.errors import WorldError
from rosbot_patrol.geometry import Pose2D, Twist2D
from rosbot_patrol.simulation.actors.doors import Door, plain_door
from rosbot_patrol.simulation.engine import STEP, Engine, EngineParams
from rosbot_patrol.simulation.robot.description import load_robot
from rosbot_patrol.simulation.scene.matrices import from_xyz_rpy
from rosbot_patrol.simulation.scene.scene import Body, Collision, Shape
from rosbot_patrol.simulation.sdf.world import World, load_world
from rosbot_patrol.simulation.sensors.lidar import LidarParams
from rosbot_patrol.simulation.sensors.motion_sensors import SensorPlace

ROOT = Path(__file__).parents[4]
HINGE = Pose2D(2.0, -0.5, math.pi / 2.0)  # a doorway of 1 m across x, before the robot
WALLS = tuple(
    Body(name=f"wall_{y}", kind="wall", pose=from_xyz_rpy((2.0, y, 1.25)),
         collisions=(Collision(shape=Shape(kind="box", size=(0.1, 4.0, 2.5))),))
    for y in (-2.5, 2.5)
)  # fmt: skip
DOOR = plain_door("door", HINGE, width=1.0, swing=-math.pi / 2.0)

WORLD = """<sdf version="1.6"><world name="w">
<model name="front_door"><pose>2 -0.5 0 0 0 1.5707963</pose>
<link name="frame"><collision name="c"><pose>-0.05 0 1 0 0 0</pose>
  <geometry><box><size>0.1 0.1 2</size></box></geometry></collision></link>
<link name="leaf"><pose>0.5 0 1 0 0 0</pose>
  <collision name="c"><geometry><box><size>1.0 0.04 2</size></box></geometry></collision>
  <visual name="v"><geometry><box><size>1.0 0.04 2</size></box></geometry></visual></link>
<joint name="hinge" type="revolute"><parent>frame</parent><child>leaf</child><pose>-0.5 0 0 0 0 0</pose>
  <axis><xyz>0 0 1</xyz><limit><lower>-1.2</lower><upper>0</upper></limit></axis></joint>
</model></world></sdf>"""


@pytest.fixture
def build() -> Iterator[object]:
    engines: list[Engine] = []

    def make(*, sensors: tuple[SensorPlace, ...] = (), world: World | None = None) -> Engine:
        params = EngineParams(lidar=LidarParams(noise=0.0))
        engine = Engine(world or World(bodies=WALLS), params, sensors=sensors)
        engine.spawn_robot(load_robot(ROOT / "urdf" / "rosbot.urdf"))
        if world is None:
            engine.population.spawn_door(DOOR)
        engines.append(engine)
        return engine

    yield make
    for engine in engines:
        engine.close()


def run(engine: Engine, seconds: float, twist: Twist2D | None = None) -> None:
    for _ in range(round(seconds / STEP)):
        if twist is not None:
            engine.command(twist)
        engine.step()


def ahead(engine: Engine) -> float:
    """What the lidar measures straight ahead of the base [m], from the base's middle."""
    x, y, yaw = engine.pose
    scan = engine.scan()
    mount = 0.02  # of the lidar before the base
    bearings = scan.angle_min + scan.angle_increment * np.arange(len(scan.ranges)) + math.pi  # it looks back
    nearest = np.argmin(np.abs(np.angle(np.exp(1j * bearings))))
    assert (x, y, yaw) == pytest.approx((0.0, 0.0, 0.0), abs=1e-6)
    return float(scan.ranges[nearest]) + mount


def test_a_leaf_swings_at_its_speed_about_its_hinge() -> None:
    door = Door(plain_door("d", Pose2D(1.0, 2.0, 0.0), width=0.8, swing=1.2))
    door.set(1.0, 0.6)
    moved = sum(door.step(0.01, ()) for _ in range(100))
    assert moved == 100
    assert door.angle == pytest.approx(0.6)
    assert door.matrix[:2, 3] == pytest.approx((1.0, 2.0))
    tip = door.matrix @ np.array([0.8, 0.0, 1.0, 1.0])
    assert tip[:2] == pytest.approx((1.0 + 0.8 * math.cos(0.6), 2.0 + 0.8 * math.sin(0.6)))
    assert door.distance_to(*tip[:2]) == pytest.approx(0.0, abs=1e-6)
    assert door.distance_to(1.0, 1.0) == pytest.approx(1.0, abs=0.03)
    assert sum(door.step(0.01, ()) for _ in range(200)) == 100
    assert door.opening == 1.0
    assert not door.is_moving


def test_the_cut_of_a_leaf_turns_with_it() -> None:
    door = Door(plain_door("d", Pose2D(1.0, 2.0, 0.0), width=0.8, swing=math.pi / 2.0))
    for opening in (0.0, 0.5, 1.0):
        door.set(opening, 0.0)
        ends = door.cut(0.16).segments.reshape(-1, 2) - (1.0, 2.0)
        far = ends[np.argmax(np.hypot(*ends.T))]
        assert math.atan2(far[1], far[0]) == pytest.approx(door.angle, abs=0.03)
        assert np.hypot(*far) == pytest.approx(0.8, abs=0.01)
    assert not len(door.cut(2.2).segments)


def test_something_in_the_way_holds_a_leaf_up_until_it_goes_or_the_leaf_turns_back() -> None:
    door = Door(plain_door("d", Pose2D(), width=0.8, swing=math.pi / 2.0))
    somebody = [(Pose2D(0.5, 0.5), 0.25)]
    door.set(1.0, 1.0)
    for _ in range(300):
        door.step(0.01, somebody)
    assert door.is_held_up
    assert door.angle < 0.5
    assert door.distance_to(0.5, 0.5) >= 0.25
    door.set(0.0, 1.0)
    for _ in range(100):
        door.step(0.01, somebody)
    assert door.opening == 0.0
    door.set(1.0, 1.0)
    for _ in range(300):
        door.step(0.01, ())
    assert door.opening == 1.0


@pytest.mark.parametrize("crowd", [0, 60])  # many segments are searched in groups
def test_the_lidar_meets_the_leaf_where_it_stands(build, crowd: int) -> None:
    boxes = [from_xyz_rpy((-5.0, 0.5 * i - 15.0, 0.5)) for i in range(crowd)]
    cube = Collision(shape=Shape(kind="box", size=(0.3, 0.3, 1.0)))
    far = (Body(name=f"box_{i}", pose=pose, collisions=(cube,)) for i, pose in enumerate(boxes))
    engine = build(world=World(bodies=(*WALLS, *far)))
    engine.population.spawn_door(DOOR)
    assert ahead(engine) == pytest.approx(2.0 - 0.02, abs=0.012)
    engine.population.set_door("door", 1.0)
    run(engine, 1.0)
    half = engine.population.doors[0].angle
    assert half == pytest.approx(-0.8, abs=0.01)
    run(engine, 1.5)
    assert engine.population.doors[0].opening == 1.0
    assert ahead(engine) == math.inf


def test_the_robot_meets_a_closed_door_as_a_door_and_passes_an_open_one(build) -> None:
    engine = build()
    run(engine, 8.0, Twist2D(0.4, 0.0, 0.0))
    assert engine.pose.x == pytest.approx(1.98 - 0.10, abs=0.01)
    assert {(t.other, t.kind) for t in engine.touches()} == {("door", "door")}
    engine.carry(Pose2D())
    engine.population.set_door("door", 1.0, 0.0)
    run(engine, 8.0, Twist2D(0.4, 0.0, 0.0))
    assert engine.pose.x > 2.5


def test_a_leaf_stops_before_the_robot_and_does_not_push_it(build) -> None:
    engine = build()
    engine.population.set_door("door", 1.0, 0.0)
    engine.carry(Pose2D(2.0, 0.2, 0.0))
    engine.population.set_door("door", 0.0)
    run(engine, 4.0)
    door = engine.population.doors[0]
    assert door.is_held_up
    assert 0.1 < door.opening < 0.9
    assert engine.pose == pytest.approx((2.0, 0.2, 0.0), abs=1e-3)
    assert not engine.touches()
    engine.carry(Pose2D())
    run(engine, 3.0)
    assert door.opening == 0.0


def test_a_person_waits_before_a_closed_door_and_walks_on_when_it_opens(build) -> None:
    engine = build()
    name = engine.population.spawn_actor("", "person", "visitor", Pose2D(1.0, 0.0, 0.0))
    engine.population.move_actor(name, [Pose2D(4.0, 0.0)], 1.0)
    run(engine, 3.0)
    assert 1.6 < engine.population.walkers[0].pose.x < 1.8
    assert not engine.population.walkers[0].is_walking
    engine.population.set_door("door", 1.0)
    run(engine, 7.0)
    assert engine.population.walkers[0].pose.x == pytest.approx(4.0, abs=0.06)


def test_a_closed_door_hides_people_from_a_motion_sensor(build) -> None:
    def fires(opening: float) -> bool:
        engine = build(sensors=(SensorPlace(id=1, room=1, x=0.0, y=0.0, yaw=0.0),))
        engine.carry(Pose2D(-3.0, 0.0, 0.0))
        engine.population.set_door("door", opening, 0.0)
        engine.population.spawn_actor("p", "person", "visitor", Pose2D(3.6, -0.6, math.pi / 2.0))
        engine.population.move_actor("p", [Pose2D(3.6, 0.6, math.pi / 2.0)], 1.0)
        run(engine, 2.5)
        return engine.motion_sensors.levels(engine.now)[1]

    assert fires(1.0)
    assert not fires(0.0)


def test_a_door_of_a_world_is_hung_on_its_joint(build, tmp_path: Path) -> None:
    file = tmp_path / "door.world"
    file.write_text(WORLD)
    world = load_world(file)
    assert [b.name for b in world.bodies] == ["front_door/frame"]
    (place,) = world.doors
    assert place.axis == pytest.approx((2.0, -0.5), abs=1e-6)
    assert place.swing == -1.2
    engine = build(world=world)
    assert ahead(engine) == pytest.approx(1.98, abs=0.012)
    engine.population.set_door("front_door/leaf", 1.0, 0.0)
    assert ahead(engine) == math.inf
    leaf = engine.population.doors[0]
    assert leaf.distance_to(2.0 + math.sin(1.2), -0.5 + math.cos(1.2)) < 0.03


def test_a_door_without_an_upright_hinge_stands_fast(tmp_path: Path) -> None:
    file = tmp_path / "door.world"
    for text in (WORLD.replace("revolute", "fixed"), WORLD.replace("0 0 1</xyz>", "1 0 0</xyz>")):
        file.write_text(text)
        world = load_world(file)
        assert not world.doors
        assert {b.kind for b in world.bodies} == {"door"}
    file.write_text(WORLD.replace("-1.2", "wide"))
    with pytest.raises(
        WorldError, match=r"door\.world: model 'front_door', link 'leaf', joint 'hinge', <lower>: expected"
    ):
        load_world(file)


def test_a_door_is_taken_out_and_its_name_is_free_again(build) -> None:
    engine = build()
    with pytest.raises(WorldError, match="the name is taken"):
        engine.population.spawn_actor("door", "person", "", Pose2D(1.0, 1.0))
    engine.population.remove("door")
    assert ahead(engine) == math.inf
    engine.population.spawn_actor("door", "person", "", Pose2D(1.0, 1.0))


def test_neither_a_door_nor_an_actor_is_put_where_the_robot_stands(build) -> None:
    engine = build()
    engine.population.set_door("door", 1.0, 0.0)
    engine.carry(Pose2D(2.0, 0.1, 0.0))
    engine.population.spawn_actor("p", "person", "", Pose2D(4.0, 0.0))
    for call in (
        lambda: engine.population.set_door("door", 0.0, 0.0),
        lambda: engine.population.spawn_door(plain_door("second", Pose2D(1.6, 0.1, 0.0))),
        lambda: engine.population.spawn_actor("q", "dog", "", Pose2D(2.1, 0.0)),
        lambda: engine.population.move_actor("p", [Pose2D(2.0, 0.05)], 0.0),
    ):
        with pytest.raises(WorldError, match="cannot stand where the robot is"):
            call()
    assert [a.name for a in engine.population.walkers] == ["p"]
    assert engine.population.walkers[0].pose == Pose2D(4.0, 0.0)
    assert [d.opening for d in engine.population.doors] == [1.0]
    run(engine, 0.5)
    assert engine.pose == pytest.approx((2.0, 0.1, 0.0), abs=1e-6)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda e: e.population.set_door("gate", 1.0), r"door 'gate': is not there \(there: door\)"),
        (lambda e: e.population.set_door("door", 1.5), "opens from 0 to 1, not to 1.5"),
        (lambda e: e.population.set_door("door", math.nan), "opens from 0 to 1, not to nan"),
        (lambda e: e.population.set_door("door", 1.0, -1.0), "cannot move at -1.0 rad/s"),
        (lambda e: e.population.spawn_door(plain_door("door", Pose2D())), "the name is taken"),
        (lambda e: e.population.spawn_door(plain_door("", Pose2D())), "has no name"),
        (lambda e: e.population.spawn_door(plain_door("d", Pose2D(), width=-1.0)), "cannot be -1.0 m wide"),
        (lambda e: e.population.spawn_door(plain_door("d", Pose2D(math.nan))), "cannot be"),
        (
            lambda e: e.population.spawn_door(plain_door("d", Pose2D(), swing=0.0)),
            "swings by 0.000 rad, expected 0.05 to 3.14",
        ),
    ],
)
def test_doors_that_cannot_be(build, call, words: str) -> None:
    with pytest.raises(WorldError, match=words):
        call(build())
