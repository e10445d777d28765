"""Triangles of a scene's shapes, for the camera: positions, normals and texture coordinates in metres.

The texture coordinate of a vertex is its place on its face in metres from the shape's middle. So a texture keeps its
size on a box of any size. `span` is the face's width and height in metres, for pictures that should fill it once.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.errors import WorldError
from rosbot_patrol.simulation.meshes.files import load_mesh
from rosbot_patrol.simulation.scene.scene import Body, Shape

_SIDES = 20
_RINGS = 12
_SHARP = 0.643  # cosine
_MOST_MEETING = 64  # corners at one place; with more, as at the tip of a cone, each stays flat


@dataclass(frozen=True)
class Mesh:
    """Triangles in the frame of their shape.

    Attributes:
        positions, normals: shape (V, 3).
        uv: place on the face [m], shape (V, 2).
        span: size of that face [m], shape (V, 2).
        faces: corners of each triangle, shape (F, 3).
    """

    positions: NDArray[np.float64]
    normals: NDArray[np.float64]
    uv: NDArray[np.float64]
    span: NDArray[np.float64]
    faces: NDArray[np.int64]


def mesh_of(shape: Shape) -> Mesh:
    """Make the triangles of any shape.

    Raises:
        WorldError: a mesh without file and triangles, or a size with too few numbers.
    """
    needed = {"box": 3, "cylinder": 2, "sphere": 1, "capsule": 2, "plane": 2, "mesh": 0}[shape.kind]
    if len(shape.size) < needed:
        raise WorldError(shape.kind, f"needs {needed} sizes, has {shape.size}")
    size = shape.size
    if shape.kind == "box":
        return box(size[0], size[1], size[2])
    if shape.kind == "plane":
        return plane(size[0], size[1])
    if shape.kind == "cylinder":
        return cylinder(size[0], size[1])
    if shape.kind == "sphere":
        return sphere(size[0], 0.0)
    if shape.kind == "capsule":
        return sphere(size[0], size[1])
    return _free_mesh(shape)


def box(x: float, y: float, z: float) -> Mesh:
    """A box about its middle."""
    unit, normals, signs, faces = _unit_box()
    half = np.array([x, y, z]) / 2
    across = half[_BOX_AXES].repeat(4, axis=0)
    return Mesh(unit * half, normals, across * signs, 2 * across, faces)


_BOX_AXES = np.repeat([[1, 2], [0, 2], [0, 1]], 2, axis=0)
"""The axes along which each of the six faces of a box is wide and high."""


@functools.lru_cache(maxsize=1)
def _unit_box() -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]:
    """Corners of the box of half sizes 1, normals, signs of the texture coordinates, and triangles."""
    corners, normals, signs = np.zeros((6, 4, 3)), np.zeros((6, 4, 3)), np.zeros((6, 4, 2))
    for face, (u, v) in enumerate(_BOX_AXES):
        axis, sign = face // 2, 2.0 * (face % 2) - 1.0
        turned = -sign if axis == 1 else sign
        corners[face, :, axis] = normals[face, :, axis] = sign
        corners[face, :, u] = np.array([-1, 1, 1, -1]) * turned
        corners[face, :, v] = np.array([-1, -1, 1, 1])
        signs[face] = np.stack([corners[face, :, u] * turned, corners[face, :, v]], axis=1)
    faces = _split(np.arange(24).reshape(6, 4))
    parts = corners.reshape(-1, 3), normals.reshape(-1, 3), signs.reshape(-1, 2), faces
    _protect(*parts)
    return parts


def _protect(*arrays: NDArray[Any]) -> None:
    """Forbid writing into arrays that are kept and given again."""
    for array in arrays:
        array.flags.writeable = False


def plane(x: float, y: float) -> Mesh:
    """An upward rectangle in z = 0."""
    corners = np.array([[-x, -y, 0], [x, -y, 0], [x, y, 0], [-x, y, 0]]) / 2
    normals = np.tile([0.0, 0.0, 1.0], (4, 1))
    return Mesh(corners, normals, corners[:, :2].copy(), np.tile([x, y], (4, 1)), _split(np.arange(4).reshape(1, 4)))


def cylinder(radius: float, length: float, *, sides: int = _SIDES) -> Mesh:
    """A cylinder about its middle, along z, with its two caps."""
    angle, ring, normals, faces = _unit_cylinder(sides)
    low, high = ring * radius - [0, 0, length / 2], ring * radius + [0, 0, length / 2]
    around, n = 2 * np.pi * radius, sides + 1
    uv, span = np.empty((4 * n, 2)), np.empty((4 * n, 2))
    uv[:n, 0] = uv[n : 2 * n, 0] = angle * radius - around / 2
    uv[:n, 1], uv[n : 2 * n, 1] = -length / 2, length / 2
    uv[2 * n : 3 * n], uv[3 * n :] = low[:, :2], high[:, :2]
    span[: 2 * n], span[2 * n :] = (around, length), 2 * radius
    return Mesh(np.concatenate([low, high, low, high]), normals, uv, span, faces)


@functools.lru_cache(maxsize=8)
def _unit_cylinder(sides: int) -> Any:
    """Angles and ring of radius 1, shape (sides + 1, 3); normals and triangles of the whole cylinder."""
    angle = np.linspace(0, 2 * np.pi, sides + 1)
    ring = np.stack([np.cos(angle), np.sin(angle), np.zeros(sides + 1)], axis=1)
    down, up = np.tile([0.0, 0, -1], (sides + 1, 1)), np.tile([0.0, 0, 1], (sides + 1, 1))
    n = sides + 1
    i = np.arange(sides)
    walls = _split(np.stack([i, i + 1, n + i + 1, n + i], axis=1))
    fan = np.arange(1, sides - 1)
    bottom = np.stack([np.zeros_like(fan), fan + 1, fan], axis=1) + 2 * n
    top = np.stack([np.zeros_like(fan), fan, fan + 1], axis=1) + 3 * n
    parts = angle, ring, np.vstack([ring, ring, down, up]), np.vstack([walls, bottom, top])
    _protect(*parts)
    return parts


def sphere(radius: float, length: float, *, sides: int = _SIDES, rings: int = _RINGS) -> Mesh:
    """A sphere, or, with a length, a capsule along z with a cylindrical part of that length."""
    polar = np.linspace(0, np.pi, rings + 1)
    polar = np.insert(polar, rings // 2, np.pi / 2)
    offset = np.where(np.arange(len(polar)) <= rings // 2, length / 2, -length / 2)
    angle = np.linspace(0, 2 * np.pi, sides + 1)
    a, p = np.meshgrid(angle, polar)
    normals = np.stack([np.cos(a) * np.sin(p), np.sin(a) * np.sin(p), np.cos(p)], axis=-1)
    positions = normals * radius
    positions[..., 2] += offset[:, None]
    uv = np.stack([(a - np.pi) * radius, positions[..., 2]], axis=-1)
    span = np.tile([2 * np.pi * radius, 2 * radius + length], (normals.shape[0] * normals.shape[1], 1))
    return Mesh(positions.reshape(-1, 3), normals.reshape(-1, 3), uv.reshape(-1, 2), span, grid_faces(*a.shape))


@functools.lru_cache(maxsize=256)
def grid_faces(rows: int, columns: int) -> NDArray[np.int64]:
    """Triangles between neighbours of a (rows, columns) grid of vertices, rows downwards, columns to the left.

    The array is cached and read-only.
    """
    i = np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)[None, :]
    quads = np.stack([i, i + columns, i + columns + 1, i + 1], axis=-1)
    faces = _split(quads.reshape(-1, 4))
    _protect(faces)
    return faces


def smooth_normals(vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> NDArray[np.float64]:
    """Normals of the vertices: area-weighted mean of their triangles' normals, with coincident vertices merged."""
    weighted = _cross(vertices, faces)
    place = _places(vertices)
    at = place[faces].T.ravel()
    count = int(place.max()) + 1
    sums = np.empty((count, 3))
    for axis, part in enumerate(weighted.T):
        sums[:, axis] = np.bincount(at, np.concatenate([part] * 3), count)
    normals: NDArray[np.float64] = (sums / np.maximum(_lengths(sums), 1e-12)[:, None])[place]
    return normals


