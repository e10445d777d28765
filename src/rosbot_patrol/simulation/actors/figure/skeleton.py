"""Skeleton of a detailed person: joints at rest, and their poses in each posture.

The body's frame is on the floor, x forward, y left. At rest the person stands straight with hanging arms, and every
joint's frame is parallel to the body's. Lengths are shares of the height (Drillis and Contini 1966).
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.simulation.scene.scene import Matrix

ANKLE, KNEE, HIP, WAIST, NECK = 0.045, 0.285, 0.52, 0.585, 0.845
WRIST, ELBOW, SHOULDER = 0.487, 0.635, 0.808
HIP_WIDTH, SHOULDER_WIDTH = 0.050, 0.103
"""Distances of the joints from the middle plane."""

SIDES = (("left", 1.0), ("right", -1.0))
Pair = tuple[float, float]
Vector = NDArray[np.float64]


@dataclass(frozen=True)
class Angles:
    """Joint angles [rad]; a limb's forward swing is positive, pairs are (left, right).

    Attributes:
        lean: of the trunk; nod: of the head; turn: of the head, to the left.
        tilt: of the pelvis, the left side up; the trunk bends back by as much.
        spread: of the arms from the trunk; inward: of the forearms; splay: of the legs.
    """

    lean: float = 0.02
    nod: float = 0.0
    turn: float = 0.0
    tilt: float = 0.0
    twist: float = 0.0
    thigh: Pair = (0.02, 0.0)
    knee: Pair = (0.04, 0.04)
    arm: Pair = (0.0, 0.0)
    elbow: Pair = (0.2, 0.2)
    spread: Pair = (0.12, 0.12)
    inward: Pair = (0.0, 0.0)
    splay: Pair = (0.04, 0.04)


_STANDING = (
    Angles(tilt=0.05, thigh=(0.0, 0.16), knee=(0.02, 0.30), arm=(0.02, 0.08), elbow=(0.18, 0.30), splay=(0.02, 0.09)),
    Angles(tilt=-0.05, thigh=(0.14, 0.0), knee=(0.26, 0.02), turn=0.3, arm=(-0.05, 0.05), splay=(0.10, 0.02)),
    Angles(arm=(-0.25, -0.22), elbow=(0.75, 0.70), spread=(0.24, 0.24), inward=(0.5, 0.5), splay=(0.07, 0.07)),
    Angles(
        tilt=0.04, thigh=(0.0, 0.12), knee=(0.02, 0.24), arm=(0.45, 0.0), elbow=(1.6, 0.2), nod=0.25, splay=(0.03, 0.08)
    ),
    Angles(lean=0.05, turn=-0.4, twist=0.12, arm=(0.1, -0.1), elbow=(0.3, 0.25), splay=(0.05, 0.06)),
)  # fmt: skip


def standing(seed: int) -> Angles:
    """A relaxed posture; each person has its own."""
    return _STANDING[seed % len(_STANDING)]


def angles_of(seed: int, phase: float, walking: bool, posture: str) -> Angles:
    """Angles of a posture.

    Args:
        seed: number of the person.
        phase: share of a cycle of two steps; somebody who stands or sits sways with it.
        walking: whether the legs walk.
        posture: as in `people.py`.
    """
    swing = float(np.sin(2 * np.pi * phase))
    if posture == "sitting":
        return _sitting(seed, swing)
    if posture == "crouching":
        return Angles(
            lean=0.6 + 0.08 * swing, nod=-0.35, thigh=(1.95, 1.15), knee=(2.25, 2.1), arm=(0.75, 0.45),
            elbow=(0.8, 0.9), inward=(0.4, 0.3), splay=(0.18, 0.10),
        )  # fmt: skip
    if posture == "creeping":
        walk = _walking(phase)
        thigh, knee = _plus(walk.thigh, 0.7), _plus(walk.knee, 0.85)
        return replace(walk, lean=0.6, nod=-0.4, thigh=thigh, knee=knee, arm=(0.75, 0.55), elbow=(1.0, 1.1))
    if walking:
        return _walking(phase)
    still = standing(seed)
    return replace(still, arm=_plus(still.arm, 0.04 * swing), lean=still.lean + 0.01 * swing)


def _sitting(seed: int, swing: float) -> Angles:
    hands = ((0.45, 0.50), (0.30, 0.55))[seed % 2]
    return Angles(
        lean=0.08 - 0.05 * swing, nod=0.08, thigh=(1.50, 1.46), knee=(1.52, 1.40 + 0.1 * (seed % 3)), arm=hands,
        elbow=(0.85, 0.75 + 0.08 * swing), inward=(0.35, 0.35), spread=(0.15, 0.15), splay=(0.12, 0.10),
    )  # fmt: skip


def _walking(phase: float) -> Angles:
    """A gait: the knee bends most while its leg swings forward, and a little when the foot takes the weight."""
    turns = 2 * np.pi * (np.array([phase, phase + 0.5]))
    swing = np.sin(turns)
    thigh = 0.42 * swing + 0.10
    flight, landing = np.cos(turns), np.sin(turns)
    knee = 0.08 + 0.85 * np.clip(flight, 0.0, 1.0) ** 1.5 + 0.12 * np.clip(landing, 0.0, 1.0)
    arm, elbow = -0.36 * swing + 0.02, 0.30 - 0.18 * swing
    tilt = 0.05 * float(np.cos(turns[0]))
    return Angles(
        lean=0.06, tilt=-tilt, twist=-0.12 * float(swing[0]), thigh=_pair(thigh), knee=_pair(knee), arm=_pair(arm),
        elbow=_pair(elbow), spread=(0.10, 0.10), splay=(0.01, 0.01),
    )  # fmt: skip


def _pair(values: Vector) -> Pair:
    return float(values[0]), float(values[1])


def _plus(pair: Pair, more: float) -> Pair:
    return pair[0] + more, pair[1] + more


@functools.lru_cache(maxsize=256)
def rest_joints(height: float, build: float) -> dict[str, Vector]:
    """Positions of the joints at rest [m], shape (3,) each; cached, not to be changed."""
    hip, shoulder = HIP_WIDTH * (0.75 + 0.25 * build), SHOULDER_WIDTH * (0.75 + 0.25 * build)
    shares = {"pelvis": (0.0, 0.0, HIP), "torso": (-0.004, 0.0, WAIST), "head": (-0.008, 0.0, NECK)}
    for side, sign in SIDES:
        shares |= {
            f"thigh_{side}": (0.0, sign * hip, HIP),
            f"shin_{side}": (0.0, sign * hip, KNEE),
            f"foot_{side}": (-0.005, sign * hip, ANKLE),
            f"arm_{side}": (-0.005, sign * shoulder, SHOULDER),
            f"forearm_{side}": (-0.005, sign * shoulder, ELBOW),
        }
    return {name: height * np.array(share) for name, share in shares.items()}


@functools.lru_cache(maxsize=64)
def body_from_rest(height: float, build: float, angles: Angles) -> dict[str, Matrix]:
    """For each joint the motion from rest to the posture, in the body's frame, with the lower sole on the floor.

    Somebody who stands still costs nothing: the result is cached, and must not be changed.
    """
    rest = rest_joints(height, build)
    pelvis = _about(rest["pelvis"], pitch=0.3 * angles.lean, roll=angles.tilt)
    torso = pelvis @ _about(rest["torso"], pitch=0.7 * angles.lean, roll=-1.3 * angles.tilt, yaw=angles.twist)
    moved = {"pelvis": pelvis, "torso": torso}
    moved["head"] = torso @ _about(
        rest["head"], pitch=angles.nod, roll=0.4 * angles.tilt, yaw=angles.turn - angles.twist
    )
    for i, (side, sign) in enumerate(SIDES):
        hip = _shifted(pelvis, rest[f"thigh_{side}"])
        thigh = hip @ _about(rest[f"thigh_{side}"], pitch=-angles.thigh[i], roll=sign * -angles.splay[i])
        shin = thigh @ _about(rest[f"shin_{side}"], pitch=angles.knee[i])
        tilt = float(np.clip(0.8 * (angles.thigh[i] - angles.knee[i]), -0.7, 2.0))
        foot = shin @ _about(rest[f"foot_{side}"], pitch=tilt, yaw=sign * 0.12)
        arm = torso @ _about(rest[f"arm_{side}"], pitch=-angles.arm[i], roll=sign * angles.spread[i])
        forearm = arm @ _about(rest[f"forearm_{side}"], pitch=-angles.elbow[i], roll=sign * -angles.inward[i])
        moved |= {f"thigh_{side}": thigh, f"shin_{side}": shin, f"foot_{side}": foot}
        moved |= {f"arm_{side}": arm, f"forearm_{side}": forearm}
    lift = np.eye(4)
    lift[2, 3] = -min(_sole(moved[f"foot_{side}"], rest[f"foot_{side}"]) for side, _ in SIDES)
    return {name: lift @ matrix for name, matrix in moved.items()}


def _shifted(pelvis: Matrix, joint: Vector) -> Matrix:
    """Motion of the hip joint with the pelvis, without its rotation: legs keep upright while the pelvis tilts."""
    moved = np.eye(4)
    moved[:3, 3] = pelvis[:3, :3] @ joint + pelvis[:3, 3] - joint
    return moved


def _sole(foot: Matrix, ankle: Vector) -> float:
    corners = np.array([[ankle[0] - 0.07, ankle[1], 0.0, 1.0], [ankle[0] + 0.19, ankle[1], 0.0, 1.0]])
    return float((corners @ foot.T)[:, 2].min())


def _about(joint: Vector, *, pitch: float = 0.0, roll: float = 0.0, yaw: float = 0.0) -> Matrix:
    """Rotation about a joint: first the yaw, then the pitch, then the roll."""
    (cp, sp), (cr, sr), (cy, sy) = ((math.cos(a), math.sin(a)) for a in (pitch, roll, yaw))
    matrix = np.eye(4)
    rotation = matrix[:3, :3]  # roll about x, after pitch about y, after yaw about z
    rotation[0] = cp * cy, -cp * sy, sp
    rotation[1] = sr * sp * cy + cr * sy, cr * cy - sr * sp * sy, -sr * cp
    rotation[2] = sr * sy - cr * sp * cy, cr * sp * sy + sr * cy, cr * cp
    matrix[:3, 3] = joint - rotation @ joint
    return matrix
