"""A map compared with the true walls of its world.

A wall cell of the map is right if a true one is at most one cell away. A true one is found if the map has one as close;
`f1` combines both. True walls that the lidar cannot see from any place that the robot reaches, such as the wall behind
a cupboard, need not be found. `error_m` is the mean distance of the centres of the map's wall cells from the true
walls. `floor` is the share of the true floor that the map knows as free. The centres of a perfect map are 1.1 to 1.8 cm
off: a wall runs anywhere through its cells, or along their edges.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from rosbot_patrol.amcl.scan_model.field_kernels import cast_ray
from rosbot_patrol.amcl.scan_model.likelihood_field import blocked_distances
from rosbot_patrol.errors import MapError
from rosbot_patrol.grid import Grid, GridInfo
from rosbot_patrol.maps.distance_kernels import bounded_distances
from rosbot_patrol.maps.occupancy import FREE, OCCUPIED
from rosbot_patrol.simulation.scene.floor_plan import floor_plan
from rosbot_patrol.simulation.sdf.world import load_world

HEIGHT = 0.158  # height of the lidar's plane [m]
FINE = 0.01  # cell size of the plan that the error is measured on [m]
RADIUS = 0.2  # radius of the robot, which must have room at a viewpoint [m]
EACH, BEAMS, REACH = 0.2, 720, 12.0  # spacing of the viewpoints [m], number of beams, their range [m]
FAR = 1.0  # larger distances from all walls count as this [m]

Bounds = tuple[tuple[float, float], tuple[float, float]]


@dataclass(frozen=True)
class MapFigures:
    """Quality figures of a map; see the module."""

    f1: float
    precision: float
    recall: float
    error_m: float
    floor: float


def plan(world: Path, bounds: Bounds, resolution: float) -> Grid:
    """The true floor plan of a world at the lidar's height, seen from (0, 0)."""
    low, high = bounds
    width, height = (round((b - a) / resolution) for a, b in zip(low, high, strict=True))
    info = GridInfo(resolution=resolution, width=width, height=height, origin_x=low[0], origin_y=low[1])
    return floor_plan(load_world(world).bodies, info, height=HEIGHT, start=(0.0, 0.0))


def bounds_of(found: Grid, around: float = 1.0) -> Bounds:
    """Bounds of a map's known part with `around` metres of margin, on whole cells."""
    info, margin = found.info, round(around / found.info.resolution)
    ys, xs = np.nonzero(found.cells >= 0)
    low = int(xs.min()) - margin, int(ys.min()) - margin
    high = int(xs.max()) + 1 + margin, int(ys.max()) + 1 + margin
    at = [(info.origin_x + x * info.resolution, info.origin_y + y * info.resolution) for x, y in (low, high)]
    return at[0], at[1]


def map_figures(found: Grid, world: Path, bounds: Bounds | None = None) -> MapFigures:
    """Compare a map's walls with the true ones."""
    bounds = bounds or bounds_of(found)
    low, cell = bounds[0], found.info.resolution
    fine, coarse = plan(world, bounds, FINE), plan(world, bounds, cell)
    origin = (found.info.origin_x, found.info.origin_y)
    ys, xs = np.nonzero(found.cells == OCCUPIED)
    centres = np.column_stack((xs, ys)) * cell + origin + 0.5 * cell
    places = np.floor((centres - low) / FINE).astype(int)
    inside = ((places >= 0) & (places < fine.cells.shape[::-1])).all(axis=1)
    far = np.full(len(places), FAR)
    distances = bounded_distances(fine.cells == OCCUPIED, round(FAR / FINE)) * FINE
    far[inside] = distances[places[inside, 1], places[inside, 0]]
    near_found = bounded_distances(np.ascontiguousarray(found.cells == OCCUPIED), 10)
    near_truth = bounded_distances(coarse.cells == OCCUPIED, 10)
    shift = np.round((np.array(low) - origin) / cell).astype(int)  # from the plan's cells to the map's
    visible = np.argwhere((coarse.cells == OCCUPIED) & _seen_walls(fine, coarse.info))[:, ::-1]
    recall = float(np.mean(_at(near_found, visible + shift, 10.0) < 1.5))
    gaps = _at(near_truth, np.floor((centres - low) / cell).astype(int), 10.0)
    precision = float(np.mean(gaps < 1.5))
    is_free = _at((found.cells == FREE).astype(float), np.argwhere(coarse.cells == FREE)[:, ::-1] + shift, 0.0)
    return MapFigures(
        f1=2.0 * recall * precision / max(recall + precision, 1e-9),
        precision=precision,
        recall=recall,
        error_m=float(far.mean()),
        floor=float(is_free.mean()),
    )


def _seen_walls(fine: Grid, info: GridInfo) -> np.ndarray:
    """Cells of a coarser grid on surfaces that a lidar sees from places reachable from (0, 0)."""
    room = (bounded_distances(fine.cells != FREE, round(RADIUS / FINE) + 1) * FINE > RADIUS).astype(np.uint8)
    _, parts = cv2.connectedComponents(room, connectivity=4)
    ix, iy = fine.info.cell_of(0.0, 0.0)
    if not room[iy, ix]:
        raise MapError("floor plan", f"the robot has no room at (0, 0): something is within {RADIUS} m")
    step = round(EACH / FINE)
    rows, columns = np.nonzero(parts[::step, ::step] == parts[iy, ix])
    field = blocked_distances(fine, 3.0)
    place = (field.values, field.origin_x, field.origin_y, field.resolution, REACH)
    seen = np.zeros(info.shape, dtype=np.uint8)
    angles = np.linspace(-np.pi, np.pi, BEAMS, endpoint=False)
    for row, column in zip(rows * step, columns * step, strict=True):
        x, y = fine.info.centre_of(int(column), int(row))
        ranges = np.array([cast_ray(x, y, angle, *place) for angle in angles.tolist()])
        hits = ranges < REACH
        ends = np.column_stack((x + ranges * np.cos(angles), y + ranges * np.sin(angles)))[hits]
        cells = np.floor((ends - (info.origin_x, info.origin_y)) / info.resolution).astype(int)
        seen[cells[:, 1].clip(0, info.height - 1), cells[:, 0].clip(0, info.width - 1)] = 1
    return cv2.dilate(seen, np.ones((3, 3), np.uint8)) > 0


def _at(field: np.ndarray, cells: np.ndarray, outside: float) -> np.ndarray:
    """Values of a field at cells (ix, iy), shape (N, 2)."""
    inside = ((cells >= 0) & (cells < field.shape[::-1])).all(axis=1)
    values = np.full(len(cells), outside)
    values[inside] = field[cells[inside, 1], cells[inside, 0]]
    return values
