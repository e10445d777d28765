"""How actors walk."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rosbot_patrol.errors import WorldError
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.simulation.actors.walkers import Walker

DT = 0.005


def person() -> Walker:
    return Walker("joe", "person", "visitor", Pose2D(), np.random.default_rng(0))


def walk(walker: Walker, seconds: float, robot: Pose2D | None = None) -> None:
    for _ in range(round(seconds / DT)):
        walker.step(DT, robot)


def test_walks_at_its_speed_and_turns_to_where_it_goes() -> None:
    joe = person()
    joe.walk([Pose2D(4.0, 0.0, 0.0)], 1.0)
    walk(joe, 2.0)
    assert joe.pose == pytest.approx((2.0 - 0.5 / 1.2, 0.0, 0.0), abs=0.02)  # it gathers speed with 1.2 m/s2
    assert joe.is_walking
    assert joe.speed == pytest.approx(1.0)
    walk(joe, 4.0)
    assert joe.pose[:2] == pytest.approx((4.0, 0.0), abs=0.06)
    assert not joe.is_walking


def test_turns_before_it_walks_back_and_ends_as_told() -> None:
    joe = person()
    joe.walk([Pose2D(-1.0, 0.0, 1.0)], 1.0)
    walk(joe, 0.3)
    assert abs(joe.pose.x) < 0.01
    walk(joe, 4.0)
    assert joe.pose == pytest.approx((-1.0, 0.0, 1.0), abs=0.06)


def test_goes_round_for_ever_when_told_to_loop() -> None:
    joe = person()
    joe.walk([Pose2D(1.0, 0.0), Pose2D(0.0, 0.0)], 1.0, loop=True)
    seen = set()
    for _ in range(12):
        walk(joe, 1.0)
        seen.add(round(joe.pose.x, 1))
    assert len(seen) > 2
    assert all(-0.1 <= x <= 1.1 for x in seen)


def test_speed_zero_and_one_point_put_it_there() -> None:
    joe = person()
    joe.walk([Pose2D(3.0, 2.0, 1.0)], 0.0)
    assert joe.pose == Pose2D(3.0, 2.0, 1.0)
    assert not joe.step(DT, None)


def test_waits_before_the_robot_and_goes_on_when_it_has_gone() -> None:
    joe = person()
    joe.walk([Pose2D(3.0, 0.0)], 1.0)
    walk(joe, 4.0, robot=Pose2D(1.5, 0.0))
    assert joe.pose.x == pytest.approx(1.08, abs=0.02)
    assert not joe.is_walking
    walk(joe, 3.0)
    assert joe.pose.x > 2.9


def test_legs_swing_while_walking_and_the_hydrant_stands() -> None:
    joe = person()
    still = joe.cut(0.16).circles
    assert len(still) == 2
    joe.walk([Pose2D(9.0, 0.0)], 1.0)
    widest = 0.0
    for _ in range(400):
        joe.step(DT, None)
        feet = joe.cut(0.16).circles
        widest = max(widest, abs(feet[0, 0] - feet[1, 0]))
    assert 0.3 < widest < 0.6
    hydrant = Walker("h", "fire_hydrant", "", Pose2D(1.0, 1.0, 0.0), np.random.default_rng(0))
    assert hydrant.cut(0.16).circles == pytest.approx(np.array([[1.0, 1.0, 0.14]]))
    assert not hydrant.is_warm
    assert hydrant.pose_parts() is None


@pytest.mark.parametrize("speed", [math.nan, math.inf])
def test_numbers_that_are_not_finite_are_refused(speed: float) -> None:
    with pytest.raises(Exception, match="finite"):
        person().walk([Pose2D(1.0, 0.0)], speed)


def test_a_posture_is_held_and_an_unknown_one_is_told() -> None:
    def figure(posture: str) -> np.ndarray | None:
        return Walker("w", "person", "burglar", Pose2D(), np.random.default_rng(1), posture=posture).pose_parts()

    assert not np.allclose(figure("creeping"), figure(""))
    assert np.allclose(figure("standing"), figure(""))
    with pytest.raises(WorldError, match="cannot be 'flying', expected one of standing, sitting"):
        figure("flying")


def test_a_person_gathers_and_loses_speed_as_legs_can() -> None:
    joe = person()
    joe.walk([Pose2D(3.0, 0.0)], 1.4)
    speeds = [0.0]
    while joe.pose.x < 2.949:
        joe.step(DT, None)
        speeds.append(joe.speed)
    changes = np.diff(speeds) / DT
    assert max(speeds) == pytest.approx(1.4)
    assert changes.max() == pytest.approx(1.2, abs=0.01)
    assert -2.1 < changes.min() < -1.5
    assert speeds[-1] < 0.2
    assert len(speeds) * DT < 5.0


def test_a_sharp_corner_is_turned_standing_and_a_slight_one_walking() -> None:
    def slowest_after_a_metre(corner: Pose2D) -> float:
        joe = person()
        joe.walk([Pose2D(2.0, 0.0), corner], 1.0)
        slowest = 1.0
        while abs(joe.pose.x - 2.0) < 1.0 or joe.pose.x < 2.0:
            joe.step(DT, None)
            slowest = min(slowest, joe.speed) if joe.pose.x > 1.0 else slowest
        return slowest

    assert slowest_after_a_metre(Pose2D(5.0, 1.0)) > 0.8
    joe = person()
    joe.walk([Pose2D(2.0, 0.0), Pose2D(-1.0, 0.0)], 1.0)
    speeds, farthest = [], 0.0
    for _ in range(round(5.0 / DT)):
        joe.step(DT, None)
        speeds.append(joe.speed)
        farthest = max(farthest, joe.pose.x)
    assert min(speeds[200:]) == 0.0
    assert farthest < 2.0


def test_pauses_at_each_point_when_told_to() -> None:
    joe = person()
    joe.walk([Pose2D(1.0, 0.0), Pose2D(2.0, 0.0)], 1.0, loop=True, pause=3.0)
    stood = {1: 0.0, 2: 0.0}
    for _ in range(round(9.0 / DT)):
        if not joe.step(DT, None) and not joe.is_walking and joe.pose.x > 0.5:
            stood[round(joe.pose.x)] += DT
    assert stood[1] == pytest.approx(3.0, abs=0.1)
    assert stood[2] > 2.0


def test_limbs_follow_the_way_walked_not_the_time() -> None:
    def parts_after(speed: float) -> np.ndarray | None:
        joe = person()
        joe.walk([Pose2D(9.0, 0.0)], speed)
        while joe.pose.x < 2.6:
            joe.step(DT, None)
        return joe.pose_parts()

    assert parts_after(0.4) == pytest.approx(parts_after(1.2), abs=0.03)


@pytest.mark.parametrize("model", ["cat", "dog"])
def test_a_pet_walks_is_warm_and_does_not_sit(model: str) -> None:
    pet = Walker("p", model, "", Pose2D(), np.random.default_rng(2))
    assert pet.look_name
    assert 0.0 < pet.warmth < 1.0
    assert pet.body.kind == "pet"
    pet.walk([Pose2D(2.0, 0.0)], 0.8)
    walk(pet, 6.0)
    assert pet.pose.x == pytest.approx(2.0, abs=0.06)
    with pytest.raises(WorldError, match="only stands and walks"):
        Walker("p", model, "", Pose2D(), np.random.default_rng(2), posture="sitting")
    with pytest.raises(WorldError, match=f"goat: is no look of a {model}; known are"):
        Walker("p", model, "goat", Pose2D(), np.random.default_rng(2))


def roamer(seed: int, is_free) -> Walker:
    cat = Walker("tom", "cat", "tabby", Pose2D(1.0, 1.0), np.random.default_rng(0))
    cat.roam(1.5, 0.6, np.random.default_rng(seed), is_free, pause=0.5)
    return cat


def test_one_who_roams_stays_in_its_circle_and_repeats_with_the_seed() -> None:
    def track(seed: int) -> list[Pose2D]:
        cat = roamer(seed, lambda a, b: True)
        poses = []
        for _ in range(round(30.0 / DT)):
            cat.step(DT, None)
            poses.append(cat.pose)
        return poses

    first = track(1)
    away = [math.hypot(p.x - 1.0, p.y - 1.0) for p in first]
    assert 0.7 < max(away) <= 1.5
    assert first == track(1)
    assert first != track(2)


def test_one_who_roams_asks_for_free_ways_and_waits_where_there_is_none() -> None:
    asked = []

    def never(start: Pose2D, goal: Pose2D) -> bool:
        asked.append((start, goal))
        return False

    cat = roamer(1, never)
    walk(cat, 2.5)
    assert cat.pose == Pose2D(1.0, 1.0)
    assert 24 <= len(asked) <= 36


@pytest.mark.parametrize(
    ("speed", "pause", "words"), [(9.0, 0.0, "cannot run at 9.0 m/s"), (1.0, -1.0, "cannot pause for -1.0 s")]
)
def test_walks_that_cannot_be(speed: float, pause: float, words: str) -> None:
    with pytest.raises(WorldError, match=words):
        person().walk([Pose2D(1.0, 0.0)], speed, pause=pause)
    with pytest.raises(WorldError, match=words):
        person().roam(1.0, speed, np.random.default_rng(0), lambda a, b: True, pause=pause)
    with pytest.raises(WorldError, match="cannot wander within 0 m"):
        person().roam(0, 1.0, np.random.default_rng(0), lambda a, b: True)
