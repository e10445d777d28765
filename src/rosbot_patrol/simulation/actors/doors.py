"""Doors: leaves on vertical hinges that open and close at a speed, and stop before the robot and walkers.

A leaf pushes nothing and cannot be pushed: to the robot it is a wall. Its opening angle about the hinge is between 0
(as in the world file, closed) and its swing.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from rosbot_patrol.errors import WorldError
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.simulation.scene.matrices import Matrix, from_pose2d, from_xyz_rpy
from rosbot_patrol.simulation.scene.scene import Body, Collision, Material, Shape, Visual
from rosbot_patrol.simulation.scene.shapes import mesh_of
from rosbot_patrol.simulation.scene.slices import Slice, slice_bodies

SPEED = 0.8  # usual speed of a door pushed open [rad/s]
SWING = math.pi / 2.0

_MARGIN = 0.02  # clearance between a leaf and an obstacle [m]
_GAP = 0.01  # gap below a leaf [m]


@dataclass(frozen=True, kw_only=True)
class DoorPlace:
    """A leaf and its hinge.

    Attributes:
        body: the leaf; its pose is world_from_body of the closed door.
        axis: position of the hinge, x, y [m].
        swing: angle of the open door [rad], counter-clockwise positive.
    """

    body: Body
    axis: tuple[float, float]
    swing: float = SWING


def plain_door(
    name: str, hinge: Pose2D, *, width: float = 0.9, height: float = 2.0, thickness: float = 0.04, swing: float = SWING
) -> DoorPlace:
    """Make a wooden leaf with handles; closed, it extends along the hinge's x axis.

    Raises:
        WorldError: a number is invalid.
    """
    numbers = (*hinge, width, height, thickness, swing)
    if not all(map(math.isfinite, numbers)) or min(width, height, thickness) <= 0.0:
        raise WorldError(f"door '{name}'", f"cannot be {width} m wide, {height} m high and {thickness} m thick")
    _check_swing(name, swing)
    box = Shape(kind="box", size=(width, thickness, height - _GAP))
    middle = from_xyz_rpy((width / 2.0, 0.0, (height + _GAP) / 2.0))
    wood = Material(rgba=(0.62, 0.45, 0.28, 1.0), texture="wood")
    panel, steel = Material(rgba=(0.34, 0.22, 0.13, 1.0)), Material(rgba=(0.75, 0.75, 0.72, 1.0))
    visuals = [Visual(shape=box, pose=middle, material=wood)]
    for low, high in ((0.08, 0.46), (0.54, 0.93)):
        size = (0.66 * width, 1.3 * thickness, (high - low) * height)
        at = from_xyz_rpy((width / 2.0, 0.0, (low + high) / 2.0 * height))
        visuals.append(Visual(shape=Shape(kind="box", size=size), pose=at, material=panel))
    knob = from_xyz_rpy((0.92 * width, 0.0, 0.5 * height))
    visuals.append(Visual(shape=Shape(kind="box", size=(0.03, thickness + 0.10, 0.03)), pose=knob, material=steel))
    body = Body(
        name=name, kind="door", static=False, pose=from_pose2d(hinge), visuals=tuple(visuals),
        collisions=(Collision(shape=box, pose=middle),),
    )  # fmt: skip
    return DoorPlace(body=body, axis=(hinge.x, hinge.y), swing=swing)


class Door:
    """A moving door.

    Args:
        place: leaf and hinge.

    Raises:
        WorldError: the leaf has no collision shape, or the swing is not a door's angle.
    """

    def __init__(self, place: DoorPlace) -> None:
        self.name = place.body.name
        self.body = place.body
        self.swing = place.swing
        self.opening = 0.0
        self.is_held_up = False
        _check_swing(self.name, place.swing)
        self._axis = place.axis
        self._axis_from_body = from_xyz_rpy((-place.axis[0], -place.axis[1], 0.0)) @ place.body.pose
        self._low, self._high = _extent(self.body, self._axis_from_body)
        self._cuts: dict[float, Slice] = {}
        self._target = 0.0
        self._speed = 0.0

    @property
    def angle(self) -> float:
        """Opening angle from closed [rad]."""
        return self.opening * self.swing

    @property
    def is_moving(self) -> bool:
        """Whether it has not reached its target angle yet."""
        return self.opening != self._target

    @property
    def matrix(self) -> Matrix:
        """world_from_body."""
        return from_pose2d(self._hinge(self.opening)) @ self._axis_from_body

    def pose_parts(self) -> Matrix | None:
        """None: the leaf has no moving parts."""

    def set(self, opening: float, speed: float = SPEED) -> None:
        """Start to open or close.

        Args:
            opening: 0 closed to 1 open.
            speed: speed of the leaf [rad/s]; 0 moves it at once.

        Raises:
            WorldError: a number is out of bounds.
        """
        if not 0.0 <= opening <= 1.0:
            raise WorldError(f"door '{self.name}'", f"opens from 0 to 1, not to {opening}")
        if not (speed >= 0.0 and math.isfinite(speed)):
            raise WorldError(f"door '{self.name}'", f"cannot move at {speed} rad/s")
        self._target, self._speed = opening, speed
        if speed == 0.0:
            self.opening = opening

    def step(self, dt: float, in_the_way: Iterable[tuple[Pose2D, float]]) -> bool:
        """Advance by `dt` [s]; returns whether it moved.

        Args:
            dt: time step [s].
            in_the_way: poses of the robot and the walkers, each with the radius of its cylinder [m].
        """
        self.is_held_up = False
        if not self.is_moving:
            return False
        change = self._speed * dt / abs(self.swing)
        wanted = self.opening + min(max(self._target - self.opening, -change), change)
        for (x, y, _), radius in in_the_way:
            after = self._distance(x, y, wanted)
            if after < radius + _MARGIN and after < self._distance(x, y, self.opening):
                self.is_held_up = True
                return False
        self.opening = wanted
        return True

    def distance_to(self, x: float, y: float) -> float:
        """Planar distance from a point to the leaf [m]."""
        return self._distance(x, y, self.opening)

    def cut(self, height: float) -> Slice:
        """Horizontal section at a height [m] of the leaf in its present position, in the world frame."""
        if height not in self._cuts:
            closed = Body(name=self.name, kind="door", pose=self._axis_from_body, collisions=self.body.collisions)
            self._cuts[height] = slice_bodies([closed], height)
        return self._cuts[height].placed(self._hinge(self.opening))

    def _hinge(self, opening: float) -> Pose2D:
        return Pose2D(*self._axis, opening * self.swing)

    def _distance(self, x: float, y: float, opening: float) -> float:
        yaw = opening * self.swing
        c, s = math.cos(yaw), math.sin(yaw)
        dx, dy = x - self._axis[0], y - self._axis[1]
        along, across = c * dx + s * dy, c * dy - s * dx
        return math.hypot(
            max(self._low[0] - along, 0.0, along - self._high[0]),
            max(self._low[1] - across, 0.0, across - self._high[1]),
        )


def _check_swing(name: str, swing: float) -> None:
    if not 0.05 <= abs(swing) <= math.pi:
        raise WorldError(f"door '{name}'", f"swings by {swing:.3f} rad, expected 0.05 to 3.14 to either side")


def _extent(body: Body, axis_from_body: Matrix) -> tuple[tuple[float, float], tuple[float, float]]:
    """Smallest and largest x and y of the collision shapes in the hinge's frame."""
    if not body.collisions:
        raise WorldError(f"door '{body.name}'", "has no collision shape")
    corners = []
    for collision in body.collisions:
        pose = axis_from_body @ collision.pose
        corners.append(mesh_of(collision.shape).positions @ pose[:3, :3].T + pose[:3, 3])
    points = np.vstack(corners)
    low, high = points.min(axis=0), points.max(axis=0)
    return (float(low[0]), float(low[1])), (float(high[0]), float(high[1]))
