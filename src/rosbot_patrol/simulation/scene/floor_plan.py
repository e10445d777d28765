"""The floor plan of a world: the ideal map of a lidar at a given height, made from the collision shapes."""

from __future__ import annotations

import logging
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.errors import MapError
from rosbot_patrol.grid import Grid, GridInfo
from rosbot_patrol.maps.raster import seen_map, slice_hull, surface_cells
from rosbot_patrol.simulation.scene.scene import Body, Shape
from rosbot_patrol.simulation.scene.slices import slice_shape

log = logging.getLogger(__name__)

_TURNS = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)


def floor_plan(bodies: Iterable[Body], info: GridInfo, *, height: float, start: tuple[float, float]) -> Grid:
    """Make the map of a world's static bodies.

    Args:
        bodies: the world; moving bodies are left out.
        info: origin and size of the map.
        height: height of the lidar's plane above the floor [m].
        start: a point inside [m]; cells that cannot be reached from it stay unknown.

    Raises:
        MapError: the start is off the map or in a wall.
    """
    passed, filled = _cells(bodies, info, height)
    ix, iy = info.cell_of(*start)
    if not info.contains_cell(ix, iy) or filled[iy, ix]:
        raise MapError("floor plan", f"the start ({start[0]:.2f}, {start[1]:.2f}) is off the map or in a wall")
    return Grid(info, seen_map(passed, filled, ix, iy))


def filled_cells(bodies: Iterable[Body], info: GridInfo, height: float) -> NDArray[np.bool_]:
    """Cells in which static bodies stand at a height [m], shape of the grid."""
    return _cells(bodies, info, height)[1]


def _cells(bodies: Iterable[Body], info: GridInfo, height: float) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    info.require_aligned("floor plan")
    return surface_cells(info, [cut for body in bodies if body.static for cut in _slices(body, height)])


def _slices(body: Body, height: float) -> list[NDArray[np.float64]]:
    cuts = []
    for collision in body.collisions:
        if collision.shape.kind == "mesh":
            cuts += list(slice_shape(collision.shape, body.pose @ collision.pose, height).segments.reshape(-1, 2, 2))
            continue
        points = _hull_points(collision.shape)
        if points is None:
            if collision.shape.kind != "plane":
                log.warning("%s: a collision shape of kind '%s' is not drawn", body.name, collision.shape.kind)
            continue
        world_from_shape = body.pose @ collision.pose
        cut = slice_hull(points @ world_from_shape[:3, :3].T + world_from_shape[:3, 3], height)
        if len(cut) >= 3:
            cuts.append(cut)
    return cuts


def _hull_points(shape: Shape) -> NDArray[np.float64] | None:
    """Points with the shape as their convex hull (approximate for round ones), shape (N, 3)."""
    if shape.kind == "box":
        half = np.array(shape.size) / 2.0
        corners: NDArray[np.float64] = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, -1).T * half
        return corners
    if shape.kind == "cylinder":
        radius, length = shape.size
        return np.concatenate([_ring(radius, -length / 2.0), _ring(radius, length / 2.0)])
    if shape.kind == "sphere":
        return _ball(shape.size[0], 0.0)
    if shape.kind == "capsule":
        radius, length = shape.size
        return np.concatenate([_ball(radius, -length / 2.0), _ball(radius, length / 2.0)])
    return None


def _ring(radius: float, z: float) -> NDArray[np.float64]:
    return np.column_stack((radius * np.cos(_TURNS), radius * np.sin(_TURNS), np.full(len(_TURNS), z)))


def _ball(radius: float, z: float) -> NDArray[np.float64]:
    tilts = np.linspace(-np.pi / 2.0, np.pi / 2.0, 13)
    return np.concatenate([_ring(radius * np.cos(t), z + radius * np.sin(t)) for t in tilts])
