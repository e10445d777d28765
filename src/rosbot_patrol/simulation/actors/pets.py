"""Cats and dogs: triangle bodies, warm but no intruders; their standing paws stay in place while they walk.

A pet's frame is on the floor under the middle of its trunk, x forward. Sizes are realistic: the lidar's plane (0.16 m)
cuts the lower trunk of a cat and the legs of most dogs; a range sensor meets the legs.
"""

from __future__ import annotations

import functools
import math

import numpy as np

from rosbot_patrol.simulation.actors.figure import pet as surfaces
from rosbot_patrol.simulation.actors.figure.assembly import Part, assemble
from rosbot_patrol.simulation.actors.figure.surface import skin_of
from rosbot_patrol.simulation.actors.looks import Colour
from rosbot_patrol.simulation.actors.people_meshes import ellipsoid, loft
from rosbot_patrol.simulation.actors.pet_looks import PETS, PetLook, draw_pet, pet_named
from rosbot_patrol.simulation.scene.matrices import Matrix, from_xyz_rpy
from rosbot_patrol.simulation.scene.scene import Body, Collision, Material, Shape, Visual

__all__ = ["LEGS", "PETS", "PetLook", "draw_pet", "legs_at", "paws", "pet_body", "pet_named", "pet_pose_parts"]

LEGS = ("front_left", "front_right", "hind_left", "hind_right")

_BEFORE = {"hind_left": 0.0, "front_left": 0.25, "hind_right": 0.5, "front_right": 0.75}  # paw phases of a walk, cycles
_DUTY = 0.65  # share of a cycle in which a paw stands
_SWAY = 0.55  # share of a step that shoulder and hip move with their leg
_DARK: Colour = (0.04, 0.03, 0.03)


def pet_body(name: str, look: PetLook) -> Body:
    """Make a standing pet at the world's origin; `pet_pose_parts` moves the visuals."""
    visuals = tuple(Visual(shape=part.shape, material=part.material) for part in _parts(look))
    return Body(name=name, kind="pet", static=False, visuals=visuals, collisions=_collisions(look))


def pet_pose_parts(look: PetLook, phase: float = 0.0, gait: float = 0.0) -> Matrix:
    """Poses of the visuals of `pet_body`, body_from_visuals, shape (number of visuals, 4, 4).

    Args:
        look: the look given to `pet_body`.
        phase: cycles walked; only its fraction counts.
        gait: 0 stands, 1 takes full steps.
    """
    frames, rest = _skeleton(look, phase, gait), _rest(look)
    moved = {joint: frames[joint] @ rest[joint] for joint in rest}
    return np.array([moved[part.joint] for part in _parts(look)])


def paws(look: PetLook, phase: float, gait: float) -> dict[str, tuple[float, float, float]]:
    """Positions of the paws in the body frame [m]; a standing paw moves back at the body's speed."""
    return {leg: _paw(look, leg, phase, gait) for leg in LEGS}


def legs_at(look: PetLook, height: float, phase: float, gait: float) -> Matrix:
    """Circles (x, y, radius) of the legs at a height [m], in the body frame, shape (C, 3)."""
    if not 0.0 <= height < _hip_height(look):
        return np.zeros((0, 3))
    share = height / _hip_height(look)
    rows = []
    for leg, (x, y, lift) in paws(look, phase, gait).items():
        if lift <= height:
            rows.append((x + share * (_hip(look, leg)[0] - x), y, look.leg_radius))
    return np.array(rows).reshape(-1, 3)


def _hip_height(look: PetLook) -> float:
    return look.height * (1.0 - 0.75 * look.depth)


def _hip(look: PetLook, leg: str) -> tuple[float, float]:
    x = 0.36 * look.length * look.height
    y = (0.5 * look.width - 0.05) * look.height
    return (x if leg.startswith("front") else -x), (y if leg.endswith("left") else -y)


