"""Boxes that can be added to a running world."""

from __future__ import annotations

from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.simulation.scene.matrices import from_pose2d
from rosbot_patrol.simulation.scene.scene import Body, Collision, Material, Shape, Visual

_CARDBOARD = Material(rgba=(0.62, 0.47, 0.31, 1.0))


def box_body(name: str, pose: Pose2D, size: tuple[float, float, float]) -> Body:
    """Make a cardboard box on the floor from its middle and direction, its length, depth and height [m]."""
    shape = Shape(kind="box", size=size)
    return Body(
        name=name,
        kind="object",
        pose=from_pose2d(pose, size[2] / 2.0),
        visuals=(Visual(shape=shape, material=_CARDBOARD),),
        collisions=(Collision(shape=shape),),
    )
