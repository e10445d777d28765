"""Lines of sight in space, exact against the collision shapes: a sofa hides a cat, a table does not hide a person."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.simulation.scene.matrices import Matrix
from rosbot_patrol.simulation.scene.scene import Body, Mover
from rosbot_patrol.simulation.scene.shapes import triangles_of
from rosbot_patrol.simulation.scene.sight_kernels import meets

Point = NDArray[np.float64]


class Obstruction:
    """Occlusion by some bodies in their poses; their triangles are made at the first query.

    Args:
        bodies: the bodies; planes are left out, because nobody looks from below the floor.
    """

    def __init__(self, bodies: Sequence[Body]) -> None:
        self._bodies = tuple(bodies)
        self._parts: tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]] | None = None

    def hides(self, eye: Point, point: Point) -> bool:
        """Whether a body lies between two points, each of shape (3,), in the world frame [m]."""
        if self._parts is None:
            self._parts = _parts_of(self._bodies)
        return bool(meets(eye, point, *self._parts))


class Sight:
    """Lines of sight through a house with moving doors.

    Args:
        bodies: static bodies.
    """

    def __init__(self, bodies: Sequence[Body]) -> None:
        self._still = Obstruction(bodies)
        self._leaves: dict[str, tuple[Body, Obstruction]] = {}

    def share(self, eye: Sequence[float], points: Sequence[Sequence[float]], doors: Iterable[Mover]) -> float:
        """Share of the points that are visible, 0 none to 1 all of them.

        Args:
            eye: the viewpoint, in the world frame [m].
            points: the points to see.
            doors: doors in their present positions.
        """
        doors = tuple(doors)
        seen = 0
        for point in points:
            a, b = np.array(eye, float), np.array(point, float)
            if not self._still.hides(a, b) and not any(self._hidden_by(door, a, b) for door in doors):
                seen += 1
        return seen / len(points) if points else 0.0

    def _hidden_by(self, door: Mover, eye: Point, point: Point) -> bool:
        if door.name not in self._leaves or self._leaves[door.name][0] is not door.body:
            leaf = Body(name=door.name, collisions=door.body.collisions)
            self._leaves[door.name] = (door.body, Obstruction([leaf]))
        body_from_world = np.linalg.inv(door.matrix)
        return self._leaves[door.name][1].hides(_moved(body_from_world, eye), _moved(body_from_world, point))


def _parts_of(bodies: Sequence[Body]) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]:
    triangles = []
    for body in bodies:
        for part in body.collisions:
            if part.shape.kind == "plane":
                continue
            pose = body.pose @ part.pose
            vertices, faces = triangles_of(part.shape)
            triangles.append((vertices @ pose[:3, :3].T + pose[:3, 3])[faces])
    triangles = [part for part in triangles if len(part)]
    if not triangles:
        return np.zeros((0, 2, 3)), np.zeros((0, 3, 3)), np.zeros(1, np.int64)
    bounds = np.array([(part.min(axis=(0, 1)), part.max(axis=(0, 1))) for part in triangles])
    begins = np.cumsum([0, *map(len, triangles)])
    return bounds, np.ascontiguousarray(np.concatenate(triangles)), begins.astype(np.int64)


def _moved(pose: Matrix, point: Point) -> Point:
    moved: Point = np.ascontiguousarray(pose[:3, :3] @ point + pose[:3, 3])
    return moved
