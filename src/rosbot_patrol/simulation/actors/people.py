"""Bodies of people and fire hydrants, and a person's limbs while walking, sitting or crouching.

A person's frame is on the floor between the feet, x forward. One posture is reserved for tests, as are some looks
(`looks.py`): the generator of training pictures never uses it.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from rosbot_patrol.simulation.actors import people_meshes as parts
from rosbot_patrol.simulation.actors.figure import person as detailed
from rosbot_patrol.simulation.actors.looks import LOOKS, Colour, Look, draw_look, is_reserved, look_named
from rosbot_patrol.simulation.scene.scene import Body, Collision, Material, Matrix, Shape, Visual

Posture = Literal["standing", "sitting", "crouching", "creeping"]
POSTURES: tuple[Posture, ...] = ("standing", "sitting", "crouching")
RESERVED_POSTURES: tuple[Posture, ...] = ("creeping",)

__all__ = [
    "LOOKS",
    "Look",
    "draw_look",
    "hip_height",
    "hydrant_body",
    "is_reserved",
    "look_named",
    "person_body",
    "person_pose_parts",
]


def person_body(name: str, look: Look | None = None) -> Body:
    """Make a standing person at the world's origin; `person_pose_parts` moves the visuals."""
    look = look or LOOKS["visitor"]
    if look.detailed:
        return Body(
            name=name, kind="person", static=False, visuals=detailed.visuals(look), collisions=_collisions(look)
        )
    poses = person_pose_parts(look)
    visuals = tuple(
        Visual(shape=shape, pose=pose, material=Material(rgba=(*colour, 1.0), texture=texture))
        for (_, shape, colour, texture), pose in zip(_figure(look), poses, strict=True)
    )
    return Body(name=name, kind="person", static=False, visuals=visuals, collisions=_collisions(look))


def person_pose_parts(look: Look, phase: float = 0.0, walking: bool = False, posture: Posture = "standing") -> Matrix:
    """Poses of the visuals of `person_body`, body_from_visuals, shape (number of visuals, 4, 4).

    Args:
        look: the look given to `person_body`.
        phase: cycles walked (two steps each); it sways the arms a little while standing. Only its fraction counts.
        walking: whether the legs walk; a creeping person walks stooped.
        posture: posture of the person; "creeping" is reserved for tests.
    """
    if look.detailed:
        return detailed.pose_parts(look, phase % 1.0, walking, posture)
    frames = _skeleton(look, _angles(phase % 1.0, walking, posture))
    return np.array([frames[joint] for joint in _joints(look)])


def hip_height(look: Look, phase: float = 0.0, walking: bool = False, posture: Posture = "standing") -> float:
    """Height of a person's hip joints above the floor [m]; the arguments are those of `person_pose_parts`."""
    if look.detailed:
        return detailed.hip_height(look, phase % 1.0, walking, posture)
    return float(_skeleton(look, _angles(phase % 1.0, walking, posture))["pelvis"][2, 3])


def hydrant_body(
    name: str, colour: Colour = (0.74, 0.10, 0.08), *, caps: Colour | None = None, height: float = 0.75
) -> Body:
    """Make a fire hydrant on the floor at the world's origin, with its front nozzle along x."""
    s, caps = height / 0.75, caps or (0.78, 0.76, 0.70)
    upright = [
        (0.16, 0.05, 0.025, colour),
        (0.11, 0.42, 0.26, colour),
        (0.135, 0.04, 0.47, colour),
        (0.12, 0.10, 0.53, colour),
        (0.04, 0.07, 0.715, caps),
    ]
    visuals = [_cylinder(r * s, length * s, (0, 0, z * s), "z", c) for r, length, z, c in upright]
    visuals.append(
        Visual(shape=Shape(kind="sphere", size=(0.118 * s,)), pose=_at(0, 0, 0.58 * s), material=_paint(colour))
    )
    for axis, x, y, r in (("y", 0.0, 0.15, 0.05), ("y", 0.0, -0.15, 0.05), ("x", 0.14, 0.0, 0.065)):
        visuals.append(_cylinder(r * s, 0.10 * s, (x * s, y * s, 0.40 * s), axis, colour))
        visuals.append(_cylinder(1.2 * r * s, 0.035 * s, (1.3 * x * s, 1.3 * y * s, 0.40 * s), axis, caps))
    solid = Collision(shape=Shape(kind="cylinder", size=(0.14 * s, height)), pose=_at(0, 0, height / 2))
    return Body(name=name, kind="fire_hydrant", static=False, visuals=tuple(visuals), collisions=(solid,))


