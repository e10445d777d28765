"""The running world: driving, walls, odometry, sensors, actors, and that all of it repeats exactly."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from rosbot_patrol.errors import WorldError
from rosbot_patrol.geometry import Pose2D, Twist2D, wrap_angle
from rosbot_patrol.simulation.engine import STEP, Engine, EngineParams
from rosbot_patrol.simulation.robot.description import load_robot
from rosbot_patrol.simulation.robot.drive import DriveParams
from rosbot_patrol.simulation.robot.odometry import OdometryParams
from rosbot_patrol.simulation.scene.matrices import from_xyz_rpy
from rosbot_patrol.simulation.scene.scene import Body, Collision, Shape
from rosbot_patrol.simulation.sdf.world import World, load_world
from rosbot_patrol.simulation.sensors.motion_sensors import SensorPlace

ROOT = Path(__file__).parents[3]
NO_SLIP = DriveParams(slip=0.0, scrub=0.0)


def wall(x: float, y: float, *, size: tuple[float, float] = (0.2, 4.0), name: str = "wall") -> Body:
    shape = Shape(kind="box", size=(*size, 2.0))
    return Body(name=name, kind="wall", pose=from_xyz_rpy((x, y, 1.0)), collisions=(Collision(shape=shape),))


def drive(engine: Engine, vx: float, wz: float, seconds: float) -> float:
    """Drive; returns the angle turned."""
    turned, before = 0.0, engine.pose.yaw
    for _ in range(round(seconds / STEP)):
        engine.command(Twist2D(vx, 0.0, wz))
        engine.step()
        turned += wrap_angle(engine.pose.yaw - before)
        before = engine.pose.yaw
    return turned


def test_drives_straight_as_far_as_told(build) -> None:
    engine = build(drive=NO_SLIP)
    drive(engine, 0.2, 0.0, 5.0)
    assert engine.pose.x == pytest.approx(1.0, abs=0.02)
    assert abs(engine.pose.y) < 1e-6


def test_turns_as_fast_as_told_and_at_half_rate_with_the_legacy_separation(build) -> None:
    assert drive(build(drive=NO_SLIP), 0.0, 0.75, 8.38) == pytest.approx(math.tau, abs=0.06)
    legacy = DriveParams(slip=0.0, scrub=0.0, legacy_wheel_separation=0.1)
    assert drive(build(drive=legacy), 0.0, 0.75, 8.0) == pytest.approx(3.0, abs=0.05)


def test_wheels_have_a_top_speed_and_keep_the_curve(build) -> None:
    engine = build(drive=NO_SLIP)
    drive(engine, 2.0, 2.0, 2.0)
    assert engine.twist.vx < 0.4
    assert engine.twist.wz / engine.twist.vx == pytest.approx(1.0, abs=0.02)


def test_stops_half_a_second_after_the_last_command(build) -> None:
    engine = build()
    drive(engine, 0.3, 0.0, 1.0)
    for _ in range(round(0.45 / STEP)):
        engine.step()
    assert engine.twist.vx > 0.2
    for _ in range(round(0.4 / STEP)):
        engine.step()
    assert abs(engine.twist.vx) < 1e-3


def test_a_command_that_is_not_finite_stops_the_base(build) -> None:
    engine = build()
    drive(engine, math.nan, 0.0, 0.5)
    drive(engine, 0.0, math.inf, 0.5)
    assert engine.pose == pytest.approx((0.0, 0.0, 0.0), abs=1e-6)


def test_a_wall_stops_it_and_is_told_while_the_wheels_turn_on(build) -> None:
    engine = build(wall(1.0, 0.0))
    drive(engine, 0.4, 0.0, 10.0)
    assert engine.pose.x == pytest.approx(0.9 - 0.1, abs=0.015)
    assert abs(engine.twist.vx) < 0.01
    assert {(t.other, t.kind) for t in engine.touches()} == {("wall", "wall")}
    assert engine.robot.odometry.pose.x > 3.0
    drive(engine, -0.3, 0.0, 1.0)
    assert not engine.touches()


@pytest.mark.parametrize("yaw", [0.4, 0.9, -0.7])
def test_it_neither_tunnels_nor_sticks_at_an_angle(build, yaw: float) -> None:
    engine = build(wall(1.0, 0.0, size=(0.05, 20.0)))
    engine.carry(Pose2D(0.0, 0.0, yaw))
    drive(engine, 0.4, 0.0, 8.0)
    assert engine.pose.x < 0.98


def test_odometry_drifts_a_little(build) -> None:
    engine = build()
    drive(engine, 0.2, 0.0, 25.0)
    pose = engine.robot.odometry.pose
    gap = math.hypot(pose.x - engine.pose.x, pose.y - engine.pose.y)
    assert 0.002 < gap < 0.4
    before = engine.robot.odometry.pose.yaw
    turned, told = 0.0, 0.0
    for _ in range(84):
        turned += drive(engine, 0.0, 0.75, 0.1)
        told += wrap_angle(engine.robot.odometry.pose.yaw - before)
        before = engine.robot.odometry.pose.yaw
    assert 1e-4 < abs(told - turned) < math.radians(6.0)


def test_perfect_encoders_tell_the_truth(build) -> None:
    exact = OdometryParams(radius_error=0.0, track_error=0.0, ticks_per_turn=1e6)
    engine = build(drive=NO_SLIP, encoder=exact)
    drive(engine, 0.2, 0.3, 10.0)
    assert engine.robot.odometry.pose == pytest.approx(tuple(engine.pose), abs=0.01)


def test_the_imu_follows_the_turn_and_feels_gravity(build) -> None:
    engine = build()
    drive(engine, 0.0, 0.5, 2.0)
    reading = engine.imu()
    assert reading.rates[2] == pytest.approx(0.5, abs=0.03)
    assert reading.yaw == pytest.approx(engine.pose.yaw, abs=0.01)
    assert reading.accelerations[2] == pytest.approx(9.8, abs=0.1)


def test_the_battery_drains_faster_while_driving(build) -> None:
    idle, busy = build(), build()
    drive(idle, 0.0, 0.0, 5.0)
    drive(busy, 0.4, 0.0, 5.0)
    assert busy.robot.battery.charge < idle.robot.battery.charge < 1.0
    assert 9.0 < busy.robot.battery.voltage < 12.6


def test_a_robot_in_a_wall_is_refused(build) -> None:
    engine = build(wall(0.0, 0.0), robot=False)
    with pytest.raises(WorldError, match="'wall' is there"):
        engine.spawn_robot(load_robot(ROOT / "urdf" / "rosbot.urdf"))
    assert not engine.has_robot


def test_a_pose_that_is_not_finite_is_refused(build) -> None:
    engine = build(robot=False)
    with pytest.raises(WorldError, match="is no pose"):
        engine.spawn_robot(load_robot(ROOT / "urdf" / "rosbot.urdf"), Pose2D(math.nan, 0.0, 0.0))
    with pytest.raises(WorldError, match="is no pose"):
        engine.population.spawn_actor("", "person", "", Pose2D(0.0, math.inf, 0.0))


def test_a_second_robot_is_refused(build) -> None:
    with pytest.raises(WorldError, match="is there already"):
        build().spawn_robot(load_robot(ROOT / "urdf" / "rosbot.urdf"))


def test_a_person_walks_its_path_is_seen_and_goes(build) -> None:
    engine = build()
    name = engine.population.spawn_actor("", "person", "", Pose2D(3.0, 0.0, math.pi))
    engine.population.move_actor(name, [Pose2D(3.0, 1.0, 0.0)], 1.0)
    for _ in range(round(4.0 / STEP)):
        engine.step()
    (person,) = engine.population.walkers
    assert person.pose[:2] == pytest.approx((3.0, 1.0), abs=0.06)
    assert not person.is_walking
    scan = engine.scan()
    hits = scan.is_hit
    assert 0 < hits.sum() < 40
    assert scan.ranges[hits].min() == pytest.approx(math.hypot(2.98, 1.0), abs=0.3)
    engine.population.remove(name)
    assert np.isinf(engine.scan().ranges).all()


def test_two_legs_are_two_groups_of_beams(build) -> None:
    engine = build()
    engine.population.spawn_actor("", "person", "visitor", Pose2D(1.5, 0.0, 0.0))
    hit = np.roll(engine.scan().is_hit, 360)
    assert np.diff(hit.astype(int)).clip(0).sum() == 2


def test_a_person_stops_before_the_robot_and_is_touched_as_a_person(build) -> None:
    engine = build()
    name = engine.population.spawn_actor("", "person", "", Pose2D(2.0, 0.0, math.pi))
    engine.population.move_actor(name, [Pose2D(-2.0, 0.0, 0.0)], 1.0)
    for _ in range(round(5.0 / STEP)):
        engine.step()
    assert engine.population.walkers[0].pose.x > 0.35
    drive(engine, 0.3, 0.0, 3.0)
    assert {t.kind for t in engine.touches()} == {"person"}


@pytest.mark.parametrize(
    ("name", "model", "look", "words"),
    [
        ("wall", "person", "", "taken"),
        ("x", "elk", "", "expected one of person, fire_hydrant"),
        ("x", "person", "nobody", "no look"),
    ],
)
def test_actors_that_cannot_be(build, name: str, model: str, look: str, words: str) -> None:
    with pytest.raises(WorldError, match=words):
        build(wall(3.0, 0.0)).population.spawn_actor(name, model, look, Pose2D())


def test_moves_that_cannot_be(build) -> None:
    engine = build()
    engine.population.spawn_actor("joe", "person", "", Pose2D(2, 0, 0))
    with pytest.raises(WorldError, match="'jim': is not there"):
        engine.population.move_actor("jim", [Pose2D()], 1.0)
    with pytest.raises(WorldError, match="at least one point"):
        engine.population.move_actor("joe", [], 1.0)
    with pytest.raises(WorldError, match="at -1"):
        engine.population.move_actor("joe", [Pose2D()], -1.0)


@pytest.mark.parametrize("yields", [True, False])
def test_who_does_not_yield_steps_over_the_robot_and_touches_it(build, yields: bool) -> None:
    engine = build()
    engine.population.spawn_actor("joe", "person", "", Pose2D(1.5, 0.0, math.pi))
    engine.population.move_actor("joe", [Pose2D(-1.5, 0.0, 0.0)], 1.0, yields=yields)
    touched = set()
    for _ in range(round(5.0 / STEP)):
        engine.step()
        touched |= {touch.other for touch in engine.touches()}
    assert engine.pose.x == pytest.approx(0.0, abs=1e-3)
    assert touched == (set() if yields else {"joe"})
    assert (engine.population.walkers[0].pose.x < -1.4) == (not yields)


def test_a_motion_sensor_sees_no_one_behind_a_wall(build) -> None:
    place = SensorPlace(id=4, room=4, x=0.0, y=5.0, yaw=-math.pi / 2)

    def fires(*bodies: Body) -> bool:
        engine = build(*bodies, sensors=(place,))
        name = engine.population.spawn_actor("", "person", "", Pose2D(-1.5, 1.5, 0.0))
        engine.population.move_actor(name, [Pose2D(1.5, 1.5, 0.0)], 1.0)
        changes = []
        for _ in range(round(3.0 / STEP)):
            engine.step()
            changes += engine.motion_sensors.changes(engine.now)
        return (4, True) in changes

    assert fires()
    assert not fires(wall(0.0, 3.0, size=(8.0, 0.2)))


def run_house(seed: int) -> list[bytes]:
    """What a drive through the house gives, sensor by sensor."""
    place = SensorPlace(id=1, room=1, x=4.57, y=1.09, yaw=-2.1)
    engine = Engine(load_world(ROOT / "worlds" / "house.world"), EngineParams(seed=seed), sensors=[place])
    engine.spawn_robot(load_robot(ROOT / "urdf" / "rosbot.urdf"))
    name = engine.population.spawn_actor("", "person", "", Pose2D(2.0, 0.5, 0.0))
    engine.population.move_actor(name, [Pose2D(3.0, -0.5, 0.0), Pose2D(2.0, 0.5, 0.0)], 0.8, loop=True)
    data = []
    for i in range(1000):
        engine.command(Twist2D(0.3, 0.0, 0.4 * math.sin(i / 100)))
        engine.step()
        if i % 20 == 0:
            data.append(engine.scan().ranges.tobytes())
            data.append(np.array([*engine.pose, *engine.robot.odometry.pose, *engine.imu().rates]).tobytes())
            data.append(repr((engine.ranges(), engine.motion_sensors.levels(engine.now), engine.touches())).encode())
    engine.close()
    return data


def test_the_same_seed_gives_the_same_data_bit_for_bit() -> None:
    assert run_house(3) == run_house(3)
    assert run_house(3) != run_house(4)


def test_noise_does_not_depend_on_who_listened_before(build) -> None:
    engines = [build(wall(2.0, 0.0)), build(wall(2.0, 0.0))]
    engines[0].scan()
    for engine in engines:
        drive(engine, 0.1, 0.0, 0.5)
    assert np.array_equal(engines[0].scan().ranges, engines[1].scan().ranges)


def test_a_start_that_is_taken_gives_the_nearest_free_place_with_room_around_it() -> None:
    block = wall(0.0, 0.0, size=(1.0, 1.0), name="table")
    engine = Engine(World(bodies=(block, wall(1.3, 0.0, name="wall"))))
    robot = load_robot(ROOT / "urdf" / "rosbot.urdf")
    place = engine.spawn_near(robot, Pose2D(0.0, 0.0, 1.0))
    assert engine.pose == pytest.approx(place)
    assert place.yaw == 1.0
    assert math.hypot(place.x, place.y) == pytest.approx(1.0, abs=0.25)
    assert place.x < 0.5  # not in the gap before the wall
    engine.remove_robot()
    with pytest.raises(WorldError, match="is no place for it, 'table' is there"):
        engine.spawn_near(robot, reach=0.4)
    assert engine.spawn_near(robot, Pose2D(-2.0, 0.0, 0.0)) == Pose2D(-2.0, 0.0, 0.0)
    with pytest.raises(WorldError, match="is there already"):
        engine.spawn_near(robot)
