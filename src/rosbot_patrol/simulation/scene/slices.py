"""Horizontal section through a scene at one height, for a planar lidar, a range sensor or a view at eye level.

The section of a convex shape is a polygon or a circle, and exact. A lying cylinder or capsule is cut as a prism of 24
sides, a mesh triangle by triangle.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.simulation.scene import raycast_kernels as kernels
from rosbot_patrol.simulation.scene.matrices import Matrix, is_upright
from rosbot_patrol.simulation.scene.scene import Body, Shape
from rosbot_patrol.simulation.scene.shapes import triangles_of

Array = NDArray[np.float64]

_SIDES = 24
_GROUP = 16  # segments per group
_SQUARE = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])
_CUBE = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
_CUBE_EDGES = np.array([(a, b) for a in range(8) for b in range(a + 1, 8) if bin(a ^ b).count("1") == 1])


@dataclass(frozen=True)
class Slice:
    """Segments (x0, y0, x1, y1), shape (S, 4), and circles (x, y, radius), shape (C, 3), in the world frame.

    `groups` are circles around runs of the segments, shape (G, 4), so that a ray need not test every segment.
    """

    segments: Array
    circles: Array
    groups: Array = field(default_factory=lambda: kernels.NO_GROUPS)

    def plus(self, other: Slice) -> Slice:
        """Combine both sections."""
        if not len(other.segments) and not len(other.circles):
            return self
        segments = np.vstack((self.segments, other.segments)) if len(other.segments) else self.segments
        circles = np.vstack((self.circles, other.circles)) if len(other.circles) else self.circles
        return Slice(np.ascontiguousarray(segments), np.ascontiguousarray(circles), self.groups)

    def placed(self, pose: Pose2D) -> Slice:
        """Transform the section from the body frame to the body's pose."""
        c, s = math.cos(pose.yaw), math.sin(pose.yaw)
        turn, shift = np.array([[c, s], [-s, c]]), np.array([pose.x, pose.y])
        circles = self.circles.copy()
        circles[:, :2] = self.circles[:, :2] @ turn + shift
        ends = self.segments.reshape(-1, 2) @ turn + shift
        return Slice(ends.reshape(-1, 4), circles)

    def cast(self, x: float, y: float, first: float, step: float, count: int, *, longest: float) -> Array:
        """Lengths of a fan of beams from a point; `longest` if nothing is met [m], shape (count,)."""
        ranges = np.full(count, float(longest))
        place = (float(x), float(y), float(first), float(step))
        kernels.cast_fan(*place, self.segments, self.circles, self.groups, ranges)
        return ranges

    def is_blocked(self, start: tuple[float, float], end: tuple[float, float]) -> bool:
        """Whether something lies between two points."""
        x0, y0, x1, y1 = map(float, (*start, *end))
        return bool(kernels.is_blocked(x0, y0, x1, y1, self.segments, self.circles, self.groups))


EMPTY = Slice(kernels.NO_SEGMENTS, kernels.NO_CIRCLES)


def slice_bodies(bodies: Iterable[Body], height: float) -> Slice:
    """Section through the collision shapes of bodies at a height [m]."""
    segments: list[Array] = []
    circles: list[Array] = []
    boxes: list[tuple[tuple[float, ...], Matrix]] = []
    for body in bodies:
        for collision in body.collisions:
            pose = body.pose @ collision.pose
            if collision.shape.kind == "box" and is_upright(pose):
                boxes.append((collision.shape.size, pose))
                continue
            cut = slice_shape(collision.shape, pose, height)
            segments.append(cut.segments)
            circles.append(cut.circles)
    segments.append(_cut_upright_boxes(boxes, height))
    every, groups = _grouped(np.vstack(segments))
    return Slice(every, np.ascontiguousarray(np.vstack([kernels.NO_CIRCLES, *circles])), groups)


def _cut_upright_boxes(boxes: Sequence[tuple[tuple[float, ...], Matrix]], height: float) -> Array:
    """Outlines of boxes with a vertical z axis, from their sizes and poses, shape (S, 4)."""
    if not boxes:
        return kernels.NO_SEGMENTS
    sizes, poses = np.array([size for size, _ in boxes]), np.array([pose for _, pose in boxes])
    met = np.abs(poses[:, 2, 3] - height) < sizes[:, 2] / 2.0
    sizes, poses = sizes[met], poses[met]
    corners = _SQUARE * sizes[:, None, :2]
    placed = np.einsum("nij,nkj->nki", poses[:, :2, :2], corners) + poses[:, None, :2, 3]
    outlines: Array = np.concatenate([placed, np.roll(placed, -1, axis=1)], axis=2).reshape(-1, 4)
    return outlines