def _paw(look: PetLook, leg: str, phase: float, gait: float) -> tuple[float, float, float]:
    x, y = _hip(look, leg)
    x += (0.0 if leg.startswith("front") else -0.05) * look.height
    part = (phase + _BEFORE[leg]) % 1.0
    step = gait * _DUTY * look.cycle
    if part < _DUTY:
        return x + step * (0.5 - part / _DUTY), y, 0.0
    swing = (part - _DUTY) / (1.0 - _DUTY)
    eased = swing * swing * (3.0 - 2.0 * swing)
    return x + step * (eased - 0.5), y, gait * 0.10 * look.height * math.sin(math.pi * swing)


def _skeleton(look: PetLook, phase: float, gait: float) -> dict[str, Matrix]:
    """body_from_joint for each joint."""
    h = look.height
    turn = math.tau * phase
    middle = h * (1.0 - 0.5 * look.depth)
    trunk = from_xyz_rpy((0.0, 0.0, middle), (0.0, math.pi / 2.0, 0.0))  # a loft's z is forward, its x is down
    chest = 0.5 * look.length * h
    raised = 1.0 if look.model == "dog" else 1.25
    nod = 0.05 * gait * math.sin(2.0 * turn)
    neck = from_xyz_rpy((0.88 * chest, 0.0, middle + 0.10 * h), (0.0, raised + nod, 0.0))
    head = neck @ from_xyz_rpy((0.0, 0.0, 0.26 * h), (0.0, -raised + 0.12 - 0.8 * nod, 0.0))
    wag = (0.15 + 0.25 * gait) * math.sin(2.0 * turn + 0.6)
    tail = from_xyz_rpy(
        (-0.97 * chest, 0.0, middle + 0.12 * h), (0.0, (-2.3 if look.model == "dog" else -1.2) + 0.5 * gait, wag)
    )
    tip = tail @ from_xyz_rpy((0.0, 0.0, 0.30 * h), (0.0, 0.45, wag))
    frames = {"trunk": trunk, "neck": neck, "head": head, "tail": tail, "tip": tip}
    for leg in LEGS:
        frames.update(_leg(look, leg, _paw(look, leg, phase, gait)))
    return frames


def _hock(look: PetLook, leg: str) -> tuple[float, float]:
    """Place of a hind leg's heel, or a front leg's wrist, relative to the paw [m]: forward, and above the floor."""
    return (-0.07 * look.height, 0.26 * look.height) if leg.startswith("hind") else (0.0, 0.14 * look.height)


def _bones(look: PetLook, leg: str) -> tuple[float, float]:
    """Lengths of both bones from the hip to the hock [m], just enough for a full step."""
    before, above = _hock(look, leg)
    step = (1.0 - _SWAY) * 0.5 * _DUTY * look.cycle + (0.05 * look.height - before if leg.startswith("hind") else 0.0)
    half = 0.51 * math.hypot(_hip_height(look) - above, step)
    return half, half


def _leg(look: PetLook, leg: str, paw: tuple[float, float, float]) -> dict[str, Matrix]:
    """Two bones from the hip to the hock, and one to the paw's ankle; elbows bend backwards, knees forwards."""
    upper, lower = _bones(look, leg)
    x, y = _hip(look, leg)
    x += _SWAY * (paw[0] - _paw(look, leg, 0.0, 0.0)[0])
    before, above = _hock(look, leg)
    hock_x, hock_z = paw[0] + before, paw[2] + above
    dx, dz = hock_x - x, _hip_height(look) - hock_z
    gap = min(math.hypot(dx, dz), 0.999 * (upper + lower))
    bend = math.acos(min(max((upper**2 + gap**2 - lower**2) / (2.0 * upper * gap), -1.0), 1.0))
    swing = math.atan2(dx, dz) + (-bend if leg.startswith("front") else bend)
    knee_x, knee_z = x + upper * math.sin(swing), _hip_height(look) - upper * math.cos(swing)
    back = math.atan2(hock_x - knee_x, knee_z - hock_z)
    ankle_z = paw[2] + 0.05 * look.height
    tilt = math.atan2(paw[0] - hock_x, hock_z - ankle_z)
    return {
        f"{leg}_upper": from_xyz_rpy((x, y, _hip_height(look)), (0.0, -swing, 0.0)),
        f"{leg}_lower": from_xyz_rpy((knee_x, y, knee_z), (0.0, -back, 0.0)),
        f"{leg}_hock": from_xyz_rpy((hock_x, y, hock_z), (0.0, -tilt, 0.0)),
        f"{leg}_paw": from_xyz_rpy((paw[0], y, ankle_z)),
    }


