"""Actors that stand, walk along points and stop: people and fire hydrants, in the plane."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.errors import WorldError
from rosbot_patrol.geometry import Pose2D, angle_difference, distance, wrap_angle
from rosbot_patrol.simulation.actors import (
    POSTURES,
    RESERVED_POSTURES,
    Look,
    Posture,
    draw_look,
    hydrant_body,
    look_named,
    person_body,
    person_pose_parts,
)
from rosbot_patrol.simulation.matrices import Matrix, from_pose2d
from rosbot_patrol.simulation.scene import Body, identity
from rosbot_patrol.simulation.slices import slice_bodies

MODELS = ("person", "fire_hydrant")

_TURN_RATE = 2.5  # of a walking person [rad/s]
_CYCLE = 1.3  # length of two steps [m]
_SWING = 0.22  # how far a foot goes before and behind the body [m]
_ARRIVED = 0.05
_ROOM = 0.42  # a person stops that far before the robot [m]


def _posture_named(actor: str, posture: str) -> Posture:
    for known in (*POSTURES, *RESERVED_POSTURES):
        if known == (posture or "standing"):
            return known
    known_ones = ", ".join((*POSTURES, *RESERVED_POSTURES))
    raise WorldError(f"actor '{actor}'", f"cannot be '{posture}', expected one of {known_ones}")


class Walker:
    """One actor.

    Args:
        name: unique in the world.
        model: person or fire_hydrant.
        look: name of a person's look, "" for one drawn.
        pose: where it stands.
        rng: draws the look.
        posture: how a person holds itself, "" stands.

    Raises:
        WorldError: the model, the look or the posture is not known.
    """

    def __init__(
        self, name: str, model: str, look: str, pose: Pose2D, rng: np.random.Generator, *, posture: str = ""
    ) -> None:
        self.name = name
        self.model = model
        self.pose = pose
        self.is_walking = False
        self._look: Look | None = None
        self._posture = _posture_named(name, posture)
        self._phase = 0.0
        self._path: list[Pose2D] = []
        self._next = 0
        self._speed = 0.0
        self._loop = False
        self._feet: dict[float, NDArray[np.float64]] = {}
        if model == "person":
            self._look = look_named(look) if look else draw_look(rng)
            self.body: Body = person_body(name, self._look)
        elif model == "fire_hydrant":
            self.body = hydrant_body(name)
        else:
            raise WorldError(f"actor '{name}'", f"is of the model '{model}', expected one of {', '.join(MODELS)}")

    @property
    def is_warm(self) -> bool:
        """Whether a motion sensor can notice it."""
        return self.model == "person"

    @property
    def look_name(self) -> str:
        """Name of the person's look, "" of what has none."""
        return "" if self._look is None else str(getattr(self._look, "name", ""))

    @property
    def matrix(self) -> Matrix:
        """world_from_body."""
        return from_pose2d(self.pose)

    def walk(self, path: Sequence[Pose2D], speed: float, loop: bool = False) -> None:
        """Walk along points at a speed [m/s]; a single point with speed 0 puts it there.

        Raises:
            WorldError: no points, a number that is not finite, or a path without speed.
        """
        numbers = [speed, *(v for p in path for v in p)]
        if not path or not all(map(math.isfinite, numbers)):
            raise WorldError(f"actor '{self.name}'", "needs a path of at least one point, of finite numbers")
        if speed <= 0.0 and (len(path) > 1 or speed < 0.0):
            raise WorldError(f"actor '{self.name}'", f"cannot walk {len(path)} points at {speed} m/s")
        if speed == 0.0:
            self.pose, self._path = path[0], []
        else:
            self._path, self._next, self._speed, self._loop = list(path), 0, speed, loop
        self.is_walking = False

    def step(self, dt: float, robot: Pose2D | None) -> bool:
        """Advance by `dt` [s]; returns whether it moved. It stops before the robot until that has gone."""
        if not self._path:
            self.is_walking = False
            return False
        goal = self._path[self._next]
        gap = distance(self.pose, goal)
        if gap < _ARRIVED:
            return self._arrive(goal, dt)
        heading = math.atan2(goal.y - self.pose.y, goal.x - self.pose.x)
        error = angle_difference(heading, self.pose.yaw)
        turn = min(max(error, -_TURN_RATE * dt), _TURN_RATE * dt)
        stride = min(self._speed * dt * max(math.cos(error), 0.0), gap) if abs(error) < 1.2 else 0.0
        yaw = wrap_angle(self.pose.yaw + turn)
        if abs(error - turn) < 1e-9:
            yaw = heading
        moved = Pose2D(self.pose.x + stride * math.cos(yaw), self.pose.y + stride * math.sin(yaw), yaw)
        if robot is not None and distance(moved, robot) < min(_ROOM, distance(self.pose, robot)):
            moved, stride = self.pose, 0.0
        changed = moved != self.pose
        self.pose = moved
        self.is_walking = stride > 0.0
        self._phase = (self._phase + stride / _CYCLE) % 1.0
        return changed

    def pose_parts(self) -> Matrix | None:
        """body_from_visuals of a person's limbs, None for what has none."""
        if self._look is None:
            return None
        return person_pose_parts(self._look, self._phase, self.is_walking, self._posture)

    def cut(self, height: float) -> NDArray[np.float64]:
        """Circles (x, y, radius) that a planar lidar meets at a height [m], shape (C, 3), legs swung."""
        feet = self._feet.get(height)
        if feet is None:
            feet = self._feet[height] = slice_bodies([_at_origin(self.body)], height).circles
        swing = _SWING * math.sin(math.tau * self._phase) if self.is_walking and self.is_warm else 0.0
        c, s = math.cos(self.pose.yaw), math.sin(self.pose.yaw)
        x = feet[:, 0] + swing * np.sign(feet[:, 1]) * (1.0 if height < 0.8 else 0.0)
        y = feet[:, 1]
        return np.column_stack((self.pose.x + c * x - s * y, self.pose.y + s * x + c * y, feet[:, 2]))

    def _arrive(self, goal: Pose2D, dt: float) -> bool:
        if self._next + 1 < len(self._path) or self._loop:
            self._next = (self._next + 1) % len(self._path)
            return False
        error = angle_difference(goal.yaw, self.pose.yaw)
        turn = min(max(error, -_TURN_RATE * dt), _TURN_RATE * dt)
        self.pose = Pose2D(self.pose.x, self.pose.y, wrap_angle(self.pose.yaw + turn))
        self.is_walking = False
        if abs(error) <= _TURN_RATE * dt:
            self._path = []
        return turn != 0.0


def cuts(walkers: Iterable[Walker], height: float) -> NDArray[np.float64]:
    """Circles of all actors at a height, shape (C, 3)."""
    parts = [w.cut(height) for w in walkers]
    return np.vstack(parts) if parts else np.zeros((0, 3))


def _at_origin(body: Body) -> Body:
    if np.array_equal(body.pose, identity()):
        return body
    return Body(name=body.name, kind=body.kind, collisions=body.collisions)
