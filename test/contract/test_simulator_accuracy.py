"""The simulator's sensors against exact geometry: lidar, depth and odometry err as they are configured to, no more.

Statistics of N independent samples are held to four standard errors; seeds are fixed, so a pass stays a pass.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from rosbot_patrol.geometry import Pose2D, Twist2D, wrap_angle
from rosbot_patrol.simulation.engine import STEP, Engine, EngineParams
from rosbot_patrol.simulation.render.egl import make_renderer
from rosbot_patrol.simulation.robot.description import load_robot
from rosbot_patrol.simulation.robot.drive import DriveParams
from rosbot_patrol.simulation.robot.imu import ImuParams
from rosbot_patrol.simulation.robot.odometry import OdometryParams
from rosbot_patrol.simulation.scene.matrices import from_xyz_rpy
from rosbot_patrol.simulation.scene.scene import Body, Collision, SceneRenderer, Shape, Visual
from rosbot_patrol.simulation.sdf.world import World
from rosbot_patrol.simulation.sensors.camera import Camera, CameraParams
from rosbot_patrol.simulation.sensors.lidar import LidarParams

URDF = Path(__file__).parents[2] / "urdf" / "rosbot.urdf"
FORWARD = np.array([[0, 0, 1, 0], [-1, 0, 0, 0], [0, -1, 0, 0], [0, 0, 0, 1.0]])  # a camera that looks along x
HALF = 2.0  # of the square room [m]


def square_room() -> World:
    walls = []
    for i in range(4):
        pose = from_xyz_rpy((0, 0, 0), (0, 0, i * math.pi / 2)) @ from_xyz_rpy((HALF + 0.05, 0.0, 0.5))
        shape = Shape(kind="box", size=(0.1, 2 * HALF + 0.2, 1.0))
        walls.append(Body(name=f"wall_{i}", kind="wall", pose=pose, collisions=(Collision(shape=shape),)))
    return World(bodies=tuple(walls))


def exact_ranges(engine: Engine) -> np.ndarray:
    """Distances of all beams to the square's walls, by plane geometry."""
    x, y, yaw = engine.pose
    lx, ly = x + 0.02 * math.cos(yaw), y + 0.02 * math.sin(yaw)  # the lidar, which looks back
    bearings = yaw + math.pi + np.linspace(-math.pi, math.pi, 720)
    c, s = np.cos(bearings), np.sin(bearings)
    with np.errstate(divide="ignore"):
        return np.minimum((HALF - np.sign(c) * lx) / np.abs(c), (HALF - np.sign(s) * ly) / np.abs(s))


def engine_in(world: World, **parts: object) -> Engine:
    engine = Engine(world, EngineParams(**parts))  # type: ignore[arg-type]
    engine.spawn_robot(load_robot(URDF))
    return engine


def drive(engine: Engine, vx: float, wz: float, seconds: float) -> None:
    for _ in range(round(seconds / STEP)):
        engine.command(Twist2D(vx, 0.0, wz))
        engine.step()


# Lidar ---------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("noise", "resolution"), [(0.01, 0.0), (0.01, 0.01), (0.03, 0.0), (0.0, 0.02)])
def test_the_lidar_errs_as_configured(noise: float, resolution: float) -> None:
    """Mean error 0, variance that of the noise and of rounding, and no more of the tails than a bell curve has."""
    engine = engine_in(square_room(), lidar=LidarParams(noise=noise, resolution=resolution), seed=5)
    engine.carry(Pose2D(0.3, -0.4, 0.7))
    errors = []
    for _ in range(60):
        engine.step()
        errors.append(engine.scan().ranges - exact_ranges(engine))
    engine.close()
    flat = np.concatenate(errors)
    spread = math.hypot(noise, resolution / math.sqrt(12.0))
    count = len(flat) if noise > 0.0 else 720  # without noise each scan rounds alike
    assert abs(flat.mean()) < 4.0 * spread / math.sqrt(count)
    assert flat.std() == pytest.approx(spread, rel=4.0 / math.sqrt(2.0 * count))
    if noise > 0.0 and resolution == 0.0:
        assert (np.abs(flat) > 2.0 * noise).mean() == pytest.approx(0.0455, abs=4.0 * math.sqrt(0.0455 / count))
        before, after = flat[:-720], flat[720:]
        assert abs(np.corrcoef(before, after)[0, 1]) < 4.0 / math.sqrt(len(before))  # each scan anew


def test_without_noise_the_lidar_is_exact() -> None:
    engine = engine_in(square_room(), lidar=LidarParams(noise=0.0, resolution=0.0))
    for yaw in np.linspace(-3.0, 3.0, 7):
        engine.carry(Pose2D(-0.8, 0.9, float(yaw)))
        engine.step()
        assert np.abs(engine.scan().ranges - exact_ranges(engine)).max() < 1e-6
    engine.close()


