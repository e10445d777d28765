"""Cats and dogs: triangle bodies, warm but no intruders; their standing paws stay in place while they walk.

A pet's frame is on the floor under the middle of its trunk, x forward. Sizes are realistic: the lidar's plane (0.16 m)
cuts the lower trunk of a cat and the legs of most dogs; a range sensor meets the legs.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass

import numpy as np

from rosbot_patrol.errors import WorldError
from rosbot_patrol.simulation.actors.looks import Colour
from rosbot_patrol.simulation.actors.people_meshes import Section, ellipsoid, loft
from rosbot_patrol.simulation.scene.matrices import Matrix, from_xyz_rpy
from rosbot_patrol.simulation.scene.scene import Body, Collision, Material, Shape, Visual

LEGS = ("front_left", "front_right", "hind_left", "hind_right")

_BEFORE = {"hind_left": 0.0, "front_left": 0.25, "hind_right": 0.5, "front_right": 0.75}  # paw phases of a walk, cycles
_DUTY = 0.65  # share of a cycle in which a paw stands
_DARK: Colour = (0.04, 0.03, 0.03)


@dataclass(frozen=True, kw_only=True)
class PetLook:
    """The appearance of a pet.

    Attributes:
        height: at the shoulder [m]; length: of the trunk, in heights; depth, width: of the trunk, in heights.
        fur, belly: colours of back and legs, and of chest, muzzle, paws and the tail's tip.
        ears: pricked or hanging; muzzle: length, in heights.
    """

    name: str
    model: str
    height: float
    length: float = 1.0
    depth: float = 0.46
    width: float = 0.36
    fur: Colour = (0.4, 0.3, 0.2)
    belly: Colour = (0.8, 0.75, 0.7)
    ears: str = "hanging"
    muzzle: float = 0.20

    @property
    def leg_radius(self) -> float:
        """Radius of a leg at the lidar's height [m]."""
        return 0.062 * self.height

    @property
    def cycle(self) -> float:
        """Distance walked while each leg takes one step [m]."""
        return 0.75 * self.height


def _cat(name: str, fur: Colour, belly: Colour) -> PetLook:
    return PetLook(
        name=name, model="cat", height=0.25, length=1.30, depth=0.54, width=0.46, fur=fur, belly=belly,
        ears="pricked", muzzle=0.08,
    )  # fmt: skip


PETS: dict[str, dict[str, PetLook]] = {
    "cat": {
        pet.name: pet
        for pet in (
            _cat("tabby", (0.55, 0.47, 0.38), (0.80, 0.74, 0.65)),
            _cat("black", (0.07, 0.07, 0.08), (0.09, 0.09, 0.10)),
            _cat("ginger", (0.80, 0.45, 0.18), (0.92, 0.80, 0.66)),
            _cat("white", (0.90, 0.89, 0.86), (0.95, 0.94, 0.92)),
        )
    },
    "dog": {
        pet.name: pet
        for pet in (
            PetLook(name="labrador", model="dog", height=0.56, fur=(0.83, 0.68, 0.44), belly=(0.88, 0.77, 0.58)),
            PetLook(
                name="shepherd", model="dog", height=0.62, length=1.1, fur=(0.26, 0.18, 0.12), belly=(0.62, 0.43, 0.25),
                ears="pricked", muzzle=0.24,
            ),
            PetLook(name="terrier", model="dog", height=0.34, fur=(0.93, 0.91, 0.87), belly=(0.50, 0.30, 0.16)),
            PetLook(name="spaniel", model="dog", height=0.40, fur=(0.38, 0.16, 0.08), belly=(0.45, 0.22, 0.12)),
        )
    },
}  # fmt: skip


def pet_named(model: str, name: str) -> PetLook:
    """Find a pet's look by its name.

    Raises:
        WorldError: there is no such look; the text lists the existing ones.
    """
    if name not in PETS[model]:
        raise WorldError(name, f"is no look of a {model}; known are {', '.join(PETS[model])}")
    return PETS[model][name]


def draw_pet(model: str, rng: np.random.Generator) -> PetLook:
    """Draw a random look of a cat or a dog."""
    known = list(PETS[model].values())
    return known[int(rng.integers(len(known)))]


