"""Rooms of a map that nobody has marked: the wide parts of its floor, which narrow places separate.

The floor is flooded from its widest places down. Two parts that meet stay two rooms where the passage between them is
about as narrow as a door, and much narrower than both of them; otherwise the smaller one joins the larger. This is the
merge tree of the clearance, cut at doors; compare the segmentation by distance in Bormann et al., "Room Segmentation:
Survey, Implementation, and Analysis", ICRA 2016. A large hall without doors gets several points, evenly spread
(Lloyd's k-means).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.errors import MapError
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.maps.raster import flood
from rosbot_patrol.patrol.house.floor import Floor
from rosbot_patrol.patrol.house.rooms import Room, Rooms

PASSAGE = 0.25  # clearance of the narrowest way that counts [m]
TURN = 0.30  # clearance that a room's point needs [m]

_DOOR = 0.62  # largest clearance in a door [m]
_NARROW = 0.8  # and its largest share of the smaller room's
_CORE = 0.4  # floor of a room that is wider than the door to it [m^2]
_AREA = 2.0  # smallest floor of a room within the robot's reach [m^2]
_LARGE = 30.0  # floor that is looked at from one point [m^2]
_ROUNDS = 8  # of k-means
_WIDE = 0.9  # a room's point lies where the clearance is at least this share of its largest
_APART = 1.5  # distance of the base from other points [m]


def suggest_rooms(floor: Floor, start: Pose2D) -> Rooms:
    """Part a floor into rooms.

    Args:
        floor: of the map.
        start: where the robot waits; it becomes room 0.

    Returns:
        The base, and the rooms from the largest to the smallest.

    Raises:
        MapError: the start is not on the floor, or no room can be reached from it.
    """
    reached = reached_from(floor, start)
    labels = _parts(np.where(reached, floor.clearance, 0.0), floor.cell_area)
    masks = [labels == label for label in np.unique(labels[labels >= 0])]
    shares = [share for mask in masks if mask.sum() * floor.cell_area >= _AREA for share in _shares(floor, mask)]
    found = _points(floor, shares, start)
    if not found:  # a house of one room, in the middle of which the robot waits
        iy, ix = np.indices(floor.info.shape)
        far = np.hypot(*np.subtract(floor.centres(ix, iy), np.array(start[:2])[:, None, None])) >= _APART
        found = _points(floor, [share & far for share in shares if (share & far).any()], start)
    if not found:
        raise MapError(
            "the map", f"has no room of {_AREA:g} m2 that can be reached from ({start.x:.2f}, {start.y:.2f})"
        )
    found.sort(reverse=True)
    rooms = [Room(id=0, name="base", pose=start)]
    rooms += [Room(id=i, name=f"room {i}", pose=Pose2D(x, y, 0.0)) for i, (_, x, y) in enumerate(found, 1)]
    return Rooms(tuple(rooms), "the map")


def _points(floor: Floor, shares: list[NDArray[np.bool_]], start: Pose2D) -> list[tuple[float, float, float]]:
    """Number of cells and point of each share; shares with a point beside the base are left out."""
    points = [(float(share.sum()), *point_of(floor, share)) for share in shares]
    return [point for point in points if math.dist(point[1:], start[:2]) >= _APART]


def reached_from(floor: Floor, start: Pose2D) -> NDArray[np.bool_]:
    """Floor within the robot's reach.

    Raises:
        MapError: the start is not on the floor.
    """
    cell = floor.nearest(floor.clearance >= PASSAGE, start.x, start.y, 0.5)
    if cell is None:
        raise MapError("the map", f"shows no room for the robot at its start ({start.x:.2f}, {start.y:.2f})")
    return flood(floor.clearance >= PASSAGE, *cell)


def _shares(floor: Floor, mask: NDArray[np.bool_]) -> list[NDArray[np.bool_]]:
    """A part of the floor in pieces that one look around can hold: itself, unless it is large."""
    count = math.ceil(float(mask.sum()) * floor.cell_area / _LARGE)
    if count == 1:
        return [mask]
    iy, ix = np.nonzero(mask)
    cells = np.column_stack((ix, iy)).astype(float)
    middles = [cells[int(np.hypot(*(cells - cells.mean(axis=0)).T).argmax())]]
    while len(middles) < count:  # the farthest from all before
        middles.append(cells[int(_gaps(cells, np.array(middles)).min(axis=1).argmax())])
    places = np.array(middles)
    for _ in range(_ROUNDS):
        nearest = _gaps(cells, places).argmin(axis=1)
        places = np.array([cells[nearest == k].mean(axis=0) for k in range(count)])
    nearest = _gaps(cells, places).argmin(axis=1)
    pieces = []
    for k in range(count):
        piece = np.zeros_like(mask)
        piece[iy[nearest == k], ix[nearest == k]] = True
        pieces.append(piece)
    return pieces


def _gaps(cells: NDArray[np.float64], places: NDArray[np.float64]) -> NDArray[np.float64]:
    """Distances between cells and places, shape (cells, places)."""
    gaps: NDArray[np.float64] = np.hypot(*(cells[:, None, :] - places[None, :, :]).transpose(2, 0, 1))
    return gaps


def point_of(floor: Floor, mask: NDArray[np.bool_]) -> tuple[float, float]:
    """A place in the open, near the middle of a part [m]."""
    iy, ix = np.nonzero(mask)
    clearance = floor.clearance[iy, ix]
    wide = clearance >= max(_WIDE * clearance.max(), TURN if clearance.max() >= TURN else 0.0)
    k = int(np.hypot(ix[wide] - ix.mean(), iy[wide] - iy.mean()).argmin())
    x, y = floor.centres(ix[wide][k : k + 1], iy[wide][k : k + 1])
    return float(x[0]), float(y[0])


def _parts(clearance: NDArray[np.float64], cell_area: float) -> NDArray[np.int64]:
    """Part of each cell, -1 where the clearance is 0."""
    height, width = clearance.shape
    flat = clearance.ravel()
    order = np.argsort(-flat, kind="stable")
    parts = _Parts(flat, cell_area)
    for cell in order[: np.count_nonzero(flat)].tolist():
        iy, ix = divmod(cell, width)
        around = [
            (iy + dy) * width + ix + dx for dy in (-1, 0, 1) for dx in (-1, 0, 1)
            if (dx or dy) and 0 <= iy + dy < height and 0 <= ix + dx < width
        ]  # fmt: skip
        parts.add(cell, around)
    return np.array([parts.of(cell) for cell in range(flat.size)]).reshape(height, width)


class _Parts:
    """Parts that grow cell by cell, from wide to narrow, and join where they meet (union-find)."""

    def __init__(self, clearance: NDArray[np.float64], cell_area: float) -> None:
        self._clearance = clearance.tolist()
        self._area = cell_area
        self._parent = [-1] * clearance.size
        self._peak: dict[int, float] = {}
        self._count: dict[int, int] = {}

    def of(self, cell: int) -> int:
        """Part of a cell, -1 if it is in none."""
        if self._parent[cell] < 0:
            return -1
        root = cell
        while self._parent[root] != root:
            root = self._parent[root]
        while self._parent[cell] != root:
            self._parent[cell], cell = root, self._parent[cell]
        return root

    def add(self, cell: int, around: list[int]) -> None:
        """Add a cell to the largest part beside it, and join the parts that it does not separate."""
        level = self._clearance[cell]
        beside = sorted({part for other in around if (part := self.of(other)) >= 0}, key=lambda p: -self._count[p])
        self._parent[cell] = beside[0] if beside else cell
        root = self._parent[cell]
        if not beside:
            self._peak[cell], self._count[cell] = level, 0
        self._count[root] += 1
        for other in beside[1:]:
            if not self._is_door(level, root, other):
                self._parent[other] = root
                self._peak[root] = max(self._peak[root], self._peak[other])
                self._count[root] += self._count.pop(other)

    def _is_door(self, level: float, a: int, b: int) -> bool:
        """Whether two parts that meet at this clearance are two rooms."""
        smaller = min(self._peak[a], self._peak[b])
        enough = min(self._count[a], self._count[b]) * self._area >= _CORE
        return level <= min(_DOOR, _NARROW * smaller) and enough
