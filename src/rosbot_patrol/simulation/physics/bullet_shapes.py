"""Collision shapes for PyBullet: the parts of a body within the robot's reach, split for its limits."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.simulation.physics.bullet import pybullet
from rosbot_patrol.simulation.scene.matrices import Matrix, to_quaternion
from rosbot_patrol.simulation.scene.scene import Body, Collision, Shape
from rosbot_patrol.simulation.scene.shapes import triangles_of

Bounds = NDArray[np.float64]

FLOOR = 0.01  # lower parts count as floor: the wheels roll over them [m]
CEILING = 2.0  # parts that begin higher are out of reach [m]

_MOST_PARTS = 16  # limit for one compound shape
_MOST_FACES = 20000  # limit for one mesh shape
_HULL_DIRECTIONS = 500
_AXES = np.vstack([np.eye(3), -np.eye(3)])

_KINDS = {
    "box": pybullet.GEOM_BOX,
    "cylinder": pybullet.GEOM_CYLINDER,
    "sphere": pybullet.GEOM_SPHERE,
    "capsule": pybullet.GEOM_CAPSULE,
}


def bounds_of(part: Collision, world_from_body: Matrix) -> Bounds:
    """Lowest and highest x, y, z of a collision shape in the world [m], shape (2, 3)."""
    pose = world_from_body @ part.pose
    if part.shape.kind == "mesh":
        vertices, _ = triangles_of(part.shape)
        placed = vertices @ pose[:3, :3].T + pose[:3, 3]
        return np.stack([placed.min(axis=0), placed.max(axis=0)])
    reach = np.abs(pose[:3, :3]) @ _half_of(part.shape)
    return np.stack([pose[:3, 3] - reach, pose[:3, 3] + reach])


def touchable(body: Body) -> tuple[list[Collision], Bounds]:
    """Parts of a static body that can stop the robot, and their common bounds, shape (2, 3)."""
    kept, bounds = [], []
    for part in body.collisions:
        if part.shape.kind == "plane":
            continue
        bound = bounds_of(part, body.pose)
        if bound[1, 2] > FLOOR and bound[0, 2] < CEILING:
            kept.append(part)
            bounds.append(bound)
    every = np.array(bounds).reshape(-1, 2, 3)
    if not kept:
        return [], np.zeros((2, 3))
    return kept, np.stack([every[:, 0].min(axis=0), every[:, 1].max(axis=0)])


def shapes_of(parts: Sequence[Collision], client: int, world_from_body: Matrix | None = None) -> list[int]:
    """Make PyBullet shapes for some parts, at least one per part; returns their numbers.

    Args:
        parts: boxes, cylinders, spheres, capsules and meshes about the body's origin.
        client: number of the PyBullet client.
        world_from_body: pose of a static body: its mesh triangles on the floor or too high are left out.
    """
    plain = [part for part in parts if part.shape.kind != "mesh"]
    shapes = [_compound(plain[i : i + _MOST_PARTS], client) for i in range(0, len(plain), _MOST_PARTS)]
    meshes = [part for part in parts if part.shape.kind == "mesh"]
    if meshes:
        vertices, faces = _merged(meshes)
        if world_from_body is not None:
            faces = faces[_within_reach(vertices, faces, world_from_body)]
        shapes += [_trimesh(vertices, faces[i : i + _MOST_FACES], client) for i in range(0, len(faces), _MOST_FACES)]
    return shapes


def single_shape(parts: Sequence[Collision], client: int) -> int:
    """One shape for all parts, as a robot's link needs; for meshes or many parts it is their hull."""
    if len(parts) <= _MOST_PARTS and all(part.shape.kind != "mesh" for part in parts):
        return _compound(parts, client)
    return _hull(_merged(parts)[0], client)


def _half_of(shape: Shape) -> NDArray[np.float64]:
    if shape.kind == "box":
        return np.array(shape.size) / 2.0
    radius = shape.size[0]
    along = shape.size[1] / 2.0 if len(shape.size) > 1 else radius
    return np.array([radius, radius, along + radius if shape.kind == "capsule" else along])


def _compound(parts: Sequence[Collision], client: int) -> int:
    if len(parts) == 1:
        return _primitive(parts[0], client)
    return int(
        pybullet.createCollisionShapeArray(
            shapeTypes=[_KINDS[c.shape.kind] for c in parts],
            halfExtents=[[s / 2.0 for s in c.shape.size] if c.shape.kind == "box" else [0.1] * 3 for c in parts],
            radii=[c.shape.size[0] if c.shape.kind != "box" else 0.1 for c in parts],
            lengths=[c.shape.size[1] if c.shape.kind in ("cylinder", "capsule") else 0.1 for c in parts],
            collisionFramePositions=[c.pose[:3, 3].tolist() for c in parts],
            collisionFrameOrientations=[to_quaternion(c.pose) for c in parts],
            physicsClientId=client,
        )
    )


def _primitive(part: Collision, client: int) -> int:
    shape = part.shape
    place = {
        "collisionFramePosition": part.pose[:3, 3].tolist(),
        "collisionFrameOrientation": to_quaternion(part.pose),
        "physicsClientId": client,
    }
    if shape.kind == "box":
        half = [s / 2.0 for s in shape.size]
        return int(pybullet.createCollisionShape(pybullet.GEOM_BOX, halfExtents=half, **place))
    length = shape.size[1] if len(shape.size) > 1 else 0.0
    return int(pybullet.createCollisionShape(_KINDS[shape.kind], radius=shape.size[0], height=length, **place))


def _trimesh(vertices: NDArray[np.float64], faces: NDArray[np.int64], client: int) -> int:
    used, places = np.unique(faces, return_inverse=True)
    return int(
        pybullet.createCollisionShape(
            pybullet.GEOM_MESH,
            vertices=vertices[used].tolist(),
            indices=places.ravel().tolist(),
            flags=pybullet.GEOM_FORCE_CONCAVE_TRIMESH,
            physicsClientId=client,
        )
    )


def _hull(vertices: NDArray[np.float64], client: int) -> int:
    """The convex hull by its outermost points in many directions: moving bodies pass through triangles."""
    i = np.arange(_HULL_DIRECTIONS)
    z, turn = 1.0 - (2.0 * i + 1.0) / _HULL_DIRECTIONS, i * np.pi * (3.0 - np.sqrt(5.0))
    across = np.sqrt(1.0 - z * z)
    directions = np.vstack([np.column_stack((across * np.cos(turn), across * np.sin(turn), z)), _AXES])
    outermost = np.unique(np.argmax(vertices @ directions.T, axis=0))
    return int(
        pybullet.createCollisionShape(pybullet.GEOM_MESH, vertices=vertices[outermost].tolist(), physicsClientId=client)
    )


def _within_reach(
    vertices: NDArray[np.float64], faces: NDArray[np.int64], world_from_body: Matrix
) -> NDArray[np.bool_]:
    z = (vertices @ world_from_body[:3, :3].T + world_from_body[:3, 3])[:, 2][faces]
    within: NDArray[np.bool_] = (z.max(axis=1) > FLOOR) & (z.min(axis=1) < CEILING)
    return within


def _merged(parts: Sequence[Collision]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Triangles of all parts in the body frame."""
    vertices, faces, count = [], [], 0
    for part in parts:
        points, triangles = triangles_of(part.shape)
        vertices.append(points @ part.pose[:3, :3].T + part.pose[:3, 3])
        faces.append(triangles + count)
        count += len(points)
    return np.vstack(vertices), np.vstack(faces)