def pet_body(name: str, look: PetLook) -> Body:
    """Make a standing pet at the world's origin; `pet_pose_parts` moves the visuals."""
    visuals = tuple(
        Visual(shape=shape, pose=pose, material=Material(rgba=(*colour, 1.0)))
        for (_, shape, colour), pose in zip(_figure(look), pet_pose_parts(look), strict=True)
    )
    return Body(name=name, kind="pet", static=False, visuals=visuals, collisions=_collisions(look))


def pet_pose_parts(look: PetLook, phase: float = 0.0, gait: float = 0.0) -> Matrix:
    """Poses of the visuals of `pet_body`, body_from_visuals, shape (number of visuals, 4, 4).

    Args:
        look: the look given to `pet_body`.
        phase: cycles walked; only its fraction counts.
        gait: 0 stands, 1 takes full steps.
    """
    frames = _skeleton(look, phase, gait)
    return np.array([frames[joint] for joint in _joints(look)])


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
    raised = 0.5 if look.model == "dog" else 0.95
    nod = 0.05 * gait * math.sin(2.0 * turn)
    neck = from_xyz_rpy((0.88 * chest, 0.0, middle + 0.10 * h), (0.0, raised + nod, 0.0))
    head = neck @ from_xyz_rpy((0.0, 0.0, 0.28 * h), (0.0, -raised - 0.8 * nod, 0.0))
    wag = (0.15 + 0.25 * gait) * math.sin(2.0 * turn + 0.6)
    tail = from_xyz_rpy((-0.97 * chest, 0.0, middle + 0.12 * h), (0.0, -0.9 - 0.2 * gait, wag))
    tip = tail @ from_xyz_rpy((0.0, 0.0, 0.30 * h), (0.0, 0.35, wag))
    frames = {"trunk": trunk, "neck": neck, "head": head, "tail": tail, "tip": tip}
    for leg in LEGS:
        frames.update(_leg(look, leg, _paw(look, leg, phase, gait)))
    return frames


def _bones(look: PetLook) -> tuple[float, float]:
    reach = _hip_height(look) - 0.05 * look.height
    half = 0.51 * math.hypot(reach, 0.5 * _DUTY * look.cycle + 0.05 * look.height)  # just long enough for a full step
    return half, half


def _leg(look: PetLook, leg: str, paw: tuple[float, float, float]) -> dict[str, Matrix]:
    """Two bones from the hip to the paw's ankle; elbows bend backwards, knees forwards."""
    upper, lower = _bones(look)
    x, y = _hip(look, leg)
    ankle_x, ankle_z = paw[0], paw[2] + 0.05 * look.height
    dx, dz = ankle_x - x, _hip_height(look) - ankle_z
    gap = min(math.hypot(dx, dz), 0.999 * (upper + lower))
    bend = math.acos(min(max((upper**2 + gap**2 - lower**2) / (2.0 * upper * gap), -1.0), 1.0))
    swing = math.atan2(dx, dz) + (-bend if leg.startswith("front") else bend)
    knee_x, knee_z = x + upper * math.sin(swing), _hip_height(look) - upper * math.cos(swing)
    back = math.atan2(ankle_x - knee_x, knee_z - ankle_z)
    return {
        f"{leg}_upper": from_xyz_rpy((x, y, _hip_height(look)), (0.0, -swing, 0.0)),
        f"{leg}_lower": from_xyz_rpy((knee_x, y, knee_z), (0.0, -back, 0.0)),
        f"{leg}_paw": from_xyz_rpy((ankle_x, y, ankle_z)),
    }


