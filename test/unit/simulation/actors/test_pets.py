"""Cats and dogs: their size, their gait, and who notices them."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from rosbot_patrol.geometry import Pose2D, Twist2D
from rosbot_patrol.simulation.actors.pets import PETS, PetLook, draw_pet, legs_at, paws, pet_body, pet_pose_parts
from rosbot_patrol.simulation.actors.walkers import Walker
from rosbot_patrol.simulation.engine import STEP
from rosbot_patrol.simulation.sensors.motion_sensors import SensorPlace

ROOT = Path(__file__).parents[4]
ALL = [look for looks in PETS.values() for look in looks.values()]
LIDAR = 0.158  # height of its plane [m]


def corners(look: PetLook, phase: float, gait: float) -> list[np.ndarray]:
    """Corners of each visual in the frame of the body."""
    parts = pet_pose_parts(look, phase, gait)
    return [
        visual.shape.vertices @ pose[:3, :3].T + pose[:3, 3]
        for visual, pose in zip(pet_body("p", look).visuals, parts, strict=True)
    ]


@pytest.mark.parametrize("look", ALL, ids=lambda look: look.name)
@pytest.mark.parametrize(("phase", "gait"), [(0.0, 0.0), (0.1, 1.0), (0.35, 1.0), (0.8, 0.5)])
def test_a_pet_stands_on_its_paws_at_its_height(look: PetLook, phase: float, gait: float) -> None:
    spread = corners(look, phase, gait)
    lowest = sorted(float(part[:, 2].min()) for part in spread)
    assert lowest[0] == pytest.approx(0.0, abs=0.01)
    assert lowest[1] < 0.01  # on two paws at least
    assert spread[0][:, 2].max() == pytest.approx(look.height, abs=0.05 * look.height)
    every = np.vstack(spread)
    assert every[:, 2].max() < 1.6 * look.height
    assert np.ptp(every[:, 1]) < 0.6 * look.height
    assert np.ptp(every[:, 0]) < 2.8 * look.height


@pytest.mark.parametrize("look", ALL, ids=lambda look: look.name)
def test_parts_of_a_leg_stay_together(look: PetLook) -> None:
    for phase in np.linspace(0.0, 1.0, 25):
        spread = corners(look, float(phase), 1.0)
        for leg in range(4):
            upper, lower, hock, paw = spread[-16:][4 * leg : 4 * leg + 4]
            for a, b in ((upper, lower), (lower, hock), (hock, paw)):
                gap = np.linalg.norm(a[:, None] - b[None], axis=2).min()
                assert gap < 0.035 * look.height


@pytest.mark.parametrize("look", ALL, ids=lambda look: look.name)
def test_a_paw_that_stands_does_not_slip(look: PetLook) -> None:
    phases = np.arange(0.0, 1.0, 0.01)
    standing = 0
    for leg in paws(look, 0.0, 1.0):
        track = np.array([paws(look, float(p), 1.0)[leg] for p in phases])
        on_floor = track[:, 2] == 0.0
        both = on_floor[1:] & on_floor[:-1]
        world_x = track[:, 0] + phases * look.cycle
        assert np.abs(np.diff(world_x)[both]).max() < 1e-9
        standing += int(on_floor.sum())
        assert 0.05 < track[:, 2].max() / look.height < 0.15
    assert standing / len(phases) == pytest.approx(4 * 0.65, abs=0.1)


def test_legs_move_with_the_way_walked() -> None:
    dog = Walker("d", "dog", "labrador", Pose2D(), np.random.default_rng(0))
    still = dog.pose_parts()
    assert not dog.step(STEP, None)
    assert np.array_equal(dog.pose_parts(), still)
    dog.walk([Pose2D(5.0, 0.0)], 1.0)
    for _ in range(200):
        dog.step(STEP, None)
    assert not np.allclose(dog.pose_parts(), still, atol=0.02)


def test_a_plane_at_the_lidar_s_height_meets_a_cat_s_trunk_and_a_dog_s_legs() -> None:
    cat = Walker("c", "cat", "tabby", Pose2D(1.0, 2.0, 0.5), np.random.default_rng(0))
    dog = Walker("d", "dog", "shepherd", Pose2D(), np.random.default_rng(0))
    trunk, legs = cat.cut(LIDAR), dog.cut(LIDAR)
    assert len(trunk.segments)
    ends = trunk.segments.reshape(-1, 2) - (1.0, 2.0)
    along = ends @ (math.cos(0.5), math.sin(0.5))
    assert np.ptp(along) == pytest.approx(0.325, abs=0.05)
    assert not len(legs.segments)
    assert len(legs.circles) == 4
    assert np.ptp(legs.circles[:, 1]) == pytest.approx(0.16, abs=0.03)
    assert not len(cat.cut(0.4).circles)
    assert not len(cat.cut(0.4).segments)


def test_legs_of_the_cut_are_where_the_camera_shows_them() -> None:
    look = PETS["dog"]["labrador"]
    for phase in (0.0, 0.3, 0.7):
        for row in legs_at(look, LIDAR, phase, 1.0):
            points = np.vstack(corners(look, phase, 1.0)[-16:])
            level = points[np.abs(points[:, 2] - LIDAR) < 0.06]
            assert np.hypot(level[:, 0] - row[0], level[:, 1] - row[1]).min() < 0.08


def test_furs_are_drawn_from_the_seed() -> None:
    drawn = {draw_pet("cat", np.random.default_rng(i)).name for i in range(40)}
    assert drawn == set(PETS["cat"])
    assert draw_pet("dog", np.random.default_rng(3)) == draw_pet("dog", np.random.default_rng(3))


@pytest.mark.parametrize("model", ["cat", "dog"])
def test_the_robot_meets_a_pet_by_lidar_range_and_bumper(build, model: str) -> None:
    engine = build()
    engine.population.spawn_actor("pet", model, "", Pose2D(0.8, 0.0, math.pi))  # across, the robot fits under a dog
    hits = engine.scan().ranges[engine.scan().is_hit]
    assert hits.min() == pytest.approx(0.6, abs=0.2)
    for _ in range(round(4.0 / STEP)):
        engine.command(Twist2D(0.3, 0.0, 0.0))
        engine.step()
    assert {(t.other, t.kind) for t in engine.touches()} == {("pet", "pet")}
    assert engine.pose.x < 0.6


@pytest.mark.parametrize(("model", "far", "seen"), [("dog", 4.0, True), ("dog", 6.5, False), ("cat", 2.5, True),
                                                    ("cat", 4.5, False), ("person", 6.5, True)])  # fmt: skip
def test_a_motion_sensor_notices_pets_nearer_than_people(build, model: str, far: float, seen: bool) -> None:
    engine = build(sensors=(SensorPlace(id=3, room=3, x=0.0, y=0.0, yaw=0.0),))
    engine.carry(Pose2D(-3.0, 0.0, 0.0))
    engine.population.spawn_actor("it", model, "", Pose2D(far, -0.8, math.pi / 2.0))
    engine.population.move_actor("it", [Pose2D(far, 0.8, 0.0)], 1.0)
    fired = False
    for _ in range(round(3.0 / STEP)):
        engine.step()
        fired = fired or engine.motion_sensors.levels(engine.now)[3]
    assert fired == seen