@functools.lru_cache(maxsize=64)
def _rest(look: PetLook) -> dict[str, Matrix]:
    """joint_from_body of the standing pet for each joint."""
    return {joint: np.linalg.inv(frame) for joint, frame in _skeleton(look, 0.0, 0.0).items()}


@functools.lru_cache(maxsize=64)
def _parts(look: PetLook) -> tuple[Part, ...]:
    """Joint, shape and material of each visual."""
    rest = _skeleton(look, 0.0, 0.0)
    fur = Material(rgba=(1.0, 1.0, 1.0, 1.0), texture="fur")
    skins = [surfaces.trunk(look), surfaces.neck(look, rest["neck"]), surfaces.head(look, rest["head"])]
    skins += surfaces.tail(look, rest["tail"], rest["tip"])
    parts = [(s, fur) for s in skins]
    parts += [
        (skin_of(shape, "head", rest["head"]), Material(rgba=(*colour, 1.0))) for shape, colour in _features(look)
    ]
    for leg in LEGS:
        places = {part: rest[f"{leg}_{part}"][:3, 3] for part in ("upper", "lower", "hock", "paw")}
        parts += [(s, fur) for s in surfaces.leg(look, leg, places)]
    return assemble(parts)


def _features(look: PetLook) -> list[tuple[Shape, Colour]]:
    """Ears, eyes and nose in the head's frame, with their colours."""
    h, long = look.height, look.muzzle * look.height
    r = (0.17 if look.model == "dog" else 0.20) * h
    wide = 0.8 * r
    ears = []
    for side in (1.0, -1.0):
        if look.ears == "pricked":
            at = -0.2 * r
            tall, broad = (0.85, 1.25) if look.model == "cat" else (1.0, 1.0)
            shape = loft(
                [
                    (1.75 * tall * r, 0.04 * r, 0.06 * r, at),
                    (1.2 * tall * r, 0.12 * r, 0.22 * broad * r, at),
                    (0.6 * r, 0.2 * r, 0.34 * broad * r, at),
                ],
                y=side * 0.55 * r,
            )
        else:
            shape = ellipsoid(0.32 * r, 0.10 * r, 0.75 * r, at=(-0.15 * r, side * 1.02 * wide, 0.05 * r))
        ears.append((shape, _darker(look.fur, 0.75)))
    eye = 0.12 * r
    eyes = [
        (ellipsoid(eye, eye, eye, at=(0.70 * r, side * 0.42 * r, 0.28 * r), rings=5), _DARK) for side in (1.0, -1.0)
    ]
    tip = 0.7 * r + long
    nose = ellipsoid(0.12 * r, 0.16 * r, 0.12 * r, at=(tip + 0.02 * r, 0.0, -0.12 * r), rings=5)
    return [(nose, _DARK), *ears, *eyes]


def _darker(colour: Colour, share: float) -> Colour:
    return (share * colour[0], share * colour[1], share * colour[2])


def _collisions(look: PetLook) -> tuple[Collision, ...]:
    """Collision shapes of trunk and head, then of the straight legs."""
    h = look.height
    radius = 0.25 * (look.depth + look.width) * h
    along = max(look.length * h - 2.0 * radius, 0.01)
    middle = h * (1.0 - 0.5 * look.depth)
    lying = from_xyz_rpy((0.0, 0.0, middle), (0.0, math.pi / 2.0, 0.0))
    head = _skeleton(look, 0.0, 0.0)["head"]
    solid = [
        Collision(shape=Shape(kind="capsule", size=(radius, along)), pose=lying),
        Collision(shape=Shape(kind="sphere", size=(0.17 * h,)), pose=from_xyz_rpy(head[:3, 3].tolist())),
    ]
    r, length = look.leg_radius, _hip_height(look)
    for leg in LEGS:
        upright = Shape(kind="capsule", size=(r, length - 2.0 * r))
        solid.append(Collision(shape=upright, pose=from_xyz_rpy((*_hip(look, leg), length / 2.0))))
    return tuple(solid)
