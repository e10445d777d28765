from __future__ import annotations

import numpy as np
import pytest

from rosbot_patrol.errors import WorldError
from rosbot_patrol.simulation.actors.looks import LOOKS, RESERVED_HEIGHTS, Look, draw_look, is_reserved, look_named
from rosbot_patrol.simulation.actors.people import (
    POSTURES,
    RESERVED_POSTURES,
    hydrant_body,
    person_body,
    person_pose_parts,
)
from rosbot_patrol.simulation.scene.scene import Body


def points(body: Body, parts: np.ndarray) -> np.ndarray:
    placed = []
    for visual, pose in zip(body.visuals, parts, strict=True):
        assert visual.shape.vertices is not None
        placed.append(visual.shape.vertices @ pose[:3, :3].T + pose[:3, 3])
    return np.vstack(placed)


@pytest.mark.parametrize("name", sorted(LOOKS))
@pytest.mark.parametrize(("walking", "phase"), [(False, 0.0), (True, 0.1), (True, 0.6)])
def test_a_person_stands_on_the_floor_and_is_as_tall_as_said(name: str, walking: bool, phase: float) -> None:
    look = look_named(name)
    spread = points(person_body("p", look), person_pose_parts(look, phase, walking))
    assert spread[:, 2].min() == pytest.approx(0.0, abs=0.03)
    assert spread[:, 2].max() == pytest.approx(look.height, abs=0.08)
    assert np.ptp(spread[:, 1]) < 0.8


@pytest.mark.parametrize("posture", [*POSTURES, *RESERVED_POSTURES])
def test_each_posture_gives_a_pose_for_each_visual(posture: str) -> None:
    look = Look(backpack=(0.1, 0.1, 0.1), coat=True, hair_style="cap", legs="skirt")
    body = person_body("p", look)
    for phase in np.linspace(0, 2, 9):
        parts = person_pose_parts(look, float(phase), posture=posture)
        assert parts.shape == (len(body.visuals), 4, 4)
        rotations = parts[:, :3, :3]
        assert np.allclose(rotations @ rotations.transpose(0, 2, 1), np.eye(3), atol=1e-9)
        assert points(body, parts)[:, 2].min() > -0.03


def test_who_sits_or_crouches_is_lower() -> None:
    look = Look()
    body = person_body("p", look)
    heights = {p: points(body, person_pose_parts(look, posture=p))[:, 2].max() for p in POSTURES}
    assert heights["crouching"] < heights["sitting"] < heights["standing"]


@pytest.mark.parametrize("detailed", [False, True])
def test_legs_swing_against_each_other_and_repeat(detailed: bool) -> None:
    look = Look(detailed=detailed)
    assert np.allclose(person_pose_parts(look, 0.3, True), person_pose_parts(look, 1.3, True))
    spread = points(person_body("p", look), person_pose_parts(look, 0.25, True))
    low = spread[spread[:, 2] < 0.3]
    left, right = low[low[:, 1] > 0.03], low[low[:, 1] < -0.03]
    assert left[:, 0].mean() > 0.1 > -0.05 > right[:, 0].mean()


def test_a_laser_near_the_floor_meets_two_legs() -> None:
    body = person_body("p", Look())
    low = []
    for collision in body.collisions:
        radius, length = collision.shape.size
        if collision.pose[2, 3] - length / 2 - radius < 0.16:
            low.append(collision.pose[1, 3])
    assert len(low) == 2
    assert low[0] == -low[1]
    top = max(c.pose[2, 3] + c.shape.size[1] / 2 + c.shape.size[0] for c in body.collisions)
    assert top == pytest.approx(1.75, abs=0.02)


def test_looks_by_chance_are_never_reserved_ones() -> None:
    rng = np.random.default_rng(0)
    looks = [draw_look(rng) for _ in range(3000)]
    assert not any(is_reserved(look) for look in looks)
    assert min(look.height for look in looks) < 1.55
    assert max(look.height for look in looks) > 1.9
    assert not any(RESERVED_HEIGHTS[0] <= look.height <= RESERVED_HEIGHTS[1] for look in looks)
    assert len({look.hair_style for look in looks}) == 6


def test_test_intruders_are_reserved_and_the_other_named_looks_are_not() -> None:
    for name, look in LOOKS.items():
        assert is_reserved(look) == name.startswith("intruder_test_"), name
    assert not set(POSTURES) & set(RESERVED_POSTURES)


def test_looks_repeat_with_the_seed() -> None:
    assert draw_look(np.random.default_rng(4)) == draw_look(np.random.default_rng(4))


def test_an_unknown_look_names_those_that_there_are() -> None:
    with pytest.raises(WorldError, match=r"ghost: is no look of a person; known are visitor, burglar"):
        look_named("ghost")


def test_a_hydrant_is_as_high_as_said_and_has_something_to_bump_into() -> None:
    body = hydrant_body("h", height=0.9)
    assert body.kind == "fire_hydrant"
    assert body.collisions[0].shape.size[1] == 0.9
    tops = [
        v.pose[2, 3] + (v.shape.size[1] / 2 if v.shape.kind == "cylinder" else v.shape.size[0]) for v in body.visuals
    ]
    assert max(tops) == pytest.approx(0.9, abs=0.02)


def limb(look: Look, phase: float, side: float, below: float) -> float:
    """How far forward the middle of the foot (below 0.2 m) or hand (above) of a side (1 left, -1 right) is."""
    places = []
    for visual, pose in zip(person_body("p", look).visuals, person_pose_parts(look, phase, True), strict=True):
        assert visual.shape.vertices is not None
        places.append((visual.shape.vertices @ pose[:3, :3].T + pose[:3, 3]).mean(axis=0))
    sided = [p for p in places if side * p[1] > (0.03 if below < 0.2 else 0.2) and (p[2] < 0.2) == (below < 0.2)]
    return float(min(sided, key=lambda p: p[2])[0])


@pytest.mark.parametrize("name", ["visitor", "woman", "jogger"])
def test_feet_swing_against_each_other_and_arms_against_the_feet(name: str) -> None:
    look = look_named(name)
    for phase in (0.25, 0.75):
        left, right = limb(look, phase, 1.0, 0.1), limb(look, phase, -1.0, 0.1)
        hand_left, hand_right = limb(look, phase, 1.0, 0.9), limb(look, phase, -1.0, 0.9)
        assert (left - right) * (hand_left - hand_right) < -0.05
        assert (left - right) * (1.0 if phase < 0.5 else -1.0) > 0.3
    step = limb(look, 0.25, 1.0, 0.1) - limb(look, 0.75, 1.0, 0.1)
    assert step == pytest.approx(0.65, abs=0.2)  # half the cycle of 1.3 m that the walker counts