@functools.lru_cache(maxsize=64)
def _figure(look: PetLook) -> tuple[tuple[str, Shape, Colour], ...]:
    """(joint, shape, colour) of each visual."""
    h, fur, belly = look.height, look.fur, look.belly
    parts = [
        ("trunk", _trunk(look), fur),
        ("neck", loft([(0.32 * h, 0.11 * h, 0.10 * h, 0.0), (-0.12 * h, 0.19 * h, 0.15 * h, 0.0)]), fur),
        *_head(look),
        ("tail", loft(_taper(0.32 * h, 0.040 * h, 0.032 * h)), fur),
        ("tip", loft(_taper(0.28 * h, 0.032 * h, 0.014 * h)), belly if look.model == "dog" else fur),
    ]
    upper, lower = _bones(look)
    r = look.leg_radius
    for leg in LEGS:
        thick = 1.9 if leg.startswith("hind") else 1.5
        thigh = loft(
            [(0.05 * h, 0.9 * thick * r, 0.9 * r, 0), (-0.3 * upper, thick * r, r, 0), (-upper, r, 0.8 * r, 0)]
        )
        shin = loft([(0.01 * h, r, 0.8 * r, 0), (-0.5 * lower, 0.75 * r, 0.65 * r, 0), (-lower, 0.7 * r, 0.7 * r, 0)])
        paw = loft([(0.0, 0.75 * r, 0.7 * r, 0), (-0.025 * h, 1.2 * r, r, 0.5 * r), (-0.05 * h, 1.25 * r, r, 0.6 * r)])
        parts += [(f"{leg}_upper", thigh, fur), (f"{leg}_lower", shin, fur), (f"{leg}_paw", paw, belly)]
    return tuple(parts)


@functools.lru_cache(maxsize=64)
def _joints(look: PetLook) -> tuple[str, ...]:
    """The joint of each visual."""
    return tuple(joint for joint, *_ in _figure(look))


def _trunk(look: PetLook) -> Shape:
    """Trunk from the chest to the rump along z; x is down."""
    h, half = look.height, 0.5 * look.length * look.height
    deep, wide = 0.5 * look.depth * h, 0.5 * look.width * h
    return loft(
        [
            (1.02 * half, 0.45 * deep, 0.5 * wide, -0.05 * h),
            (0.88 * half, 0.85 * deep, 0.85 * wide, 0.0),
            (0.5 * half, deep, wide, 0.01 * h),
            (-0.1 * half, 0.92 * deep, 0.97 * wide, 0.0),
            (-0.5 * half, 0.76 * deep, 0.88 * wide, -0.03 * h),
            (-0.85 * half, 0.78 * deep, 0.85 * wide, -0.03 * h),
            (-1.02 * half, 0.4 * deep, 0.45 * wide, -0.06 * h),
        ]
    )


def _head(look: PetLook) -> list[tuple[str, Shape, Colour]]:
    h, long = look.height, look.muzzle * look.height
    r = (0.17 if look.model == "dog" else 0.20) * h
    wide = 0.8 * r
    ears = []
    for side in (1.0, -1.0):
        if look.ears == "pricked":
            at = -0.2 * r
            shape = loft(
                [
                    (1.75 * r, 0.04 * r, 0.06 * r, at),
                    (1.2 * r, 0.12 * r, 0.22 * r, at),
                    (0.6 * r, 0.2 * r, 0.34 * r, at),
                ],
                y=side * 0.55 * r,
            )
        else:
            shape = ellipsoid(0.32 * r, 0.10 * r, 0.75 * r, at=(-0.15 * r, side * 1.02 * wide, 0.05 * r))
        ears.append(("head", shape, _darker(look.fur, 0.75)))
    eye = 0.13 * r
    eyes = [
        ("head", ellipsoid(eye, eye, eye, at=(0.78 * r, side * 0.42 * r, 0.28 * r), rings=5), _DARK)
        for side in (1.0, -1.0)
    ]
    tip = 0.7 * r + long
    snout = ellipsoid(0.5 * long + 0.3 * r, 0.45 * r, 0.40 * r, at=(0.55 * r + 0.5 * long, 0.0, -0.22 * r))
    return [
        ("head", ellipsoid(1.05 * r, wide, 0.9 * r), look.fur),
        ("head", snout, look.belly),
        ("head", ellipsoid(0.12 * r, 0.16 * r, 0.12 * r, at=(tip + 0.1 * r, 0.0, -0.12 * r), rings=5), _DARK),
        *ears,
        *eyes,
    ]  # fmt: skip


def _taper(length: float, low: float, high: float) -> list[Section]:
    return [
        (length, high, high, 0.0),
        (0.5 * length, 0.5 * (low + high), 0.5 * (low + high), 0.0),
        (0.0, low, low, 0.0),
    ]


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
