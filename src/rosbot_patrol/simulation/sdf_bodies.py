"""Bodies of an SDF world: put together, told apart by their names, and stood in for."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from rosbot_patrol.simulation.scene import Body, BodyKind, Collision, Material, Matrix, Shape, Visual, identity
from rosbot_patrol.simulation.sdf_shapes import PLANE


def instead(part: Collision) -> Visual:
    """What a collision shape is shown as where nothing else is: floors darker than what stands on them."""
    is_floor = part.shape.kind == "box" and min(part.shape.size[:2]) > 2.0 > part.shape.size[2]
    shade = (0.50, 0.48, 0.45, 1.0) if is_floor else (0.74, 0.71, 0.66, 1.0)
    return Visual(shape=part.shape, pose=part.pose, material=Material(rgba=shade))


def together(body: Body, parts: Iterable[Body]) -> Body:
    """A body with what stands fast on it."""
    for part in parts:
        pose = inverse(body.pose) @ part.pose
        body = replace(
            body,
            visuals=(*body.visuals, *(replace(v, pose=pose @ v.pose) for v in part.visuals)),
            collisions=(*body.collisions, *(replace(c, pose=pose @ c.pose) for c in part.collisions)),
        )
    return body


def inverse(pose: Matrix) -> Matrix:
    """The pose that undoes another one."""
    turn = pose[:3, :3].T
    inverse = identity()
    inverse[:3, :3], inverse[:3, 3] = turn, -turn @ pose[:3, 3]
    return inverse


def kind_of(model: str, link: str, collisions: Iterable[Collision]) -> BodyKind:
    """What a link is, by what it and its model are called."""
    text = f"{model} {link}".lower()
    if "ground_plane" in text or any(c.shape.kind == "plane" for c in collisions):
        return "floor"
    if "wall" in text:
        return "wall"
    if "door" in text:
        return "door"
    return "furniture"


def floor(name: str) -> Body:
    """The ground plane, for those who have no model of it."""
    shape = Shape(kind="plane", size=PLANE)
    look = Material(rgba=(0.55, 0.55, 0.55, 1.0))
    return Body(
        name=name, kind="floor", visuals=(Visual(shape=shape, material=look),), collisions=(Collision(shape=shape),)
    )