@dataclass(frozen=True)
class _Angles:
    """Joint angles [rad]; forward swings are positive, each pair is (left, right)."""

    lean: float = 0.03
    nod: float = 0.0
    thigh: tuple[float, float] = (0.02, -0.02)
    knee: tuple[float, float] = (0.03, 0.03)
    arm: tuple[float, float] = (0.0, 0.0)
    elbow: tuple[float, float] = (0.15, 0.15)
    spread: float = 0.08
    splay: float = 0.03


def _angles(phase: float, walking: bool, posture: Posture) -> _Angles:
    turn = 2 * np.pi * phase
    swing = float(np.sin(turn))
    if posture == "sitting":
        hands = 0.75 + 0.12 * swing
        return _Angles(
            lean=0.10 - 0.1 * swing,
            nod=0.1,
            thigh=(1.48, 1.46),
            knee=(1.50, 1.44),
            arm=(0.5, hands),
            elbow=(0.9, 0.8),
            splay=0.12,
        )
    if posture == "crouching":
        return _Angles(
            lean=0.55 + 0.1 * swing,
            nod=-0.35,
            thigh=(1.75, 1.25),
            knee=(2.15, 2.05),
            arm=(0.9, 0.6),
            elbow=(0.6, 0.7),
            splay=0.14,
        )
    stride = 0.46 if walking else 0.0
    bend = (
        tuple(0.08 + 0.85 * stride * (1.0 + float(np.cos(turn + shift))) for shift in (0.0, np.pi))
        if walking
        else (0.03, 0.03)
    )
    walk = _Angles(
        lean=0.05 if walking else 0.02,
        thigh=(stride * swing + 0.10 * walking, -stride * swing + 0.10 * walking),
        knee=(bend[0], bend[1]),
        arm=(-0.9 * stride * swing + 0.05 * swing, 0.9 * stride * swing + 0.03 * swing),
        elbow=(0.30, 0.30) if walking else (0.12 + 0.1 * swing, 0.15),
    )
    if posture == "creeping":
        return replace(
            walk,
            lean=0.6,
            nod=-0.4,
            thigh=(walk.thigh[0] + 0.7, walk.thigh[1] + 0.7),
            knee=(bend[0] + 0.85, bend[1] + 0.85),
            arm=(0.75, 0.55),
            elbow=(1.0, 1.1),
        )
    return walk


def _skeleton(look: Look, angles: _Angles) -> dict[str, Matrix]:
    """body_from_joint for each joint, with the lower shoe's sole on the floor."""
    h = look.height
    pelvis = _at(0, 0, 0.0)
    torso = pelvis @ _at(0, 0, 0.055 * h) @ _pitch(angles.lean)
    frames = {"pelvis": pelvis @ _pitch(0.4 * angles.lean), "torso": torso}
    frames["head"] = torso @ _at(0, 0, 0.285 * h) @ _pitch(angles.nod)
    for side, sign, i in (("left", 1.0, 0), ("right", -1.0, 1)):
        thigh = (
            pelvis
            @ _at(0, sign * 0.052 * h * (0.7 + 0.3 * look.build), 0)
            @ _roll(-sign * angles.splay)
            @ _pitch(-angles.thigh[i])
        )
        shin = thigh @ _at(0, 0, -_THIGH * h) @ _pitch(angles.knee[i])
        tilt = angles.thigh[i] - angles.knee[i]
        foot = shin @ _at(0, 0, -_SHIN * h) @ _pitch(float(np.clip(0.75 * tilt, -0.6, 2.2)))
        arm = (
            torso
            @ _at(-0.005, sign * _shoulder(look), 0.252 * h)
            @ _roll(sign * angles.spread)
            @ _pitch(-angles.arm[i])
        )
        fore = arm @ _at(0, 0, -_ARM * h) @ _pitch(-angles.elbow[i])
        frames.update(
            {
                f"thigh_{side}": thigh,
                f"shin_{side}": shin,
                f"foot_{side}": foot,
                f"arm_{side}": arm,
                f"forearm_{side}": fore,
            }
        )
    lowest = min(_sole(frames[f"foot_{side}"]) for side in ("left", "right"))
    lift = _at(0, 0, -lowest)
    return {name: lift @ frame for name, frame in frames.items()}


_THIGH, _SHIN, _ARM, _FOREARM = 0.245, 0.225, 0.168, 0.145


def _shoulder(look: Look) -> float:
    return 0.104 * look.height * (0.65 + 0.35 * look.build)


def _sole(foot: Matrix) -> float:
    corners = np.array([[-0.07, 0, -0.075, 1], [0.18, 0, -0.075, 1]])
    return float((corners @ foot.T)[:, 2].min())


