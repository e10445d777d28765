"""Bodies of an SDF world: assembly, kinds by name, stand-in visuals, and raised floors.

In some houses the floor is a slab of some centimetres, and everything stands on it. In Gazebo the robot drives on top
of it; here the floor is at height 0. So such a world is lowered until the top of its slab is at height 0.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from rosbot_patrol.simulation.actors.doors import DoorPlace
from rosbot_patrol.simulation.scene.matrices import is_upright
from rosbot_patrol.simulation.scene.scene import Body, BodyKind, Collision, Material, Matrix, Shape, Visual, identity
from rosbot_patrol.simulation.sdf.shapes import PLANE


def instead(part: Collision) -> Visual:
    """Visual of a collision shape without visuals: floors are darker than the things on them."""
    is_floor = part.shape.kind == "box" and min(part.shape.size[:2]) > 2.0 > part.shape.size[2]
    shade = (0.50, 0.48, 0.45, 1.0) if is_floor else (0.74, 0.71, 0.66, 1.0)
    return Visual(shape=part.shape, pose=part.pose, material=Material(rgba=shade))


def together(body: Body, parts: Iterable[Body]) -> Body:
    """Merge a body with the parts attached to it."""
    for part in parts:
        pose = inverse(body.pose) @ part.pose
        body = replace(
            body,
            visuals=(*body.visuals, *(replace(v, pose=pose @ v.pose) for v in part.visuals)),
            collisions=(*body.collisions, *(replace(c, pose=pose @ c.pose) for c in part.collisions)),
        )
    return body


def inverse(pose: Matrix) -> Matrix:
    """The inverse of a pose."""
    turn = pose[:3, :3].T
    inverse = identity()
    inverse[:3, :3], inverse[:3, 3] = turn, -turn @ pose[:3, 3]
    return inverse


def kind_of(model: str, link: str, collisions: Iterable[Collision]) -> BodyKind:
    """Kind of a link, from its name and its model's."""
    text = f"{model} {link}".lower()
    if "ground_plane" in text or any(c.shape.kind == "plane" for c in collisions):
        return "floor"
    if "wall" in text:
        return "wall"
    if "door" in text:
        return "door"
    return "furniture"


def floor(name: str) -> Body:
    """The ground plane, for worlds without a model of it."""
    shape = Shape(kind="plane", size=PLANE)
    look = Material(rgba=(0.55, 0.55, 0.55, 1.0))
    return Body(
        name=name, kind="floor", visuals=(Visual(shape=shape, material=look),), collisions=(Collision(shape=shape),)
    )


_THICK = 0.35  # largest thickness of a slab [m]
_WIDE = 4.0  # smallest length of its shorter side [m]
_LOW = 0.05  # largest height of its bottom [m]
_NO_RISE = 0.01  # the wheels roll over lower steps [m]
_SHARE = 0.5  # smallest share of all things that stand on the floor


def raised_floor(bodies: Sequence[Body]) -> float:
    """Height of the slab under most of a world's things [m], 0 if there is none."""
    slabs = [(body, part.pose, part.shape.size) for body in bodies for part in body.collisions
             if part.shape.kind == "box" and min(part.shape.size[:2]) >= _WIDE]  # fmt: skip
    heights = []
    for body, pose, size in slabs:
        placed = body.pose @ pose
        top, bottom = placed[2, 3] + size[2] / 2.0, placed[2, 3] - size[2] / 2.0
        if is_upright(placed) and _NO_RISE < top <= _THICK and bottom <= _LOW and _carries(placed, size, bodies):
            heights.append(float(top))
    return max(heights, default=0.0)


def let_down(
    bodies: Iterable[Body], doors: Iterable[DoorPlace], height: float
) -> tuple[tuple[Body, ...], tuple[DoorPlace, ...]]:
    """Lower bodies and doors by a height [m]."""
    return (
        tuple(replace(body, pose=_lower(body.pose, height)) for body in bodies),
        tuple(replace(door, body=replace(door.body, pose=_lower(door.body.pose, height))) for door in doors),
    )


def _lower(pose: Matrix, height: float) -> Matrix:
    lower = pose.copy()
    lower[2, 3] -= height
    return lower


def _carries(slab: Matrix, size: tuple[float, ...], bodies: Iterable[Body]) -> bool:
    """Whether most shapes of a world lie within a slab's outline, and none of them is the same slab again."""
    places = [body.pose @ part.pose for body in bodies for part in body.collisions if part.shape.kind != "plane"]
    middles = np.array([place[:3, 3] for place in places]) - slab[:3, 3]
    others = middles[np.linalg.norm(middles, axis=1) > 1e-6]
    if not len(others):
        return False
    yaw = math.atan2(slab[1, 0], slab[0, 0])
    c, s = math.cos(yaw), math.sin(yaw)
    within = np.abs(others[:, :2] @ np.array([[c, -s], [s, c]])) <= np.array(size[:2]) / 2.0 + 0.3
    return bool(within.all(axis=1).mean() >= _SHARE)