def _grouped(segments: Array) -> tuple[Array, Array]:
    """The segments sorted so that neighbours are consecutive, and their groups."""
    if len(segments) < 2 * _GROUP:
        return np.ascontiguousarray(segments), kernels.NO_GROUPS
    middles = (segments[:, :2] + segments[:, 2:]) / 2.0
    runs = [np.arange(len(segments))]
    while any(len(run) > _GROUP for run in runs):
        runs = [half for run in runs for half in _halves(middles, run)]
    ordered = np.ascontiguousarray(segments[np.concatenate(runs)])
    groups, begin = [], 0
    for run in runs:
        ends = ordered[begin : begin + len(run)].reshape(-1, 2)
        begin += len(run)
        centre = (ends.min(axis=0) + ends.max(axis=0)) / 2.0
        radius = float(np.linalg.norm(ends - centre, axis=1).max())
        groups.append((*centre, radius * (1.0 + 1e-9) + 1e-9, len(run)))
    return ordered, np.array(groups)


def _halves(middles: Array, run: NDArray[np.int64]) -> list[NDArray[np.int64]]:
    if len(run) <= _GROUP:
        return [run]
    axis = int(np.argmax(np.ptp(middles[run], axis=0)))
    run = run[np.argsort(middles[run, axis], kind="stable")]
    return [run[: len(run) // 2], run[len(run) // 2 :]]


def slice_shape(shape: Shape, world_from_shape: Matrix, height: float) -> Slice:
    """Section through one shape."""
    if shape.kind == "plane":
        return EMPTY
    if shape.kind == "box":
        corners = (_CUBE * shape.size) @ world_from_shape[:3, :3].T + world_from_shape[:3, 3]
        return Slice(_cut_convex(corners, _CUBE_EDGES, height), kernels.NO_CIRCLES)
    if shape.kind == "sphere" or (shape.kind in ("cylinder", "capsule") and is_upright(world_from_shape)):
        return Slice(kernels.NO_SEGMENTS, _cut_round(shape, world_from_shape, height))
    if shape.kind == "mesh":
        vertices, faces = triangles_of(shape)
        placed = vertices @ world_from_shape[:3, :3].T + world_from_shape[:3, 3]
        return Slice(_cut_triangles(placed, faces, height), kernels.NO_CIRCLES)
    return Slice(_cut_lying(shape, world_from_shape, height), kernels.NO_CIRCLES)


def _cut_round(shape: Shape, pose: Matrix, height: float) -> Array:
    rise = abs(height - float(pose[2, 3]))
    radius = shape.size[0]
    straight = shape.size[1] / 2.0 if shape.kind != "sphere" else 0.0
    if rise > straight:
        if shape.kind == "cylinder" or rise - straight >= radius:
            return kernels.NO_CIRCLES
        radius = math.sqrt(radius**2 - (rise - straight) ** 2)
    return np.array([[pose[0, 3], pose[1, 3], radius]])


def _cut_lying(shape: Shape, pose: Matrix, height: float) -> Array:
    radius, length = shape.size[0], shape.size[1]
    if shape.kind == "capsule":
        length += 2.0 * radius
    angles = np.linspace(0.0, math.tau, _SIDES, endpoint=False)
    ring = np.column_stack((radius * np.cos(angles), radius * np.sin(angles)))
    corners = np.vstack([np.column_stack((ring, np.full(_SIDES, z))) for z in (-length / 2.0, length / 2.0)])
    i = np.arange(_SIDES)
    around = np.column_stack((i, (i + 1) % _SIDES))
    edges = np.vstack((around, around + _SIDES, np.column_stack((i, i + _SIDES))))
    return _cut_convex(corners @ pose[:3, :3].T + pose[:3, 3], edges, height)


def _cut_convex(corners: Array, edges: NDArray[np.int64], height: float) -> Array:
    """Outline of the section through a convex body with given corners and edges, shape (S, 4)."""
    a, b = corners[edges[:, 0]], corners[edges[:, 1]]
    crosses = (a[:, 2] - height) * (b[:, 2] - height) < 0.0
    if not crosses.any():
        return kernels.NO_SEGMENTS
    a, b = a[crosses], b[crosses]
    t = (height - a[:, 2]) / (b[:, 2] - a[:, 2])
    points = a[:, :2] + t[:, None] * (b[:, :2] - a[:, :2])
    centre = points.mean(axis=0)
    points = points[np.argsort(np.arctan2(points[:, 1] - centre[1], points[:, 0] - centre[0]))]
    return np.column_stack((points, np.roll(points, -1, axis=0)))


def _cut_triangles(vertices: Array, faces: NDArray[np.int64], height: float) -> Array:
    """Sections of triangles, each a segment, shape (S, 4)."""
    above = vertices[:, 2] > height
    hit = faces[above[faces].any(axis=1) & ~above[faces].all(axis=1)]
    if not len(hit):
        return kernels.NO_SEGMENTS
    # The corner that is alone on its side, then the two others.
    alone = above[hit] == (above[hit].sum(axis=1) == 1)[:, None]
    first = np.argmax(alone, axis=1)
    rows = np.arange(len(hit))
    p = vertices[hit[rows, first]]
    ends = []
    for k in (1, 2):
        q = vertices[hit[rows, (first + k) % 3]]
        t = (height - p[:, 2]) / (q[:, 2] - p[:, 2])
        ends.append(p[:, :2] + t[:, None] * (q[:, :2] - p[:, :2]))
    return np.column_stack(ends)
