"""Outline of the robot: reading, padding, radii, and the points used by collision checks."""

from __future__ import annotations

import ast
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.errors import ParamError
from rosbot_patrol.geometry import Pose2D, transform_points

Array = NDArray[np.float64]


def read_footprint(value: Any, name: str = "footprint") -> Array:
    """Corners, shape (N, 2), from a list or upstream's text form "[[x, y], ...]"; empty if none are given.

    Raises:
        ParamError: it is not a list of at least three pairs of finite numbers.
    """
    if isinstance(value, str):
        try:
            value = ast.literal_eval(value) if value.strip() else []
        except (ValueError, SyntaxError) as err:
            raise ParamError(name, f"expected [[x, y], ...], got {value!r}") from err
    if not isinstance(value, (list, tuple)):
        raise ParamError(name, f"expected [[x, y], ...], got {value!r}")
    if not value:
        return np.empty((0, 2))
    try:
        corners = np.array(value, dtype=np.float64)
    except (TypeError, ValueError) as err:
        raise ParamError(name, f"expected pairs of numbers, got {value!r}") from err
    if corners.ndim != 2 or corners.shape[1] != 2 or len(corners) < 3 or not np.isfinite(corners).all():
        raise ParamError(name, f"expected at least three pairs of numbers, got {value!r}")
    return corners


def circle_footprint(radius: float, corners: int = 16) -> Array:
    """Polygon of a round robot, as upstream derives it from `robot_radius`."""
    angles = np.arange(corners) * math.tau / corners
    return radius * np.column_stack((np.cos(angles), np.sin(angles)))


def padded(corners: Array, padding: float) -> Array:
    """Corners, each moved outwards by the padding in x and in y."""
    return corners + np.sign(corners) * padding


def _edge_distances(corners: Array) -> Array:
    ends = np.roll(corners, -1, axis=0)
    edges = ends - corners
    lengths = np.einsum("ij,ij->i", edges, edges)
    along = np.clip(-np.einsum("ij,ij->i", corners, edges) / np.where(lengths > 0, lengths, 1.0), 0.0, 1.0)
    distances: Array = np.hypot(*(corners + along[:, None] * edges).T)
    return distances


@dataclass(frozen=True)
class Footprint:
    """The robot's outline with and without padding, shape (N, 2) each, in the robot's frame."""

    corners: Array
    body: Array

    @classmethod
    def of(cls, value: Any, *, robot_radius: float, padding: float, name: str = "footprint") -> Footprint:
        """From upstream's parameters: `footprint` if given, else a circle of `robot_radius`."""
        corners = read_footprint(value, name)
        if not len(corners):
            corners = circle_footprint(robot_radius)
        return cls(padded(corners, padding), corners)

    @property
    def inscribed_radius(self) -> float:
        """Distance from the centre to the nearest edge [m]."""
        return float(_edge_distances(self.corners).min())

    @property
    def circumscribed_radius(self) -> float:
        """Distance from the centre to the farthest corner [m]."""
        return float(np.hypot(*self.corners.T).max())

    def at(self, pose: Pose2D) -> Array:
        """Corners at a pose, shape (N, 2)."""
        return transform_points(pose, self.corners)

    def outline(self, spacing: float) -> Array:
        """Points along the edges, at most `spacing` [m] apart, shape (M, 2), in the robot's frame."""
        pieces = []
        for start, end in zip(self.corners, np.roll(self.corners, -1, axis=0), strict=True):
            count = max(1, math.ceil(float(np.hypot(*(end - start))) / spacing))
            pieces.append(start + np.arange(count)[:, None] / count * (end - start))
        return np.ascontiguousarray(np.concatenate(pieces))