def test_beams_are_dropped_by_chance_as_often_as_configured() -> None:
    engine = engine_in(square_room(), lidar=LidarParams(dropped=0.05), seed=2)
    lost = []
    for _ in range(50):
        engine.step()
        lost.append(np.isinf(engine.scan().ranges))
    engine.close()
    n = 50 * 720
    assert np.mean(lost) == pytest.approx(0.05, abs=4.0 * math.sqrt(0.05 * 0.95 / n))
    assert np.mean(lost, axis=0).max() < 0.3  # not always the same


# Depth ---------------------------------------------------------------------------------------------------------------


@pytest.fixture(params=["egl", "tiny"])
def renderer(request: pytest.FixtureRequest) -> Iterator[SceneRenderer]:
    made = make_renderer(prefer=request.param)
    yield made
    made.close()


@pytest.mark.parametrize("turn_deg", [0.0, 25.0, -40.0, 60.0])
@pytest.mark.parametrize("tilt_deg", [0.0, 30.0])
def test_depth_of_a_slanted_plane_is_within_a_centimetre_at_three_metres(
    renderer: SceneRenderer, turn_deg: float, tilt_deg: float
) -> None:
    pose = from_xyz_rpy((3.0, 0.0, 0.0), (0.0, math.radians(tilt_deg), math.radians(turn_deg)))
    visual = Visual(shape=Shape(kind="box", size=(0.0002, 8.0, 8.0)))
    renderer.add(Body(name="board", pose=pose, visuals=(visual,)))
    params = CameraParams(depth_max=100.0, depth_min=0.0)
    view = params.intrinsics
    _, depth = renderer.render(FORWARD, view)
    rows, columns = np.mgrid[0 : view.height, 0 : view.width]
    rays = np.stack([np.ones_like(rows), -(columns - view.cx) / view.fx, -(rows - view.cy) / view.fy], axis=-1)
    normal = pose[:3, 0]
    exact = (normal @ [3.0, 0.0, 0.0]) / (rays @ normal)
    places = exact[..., None] * rays - [3.0, 0.0, 0.0]
    on_board = (np.abs(places @ pose[:3, 1]) < 3.9) & (np.abs(places @ pose[:3, 2]) < 3.9) & (exact > 0.2)
    near = on_board & (exact > 2.5) & (exact < 3.5)
    assert near.sum() > 3000
    assert np.abs(depth - exact)[near].max() < 0.01
    assert np.abs(depth - exact)[on_board & (exact < 5.0)].max() < 0.01


def test_depth_noise_grows_with_the_square_as_configured() -> None:
    board = Visual(shape=Shape(kind="box", size=(0.0002, 12.0, 12.0)))
    for distance in (1.0, 3.0):
        body = Body(name="board", pose=from_xyz_rpy((distance + 0.0001, 0.0, 0.0)), visuals=(board,))
        camera = Camera(CameraParams(depth_noise=0.002), lambda: make_renderer("egl"), (body,), seed=3)
        errors = np.stack([camera.take(FORWARD, (), i).depth - distance for i in range(4)])
        camera.close()
        assert np.std(errors) == pytest.approx(0.002 * distance**2, rel=0.01)
        assert abs(np.mean(errors)) < 0.001


# Odometry and inertial unit -------------------------------------------------------------------------------------------


def drifts(metres: float, turns: float, seeds: int, **parts: object) -> np.ndarray:
    """What odometry tells too much, of way [m] and of turning [rad], shape (seeds, 2)."""
    found = []
    for seed in range(seeds):
        engine = engine_in(World(), seed=seed, **parts)
        way = told_way = turned = told = 0.0
        pose, odometry = engine.pose, engine.robot.odometry.pose
        vx, wz = (0.35, 0.0) if metres else (0.0, 2.0)
        while way < metres or abs(turned) < turns * math.tau:
            drive(engine, vx, wz, 0.1)
            now, told_now = engine.pose, engine.robot.odometry.pose
            way += math.hypot(now.x - pose.x, now.y - pose.y)
            told_way += math.hypot(told_now.x - odometry.x, told_now.y - odometry.y)
            turned += wrap_angle(now.yaw - pose.yaw)
            told += wrap_angle(told_now.yaw - odometry.yaw)
            pose, odometry = now, told_now
        found.append((told_way - way, told - turned))
        engine.close()
    return np.array(found)


NO_SLIP = DriveParams(slip=0.0, scrub=0.0)