@functools.lru_cache(maxsize=32)
def _figure(look: Look) -> tuple[tuple[str, Shape, Colour, str], ...]:
    """(joint, shape, colour, texture) of each visual."""
    h, b, loose = look.height, look.build, look.loose
    hip, skull = 0.088 * h * (0.6 + 0.4 * b), 0.128 * h
    legs, leg_texture = (look.skin, "") if look.legs == "skirt" else (look.bottom, look.bottom_texture)
    shins = (look.bottom, look.bottom_texture) if look.legs == "trousers" else (look.skin, "")
    lower = (look.top, look.top_texture) if look.sleeves == "long" else (look.skin, "")
    figure = [
        ("pelvis", parts.hips(hip, b), look.bottom, look.bottom_texture),
        ("torso", parts.trunk(0.275 * h, 1.13 * _shoulder(look), b, loose=loose), look.top, look.top_texture),
        ("head", parts.head(skull), look.mask or look.skin, ""),
    ]
    for side in ("left", "right"):
        figure += [
            (f"thigh_{side}", parts.thigh(_THIGH * h, b * (1 + 0.1 * loose)), legs, leg_texture),
            (f"shin_{side}", parts.shin(_SHIN * h, b, loose=loose if look.legs == "trousers" else 0.0), *shins),
            (f"foot_{side}", parts.shoe(0.152 * h, 0.05), look.shoes, ""),
            (f"arm_{side}", parts.upper_arm(_ARM * h, b, loose=loose), look.top, look.top_texture),
            (f"forearm_{side}", parts.forearm(_FOREARM * h, b, loose=loose if look.sleeves == "long" else 0.0), *lower),
            (f"forearm_{side}", parts.hand(_FOREARM * h), look.skin, ""),
        ]
    return (*figure, *_extras(look, hip, skull))


@functools.lru_cache(maxsize=256)
def _joints(look: Look) -> tuple[str, ...]:
    """The joint of each visual."""
    return tuple(joint for joint, *_ in _figure(look))


def _extras(look: Look, hip: float, skull: float) -> list[tuple[str, Shape, Colour, str]]:
    h, b = look.height, look.build
    extras: list[tuple[str, Shape, Colour, str]] = []
    if look.hair_style in ("short", "long"):
        extras.append(("head", parts.hair(skull, look.hair_style), look.hair, ""))
    elif look.hair_style == "hood":
        extras.append(("head", parts.hair(skull, "hood"), look.top, look.top_texture))
    elif look.hair_style in ("beanie", "cap"):
        extras.append(("head", parts.hair(skull, "beanie"), look.hat, ""))
        if look.hair_style == "cap":
            extras.append(("head", parts.brim(skull), look.hat, ""))
    if look.legs == "skirt":
        extras.append(("pelvis", parts.skirt(hip, 0.22 * h, b, flare=look.loose), look.bottom, look.bottom_texture))
    if look.coat:
        extras.append(
            ("pelvis", parts.skirt(1.04 * hip, 0.16 * h, 1.05 * b, flare=0.3 * look.loose), look.top, look.top_texture)
        )
    if look.backpack is not None:
        extras.append(("torso", parts.backpack(0.29 * h), look.backpack, ""))
    return extras


def _collisions(look: Look) -> tuple[Collision, ...]:
    h, b = look.height, look.build
    radius, leg = 0.065 * (0.6 + 0.4 * b), 0.47 * h
    side = 0.055 * h
    legs = [
        Collision(shape=Shape(kind="capsule", size=(radius, leg - 2 * radius)), pose=_at(0, sign * side, leg / 2))
        for sign in (1.0, -1.0)
    ]
    trunk = 0.14 * (0.6 + 0.4 * b)
    upper = Collision(shape=Shape(kind="capsule", size=(trunk, 0.53 * h - 2 * trunk)), pose=_at(0, 0, 0.735 * h))
    return (*legs, upper)


def _paint(colour: Colour) -> Material:
    return Material(rgba=(*colour, 1.0))


def _cylinder(radius: float, length: float, at: tuple[float, float, float], axis: str, colour: Colour) -> Visual:
    turn = {"z": np.eye(4), "x": _pitch(np.pi / 2), "y": _roll(np.pi / 2)}[axis]
    return Visual(shape=Shape(kind="cylinder", size=(radius, length)), pose=_at(*at) @ turn, material=_paint(colour))


def _at(x: float, y: float, z: float) -> Matrix:
    matrix = np.eye(4)
    matrix[:3, 3] = x, y, z
    return matrix


def _pitch(angle: float) -> Matrix:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, 0, s, 0], [0, 1, 0, 0], [-s, 0, c, 0], [0, 0, 0, 1.0]])


def _roll(angle: float) -> Matrix:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[1, 0, 0, 0], [0, c, -s, 0], [0, s, c, 0], [0, 0, 0, 1.0]])
