"""Doorways of a house, found by its walls, and doors in them."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.campaign.floor import CELL, Floor
from rosbot_patrol.patrol.house.regions import NOBODYS
from rosbot_patrol.simulation.scene.slices import Slice, slice_bodies
from rosbot_patrol.simulation.scene.ways import EYE_LEVEL

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

_WIDTHS = (0.6, 1.25)  # of a doorway that a door fits into [m]
_BEARINGS = 36  # directions in which its jambs are looked for
_ROUNDS = 2  # of looking for them again from between those of the one before
_BEYOND = 0.6  # free way on both sides of a doorway [m]
_GAP = 0.04  # between leaf and jambs, together [m]
_SWING = 1.55  # of an open door [rad]
_TO_LEAF = 0.1  # steps along a leaf [m]


@dataclass(frozen=True)
class Doorway:
    """A passage between two rooms, as wide as a door.

    Attributes:
        jambs: its ends, x, y [m], shape (2, 2).
    """

    jambs: Array

    @property
    def width(self) -> float:
        """[m]."""
        return float(np.hypot(*(self.jambs[1] - self.jambs[0])))

    def door(self, name: str, *, at_second: bool, turns_left: bool) -> dict[str, Any]:
        """An open door as a scenario's entry.

        Args:
            name: of the door.
            at_second: hinged at the second jamb, else at the first.
            turns_left: opens counter-clockwise.
        """
        hinge, other = self.jambs[::-1] if at_second else self.jambs
        along = math.atan2(other[1] - hinge[1], other[0] - hinge[0])
        return {
            "name": name,
            "hinge": [round(float(hinge[0]), 3), round(float(hinge[1]), 3), round(along, 4)],
            "width": round(self.width - _GAP, 3),
            "swing": _SWING if turns_left else -_SWING,
            "opening": 1.0,
        }


def find_doorways(floor: Floor) -> list[Doorway]:
    """Doorways between the rooms of a house, and between them and the robot's place.

    Where the floors of two rooms meet, the jambs are the walls on both sides, in the direction where they are nearest.
    The floors may meet beside the wall; half-way between its corners is nearer to its middle. In a world that names
    nothing a wall, whatever is as high as the eyes is one.
    """
    walls = [body for body in floor.bodies if body.kind == "wall"]
    cut = slice_bodies(walls or floor.bodies, EYE_LEVEL)
    found = []
    for place in _borders(floor):
        jambs = _jambs(cut, np.array(place))
        for _ in range(_ROUNDS):
            jambs = _jambs(cut, jambs.mean(axis=0))
        doorway = Doorway(jambs)
        if _WIDTHS[0] <= doorway.width <= _WIDTHS[1] and _leads_through(cut, jambs):
            found.append(doorway)
    return found


def _leads_through(cut: Slice, jambs: Array) -> bool:
    """Whether it is free on both sides, which a corner between two walls is not."""
    along = jambs[1] - jambs[0]
    ahead = math.atan2(along[1], along[0]) + math.pi / 2.0
    x, y = jambs.mean(axis=0)
    return bool((cut.cast(x, y, ahead, math.pi, 2, longest=9.0) >= _BEYOND).all())


def _jambs(cut: Slice, middle: Array) -> Array:
    """Where opposite beams from a place end that are together the shortest, x, y [m], shape (2, 2)."""
    x, y = middle
    ranges = cut.cast(x, y, 0.0, math.pi / _BEARINGS, 2 * _BEARINGS, longest=9.0)
    k = int((ranges[:_BEARINGS] + ranges[_BEARINGS:]).argmin())
    ahead = np.array([math.cos(k * math.pi / _BEARINGS), math.sin(k * math.pi / _BEARINGS)])
    return np.stack([middle - ranges[k + _BEARINGS] * ahead, middle + ranges[k] * ahead])


def _borders(floor: Floor) -> Iterator[tuple[float, float]]:
    """Middles of the borders between two rooms, x, y [m]."""
    labels = floor.regions.labels
    pairs: dict[tuple[int, int], list[tuple[float, float]]] = {}
    for dy, dx in ((0, 1), (1, 0)):
        here, there = labels[: -1 if dy else None, : -1 if dx else None], labels[dy:, dx:]
        iy, ix = np.nonzero((here != there) & (here != NOBODYS) & (there != NOBODYS))
        x, y = floor.plan.centres(ix, iy)
        ends = np.sort(np.column_stack((here[iy, ix], there[iy, ix])), axis=1)
        for (a, b), px, py in zip(ends.tolist(), x + dx * CELL / 2.0, y + dy * CELL / 2.0, strict=True):
            pairs.setdefault((a, b), []).append((float(px), float(py)))
    for points in pairs.values():
        yield from _middles(np.array(points))


def _middles(points: Array) -> Iterator[tuple[float, float]]:
    """Middle of each group of neighbouring points, shape (N, 2)."""
    left = np.ones(len(points), bool)
    while left.any():
        group = np.zeros(len(points), bool)
        group[int(left.argmax())] = True
        while True:
            away = np.hypot(*(points[:, None] - points[None, group]).transpose(2, 0, 1)).min(axis=1)
            more = left & (away < 2.0 * CELL)
            if (more == group).all():
                break
            group = more
        left &= ~group
        yield tuple(points[group].mean(axis=0).tolist())


def leaf_cells(door: dict[str, Any], floor: Floor) -> Mask:
    """Cells of the open leaf of a door, without those at its hinge, shape of the floor's grid."""
    x, y, along = door["hinge"]
    bearing = along + door["swing"]
    mask = np.zeros(floor.info.shape, bool)
    for reach in np.arange(0.2, door["width"], CELL / 2.0):
        ix, iy = floor.info.cell_of(x + reach * math.cos(bearing), y + reach * math.sin(bearing))
        if floor.info.contains_cell(ix, iy):
            mask[iy, ix] = True
    return mask


def shuts(door: dict[str, Any], floor: Floor, room: int) -> bool:
    """Whether the robot cannot get to a room's point while a door is shut."""
    x, y, along = door["hinge"]
    reach = np.arange(0.0, door["width"] + _TO_LEAF, CELL / 2.0)
    leaf = np.column_stack((x + reach * math.cos(along), y + reach * math.sin(along)))
    return floor.is_barred(room, leaf)