def _cross(vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> NDArray[np.float64]:
    """Normals of triangles, with twice their area as length."""
    corners = vertices[faces]
    (ax, ay, az), (bx, by, bz) = (corners[:, 1] - corners[:, 0]).T, (corners[:, 2] - corners[:, 0]).T
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=1)


def _lengths(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    x, y, z = vectors.T
    lengths: NDArray[np.float64] = np.sqrt(x * x + y * y + z * z)
    return lengths


def _places(vertices: NDArray[np.float64]) -> NDArray[np.int64]:
    """A number for each vertex, equal for coincident ones (to 10 um)."""
    rounded = np.round(vertices, 5)
    order = np.lexsort(rounded.T)
    ranked = rounded[order]
    place = np.empty(len(vertices), np.int64)
    place[order[:1]] = 0
    place[order[1:]] = np.cumsum((ranked[1:] != ranked[:-1]).any(axis=1))
    return place


def sharp_normals(
    vertices: NDArray[np.float64], faces: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Corners of the triangles, shape (3 F, 3), and their normals: smooth except across edges sharper than 50 deg."""
    weighted = _cross(vertices, faces)
    flat = weighted / np.maximum(_lengths(weighted), 1e-12)[:, None]
    sums = np.repeat(weighted, 3, axis=0)
    for meeting in _meetings(_places(vertices)[faces.ravel()]):
        own, theirs = flat[meeting // 3], weighted[meeting // 3]
        is_near = np.einsum("gik,gjk->gij", own, own) >= _SHARP
        sums[meeting] = np.einsum("gij,gjk->gik", is_near, theirs)
    lengths = _lengths(sums)[:, None]
    up = np.array([0.0, 0.0, 1.0])  # normal of a triangle without area
    return vertices[faces.ravel()], np.where(lengths > 0.0, sums / np.maximum(lengths, 1e-300), up)


def _meetings(place: NDArray[np.int64]) -> Iterator[NDArray[np.int64]]:
    """Indices of coincident corners, all places with N corners at once: shapes (places, N)."""
    order = np.argsort(place, kind="stable")
    begins = np.flatnonzero(np.diff(place[order], prepend=-1))
    counts = np.diff(begins, append=len(order))
    for count in np.unique(counts):
        if 1 < count <= _MOST_MEETING:
            yield order[begins[counts == count][:, None] + np.arange(count)]


def triangles_of(shape: Shape) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Vertices (V, 3) and triangles (F, 3) of any shape, without the camera's extras. Raises WorldError."""
    if shape.kind == "mesh":
        return _triangles(shape)
    mesh = mesh_of(shape)
    return mesh.positions, mesh.faces


def _triangles(shape: Shape) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    if shape.vertices is not None and shape.faces is not None:
        vertices, faces = np.asarray(shape.vertices, float), np.asarray(shape.faces, np.int64)
    elif shape.mesh is not None:
        vertices, faces = load_mesh(shape.mesh)
    else:
        raise WorldError("mesh", "has neither a file nor triangles")
    if len(shape.size) >= 3:
        vertices = vertices * np.array(shape.size[:3])
        if np.prod(shape.size[:3]) < 0.0:
            faces = faces[:, ::-1]  # mirrored: keep the faces outward
    return vertices, faces


def _free_mesh(shape: Shape) -> Mesh:
    vertices, faces = _triangles(shape)
    if shape.detail is not None:
        uv = shape.detail.uv
        return Mesh(vertices, shape.detail.normals, uv, np.maximum(np.ptp(uv, axis=0), 1e-6) + 0.0 * uv, faces)
    if shape.mesh is not None:
        vertices, normals = sharp_normals(vertices, faces)
        faces = np.arange(len(vertices)).reshape(-1, 3)
    else:
        normals = smooth_normals(vertices, faces)
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    middle, extent = (low + high) / 2, np.maximum(high - low, 1e-6)
    return Mesh(
        vertices,
        normals,
        (vertices - middle)[:, 1:],
        np.tile(extent[1:], (len(vertices), 1)),
        faces,
    )


def _split(quads: NDArray[np.int64]) -> NDArray[np.int64]:
    return np.vstack([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])


def planar_radius(body: Body) -> float:
    """Radius of the vertical cylinder about a body's origin that contains its collision shapes [m]."""
    radius = 0.0
    for collision in body.collisions:
        corners = mesh_of(collision.shape).positions @ collision.pose[:3, :3].T + collision.pose[:3, 3]
        radius = max(radius, float(np.hypot(corners[:, 0], corners[:, 1]).max()))
    return radius
