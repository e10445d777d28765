"""Layouts of drawn houses: rooms as rectangles, the walls between them, doors and windows.

A house has 2 to 12 rooms and a hall. It is a corridor with rooms on both sides, or a rectangle that is cut in two again
and again. Every room can be reached through doors.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any, Literal, NamedTuple

import numpy as np

ROOMS = (2, 12)  # fewest and most rooms, without the hall
OUTER, INNER = 0.20, 0.10  # thickness of walls [m]

_DEPTH, _WIDTH = (3.0, 4.6), (2.5, 4.6)  # of a room beside a corridor [m]
_CORRIDOR = (1.3, 2.0)  # width of a corridor [m]
_AREA = (9.0, 17.0)  # of a room in a cut rectangle [m^2]
_SHORTEST = 2.3  # side of a room [m]
_DOOR = (0.85, 1.10)  # width of a door [m]
_WIDE = (1.6, 2.6)  # width of an opening without a door [m]
_BESIDE_DOOR = 0.25  # wall between a door and a corner [m]

Axis = Literal["x", "y"]


class Rect(NamedTuple):
    """A rectangle [m]."""

    x0: float
    y0: float
    x1: float
    y1: float

    @property
    def area(self) -> float:
        """[m^2]."""
        return (self.x1 - self.x0) * (self.y1 - self.y0)

    @property
    def middle(self) -> tuple[float, float]:
        """Its centre."""
        return (self.x0 + self.x1) / 2.0, (self.y0 + self.y1) / 2.0

    def grown(self, by: float) -> Rect:
        """The rectangle with a margin."""
        return Rect(self.x0 - by, self.y0 - by, self.x1 + by, self.y1 + by)

    def meets(self, other: Rect) -> bool:
        """Whether two rectangles overlap."""
        return self.x0 < other.x1 and other.x0 < self.x1 and self.y0 < other.y1 and other.y0 < self.y1


@dataclass(frozen=True, kw_only=True)
class Opening:
    """A door, or a wide opening, in the wall between two rooms.

    Attributes:
        rooms: indices of the rooms.
        axis: of the wall's normal; at: the wall's place on it [m].
        middle: place of the opening's middle along the wall [m]; width: [m].
    """

    rooms: tuple[int, int]
    axis: Axis
    at: float
    middle: float
    width: float

    @property
    def place(self) -> tuple[float, float]:
        """Its middle, x, y [m]."""
        return (self.at, self.middle) if self.axis == "x" else (self.middle, self.at)

    def clear(self, depth: float, beside: float = 0.1) -> Rect:
        """The floor in front of and behind it."""
        half = self.width / 2.0 + beside
        if self.axis == "x":
            return Rect(self.at - depth, self.middle - half, self.at + depth, self.middle + half)
        return Rect(self.middle - half, self.at - depth, self.middle + half, self.at + depth)


@dataclass(frozen=True, kw_only=True)
class Layout:
    """Rooms of a house; room 0 is the hall in which the robot waits.

    Attributes:
        rooms: between the middles of the walls.
        openings: doors and wide openings.
        windows: openings of outer walls, as in a plan: axis, place, middle, width, sill.
    """

    rooms: tuple[Rect, ...]
    openings: tuple[Opening, ...]
    windows: tuple[tuple[Axis, float, float, float, float], ...] = field(default=())

    @property
    def bounds(self) -> Rect:
        """The whole house."""
        x0, y0, x1, y1 = zip(*self.rooms, strict=True)
        return Rect(min(x0), min(y0), max(x1), max(y1))

    def moved(self, dx: float, dy: float) -> Layout:
        """The layout elsewhere."""

        def along(axis: Axis) -> tuple[float, float]:
            return (dx, dy) if axis == "x" else (dy, dx)

        return Layout(
            rooms=tuple(Rect(r.x0 + dx, r.y0 + dy, r.x1 + dx, r.y1 + dy) for r in self.rooms),
            openings=tuple(
                replace(o, at=o.at + along(o.axis)[0], middle=o.middle + along(o.axis)[1]) for o in self.openings
            ),
            windows=tuple(
                (axis, at + along(axis)[0], middle + along(axis)[1], width, sill)
                for axis, at, middle, width, sill in self.windows
            ),
        )


def draw_layout(rng: np.random.Generator) -> Layout:
    """Draw a layout of 2 to 12 rooms and a hall."""
    count = int(rng.integers(ROOMS[0], ROOMS[1] + 1))
    is_corridor = count >= 4 and rng.random() < 0.65
    rooms = _corridor(rng, count) if is_corridor else _cut(rng, count + 1)
    if rng.random() < 0.5:
        rooms = [Rect(r.y0, r.x0, r.y1, r.x1) for r in rooms]  # on its side
    layout = Layout(rooms=tuple(rooms), openings=tuple(_openings(rng, rooms, from_hall=is_corridor)))
    return replace(layout, windows=tuple(_windows(rng, layout)))


def _corridor(rng: np.random.Generator, count: int) -> list[Rect]:
    """A hall along the whole house, and rooms on both sides of it."""
    above = count // 2 if rng.random() < 0.5 else -(-count // 2)
    widths = [rng.uniform(*_WIDTH, size=n) for n in (above, count - above)]
    length = float(max(w.sum() for w in widths))
    width = float(rng.uniform(*_CORRIDOR))
    rooms = [Rect(0.0, 0.0, length, width)]
    for side, drawn in zip((1, -1), widths, strict=True):
        ends = np.concatenate(([0.0], np.cumsum(drawn) * (length / drawn.sum())))
        depth = float(rng.uniform(*_DEPTH))
        low, high = (width, width + depth) if side > 0 else (-depth, 0.0)
        rooms += [Rect(float(a), low, float(b), high) for a, b in pairwise(ends)]
    return [Rect(*(round(v, 2) for v in room)) for room in rooms]


def _cut(rng: np.random.Generator, count: int) -> list[Rect]:
    """A rectangle, its largest part cut in two until there are enough; the hall is the most central one."""
    area, ratio = count * float(rng.uniform(*_AREA)), float(rng.uniform(1.0, 1.7))
    width = math.sqrt(area * ratio)
    rooms = [Rect(0.0, 0.0, round(width, 2), round(area / width, 2))]
    while len(rooms) < count:
        largest = max(rooms, key=lambda room: room.area)
        rooms.remove(largest)
        x0, y0, x1, y1 = largest
        share = float(rng.uniform(0.4, 0.6))
        if x1 - x0 >= y1 - y0:
            cut = round(x0 + min(max(share * (x1 - x0), _SHORTEST), x1 - x0 - _SHORTEST), 2)
            rooms += [Rect(x0, y0, cut, y1), Rect(cut, y0, x1, y1)]
        else:
            cut = round(y0 + min(max(share * (y1 - y0), _SHORTEST), y1 - y0 - _SHORTEST), 2)
            rooms += [Rect(x0, y0, x1, cut), Rect(x0, cut, x1, y1)]
    middle = np.mean([room.middle for room in rooms], axis=0)
    return sorted(rooms, key=lambda room: math.dist(room.middle, middle))


def _shared(a: Rect, b: Rect) -> tuple[Axis, float, float, float] | None:
    """The wall between two rooms: axis of its normal, place, and its ends; None if it is too short for a door."""
    sides: tuple[tuple[Axis, float, float, tuple[float, float]], ...] = (
        ("x", a.x1, b.x0, (max(a.y0, b.y0), min(a.y1, b.y1))),
        ("x", b.x1, a.x0, (max(a.y0, b.y0), min(a.y1, b.y1))),
        ("y", a.y1, b.y0, (max(a.x0, b.x0), min(a.x1, b.x1))),
        ("y", b.y1, a.y0, (max(a.x0, b.x0), min(a.x1, b.x1))),
    )
    for axis, end, begin, (low, high) in sides:
        if abs(end - begin) < 1e-6 and high - low > _DOOR[1] + 2 * _BESIDE_DOOR + INNER:
            return axis, end, low, high
    return None


def _openings(rng: np.random.Generator, rooms: list[Rect], *, from_hall: bool) -> list[Opening]:
    """Doors that join all rooms, and some more."""
    walls = {(i, j): wall for j in range(len(rooms)) for i in range(j) if (wall := _shared(rooms[i], rooms[j]))}
    pairs = [pair for pair in walls if 0 in pair] if from_hall else []
    rest = [pair for pair in walls if pair not in pairs]
    joined, found = list(range(len(rooms))), []
    for pair in [*pairs, *(rest[k] for k in rng.permutation(len(rest)))]:
        i, j = pair
        is_new = joined[i] != joined[j]
        if is_new:
            joined = [joined[i] if each == joined[j] else each for each in joined]
        if is_new or rng.random() < 0.15:
            found.append(_opening(rng, pair, walls[pair]))
    return found


def _opening(rng: np.random.Generator, pair: tuple[int, int], wall: tuple[Axis, float, float, float]) -> Opening:
    axis, at, low, high = wall
    free = high - low - 2 * _BESIDE_DOOR - INNER
    is_wide = free > _WIDE[0] and rng.random() < 0.12
    width = float(rng.uniform(*_WIDE)) if is_wide else float(rng.uniform(*_DOOR))
    width = min(width, free)
    side = _BESIDE_DOOR + (INNER + width) / 2.0
    middle = float(rng.uniform(low + side, high - side))
    return Opening(rooms=pair, axis=axis, at=at, middle=round(middle, 2), width=round(width, 2))


def _windows(rng: np.random.Generator, layout: Layout) -> list[tuple[Axis, float, float, float, float]]:
    found: list[tuple[Axis, float, float, float, float]] = []
    bounds = layout.bounds
    for room in layout.rooms:
        outer: tuple[tuple[Axis, float, bool, float, float], ...] = (
            ("x", room.x0, room.x0 == bounds.x0, room.y0, room.y1),
            ("x", room.x1, room.x1 == bounds.x1, room.y0, room.y1),
            ("y", room.y0, room.y0 == bounds.y0, room.x0, room.x1),
            ("y", room.y1, room.y1 == bounds.y1, room.x0, room.x1),
        )
        for axis, at, is_outer, low, high in outer:
            width = float(rng.uniform(0.6, 1.6))
            if is_outer and high - low > width + 0.8 and rng.random() < 0.6:
                middle = float(rng.uniform(low + width / 2 + 0.4, high - width / 2 - 0.4))
                found.append((axis, at, round(middle, 2), round(width, 2), round(float(rng.uniform(0.5, 1.2)), 2)))
    return found


def plan_walls(layout: Layout) -> list[dict[str, Any]]:
    """The walls of a layout in a plan's form."""
    walls: list[dict[str, Any]] = []
    axes: tuple[Axis, Axis] = ("x", "y")
    for axis in axes:
        edges: dict[float, list[tuple[float, float, int]]] = {}
        for room in layout.rooms:
            x0, y0, x1, y1 = room if axis == "x" else (room.y0, room.x0, room.y1, room.x1)
            edges.setdefault(x0, []).append((y0, y1, 1))
            edges.setdefault(x1, []).append((y0, y1, -1))
        for at, rows in sorted(edges.items()):
            for low, high, is_outer in _pieces(rows):
                wall = _wall(layout, axis, at, (low, high))
                walls.append({"name": f"{len(walls)}", "thickness": OUTER if is_outer else INNER, **wall})
    return walls