@pytest.mark.parametrize("error", [0.004, -0.02, 0.0])
def test_ten_metres_drift_by_the_error_of_the_wheel_radius(error: float) -> None:
    encoder = OdometryParams(radius_error=error, track_error=0.0)
    drift = drifts(10.0, 0.0, 1, drive=NO_SLIP, encoder=encoder)[0]
    assert drift[0] == pytest.approx(10.0 * error, abs=0.01)  # the encoder's age of 0.05 s and its ticks
    assert abs(drift[1]) < 1e-3


@pytest.mark.parametrize("error", [-0.002, 0.03])
def test_ten_turns_drift_by_the_error_of_the_track(error: float) -> None:
    encoder = OdometryParams(radius_error=0.0, track_error=error)
    drift = drifts(0.0, 10.0, 1, drive=NO_SLIP, encoder=encoder)[0]
    assert drift[1] == pytest.approx(10.0 * math.tau * (1.0 / (1.0 + error) - 1.0), abs=0.03)


def test_unequal_wheels_bend_what_odometry_tells() -> None:
    encoder = OdometryParams(radius_error=0.0, track_error=0.0, radius_difference=0.01)
    drift = drifts(10.0, 0.0, 1, drive=NO_SLIP, encoder=encoder)[0]
    assert drift[1] == pytest.approx(-10.0 * 0.01 / (0.192 * 1.04), rel=0.02)


def test_slip_spreads_the_way_and_the_turn_as_configured() -> None:
    """Each side's slip is a process of spread `slip` and memory `slip_time`, so the way's error has a known spread."""
    slip, memory, metres, speed, seeds = 0.02, 1.0, 10.0, 0.35, 16
    params = DriveParams(slip=slip, scrub=0.0, slip_time=memory)
    encoder = OdometryParams(radius_error=0.0, track_error=0.0, ticks_per_turn=1e5)
    drift = drifts(metres, 0.0, seeds, drive=params, encoder=encoder)
    seconds = metres / speed
    side = slip * speed * math.sqrt(2.0 * memory * (seconds - memory))  # of one side's way [m]
    tolerance = 4.0 / math.sqrt(2.0 * seeds)
    assert drift[:, 1].std() == pytest.approx(side * math.sqrt(2.0) / (0.192 * 1.04), rel=tolerance)
    assert abs(drift[:, 1].mean()) < 4.0 * drift[:, 1].std() / math.sqrt(seeds)


def test_scrub_spreads_the_turn_as_configured() -> None:
    scrub, memory, turns, rate, seeds = 0.02, 1.0, 10.0, 2.0, 16
    params = DriveParams(slip=0.0, scrub=scrub, slip_time=memory)
    encoder = OdometryParams(radius_error=0.0, track_error=0.0, ticks_per_turn=1e5)
    drift = drifts(0.0, turns, seeds, drive=params, encoder=encoder)
    seconds = turns * math.tau / rate
    spread = scrub * rate * math.sqrt(2.0 * memory * (seconds - memory))
    assert drift[:, 1].std() == pytest.approx(spread, rel=4.0 / math.sqrt(2.0 * seeds))


def test_the_inertial_unit_errs_as_configured() -> None:
    params = ImuParams(gyro_noise=0.01, gyro_bias=0.004, accel_noise=0.05, accel_bias=0.1, heading_noise=0.003)
    engine = engine_in(World(), imu=params, seed=4)
    samples = []
    for _ in range(2000):
        engine.step()
        samples.append(engine.imu())
    engine.close()
    rates, accelerations = np.array([s.rates for s in samples]), np.array([s.accelerations for s in samples])
    headings = np.array([s.yaw for s in samples]) - 0.004 * STEP * np.arange(1, 2001)
    assert rates.std(axis=0) == pytest.approx([0.01] * 3, rel=4.0 / math.sqrt(4000))
    assert rates[:, 2].mean() == pytest.approx(0.004, abs=4.0 * 0.01 / math.sqrt(2000))
    assert accelerations.std(axis=0) == pytest.approx([0.05] * 3, rel=4.0 / math.sqrt(4000))
    assert accelerations.mean(axis=0) == pytest.approx([0.1, 0.1, 9.8], abs=4.0 * 0.05 / math.sqrt(2000))
    assert headings.std() == pytest.approx(0.003, rel=4.0 / math.sqrt(4000))


def test_the_bias_of_the_inertial_unit_wanders_as_configured() -> None:
    wandered = []
    for seed in range(30):
        engine = engine_in(World(), imu=ImuParams(gyro_noise=0.0, gyro_bias=0.0, gyro_walk=0.01), seed=seed)
        for _ in range(round(4.0 / STEP)):
            engine.step()
        wandered.append(engine.imu().rates[2])
        engine.close()
    assert np.std(wandered) == pytest.approx(0.01 * math.sqrt(4.0), rel=4.0 / math.sqrt(60.0))