def _pieces(rows: list[tuple[float, float, int]]) -> list[tuple[float, float, bool]]:
    """Pieces of a line with rooms on one side or on both: begin, end, whether one side only (an outer wall)."""
    ends = sorted({end for low, high, _ in rows for end in (low, high)})
    found: list[tuple[float, float, bool]] = []
    for a, b in pairwise(ends):
        sides = {side for low, high, side in rows if low <= a and b <= high}
        if not sides:
            continue
        is_outer = len(sides) == 1
        if found and found[-1][1] == a and found[-1][2] == is_outer:
            found[-1] = (found[-1][0], b, is_outer)
        else:
            found.append((a, b, is_outer))
    return found


def _wall(layout: Layout, axis: Axis, at: float, ends: tuple[float, float]) -> dict[str, Any]:
    """Ends and openings of a wall."""
    low, high = ends
    openings: list[dict[str, float]] = [
        {"at": round(o.middle - low, 3), "width": o.width} for o in layout.openings
        if o.axis == axis and o.at == at and low < o.middle < high
    ]  # fmt: skip
    openings += [
        {"at": round(middle - low, 3), "width": width, "sill": sill}
        for side, place, middle, width, sill in layout.windows
        if side == axis and place == at and low < middle < high
    ]
    begin, end = ([at, low], [at, high]) if axis == "x" else ([low, at], [high, at])
    return {"from": begin, "to": end, "openings": openings}
