"""Furniture of drawn houses: pieces of the catalogue at walls, free in rooms and as seats, with ways left between them.

Every piece leaves doors clear, and the robot must still reach most of each room: a piece in the way is left out.
"""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.maps.raster import flood, grown
from rosbot_patrol.simulation.plans.catalogue import Catalogue, Wish, extent, varied
from rosbot_patrol.simulation.plans.layout import INNER, OUTER, Layout, Rect

CELL = 0.1  # [m]
_ROBOT = 0.42  # distance from furniture at which the robot passes with ease [m]
_REACHED = (0.22, 0.9)  # share of a room's area, and area [m^2], that the robot must reach
_GAP = 0.05  # between two pieces [m]
_DOORSTEP = 0.75  # floor kept free before a door [m]
_HOME = 0.65  # radius of the floor kept free around the robot's place [m]
_TRIES = 20

Item = dict[str, Any]


@dataclass
class Furnished:
    """Furniture of a house in a plan's form.

    Attributes:
        pieces: kinds of pieces by name.
        furniture: pieces with their poses.
        kinds: kind of each room.
    """

    pieces: dict[str, Any] = field(default_factory=dict)
    furniture: list[Item] = field(default_factory=list)
    kinds: tuple[str, ...] = ()


class Furnisher:
    """Places furniture in a layout in which the robot waits at (0, 0).

    Args:
        layout: of the house.
        catalogue: of furniture.
        rng: source of all chance.
    """

    def __init__(self, layout: Layout, catalogue: Catalogue, rng: np.random.Generator) -> None:
        self._layout, self._catalogue, self._rng = layout, catalogue, rng
        self._kept = [o.clear(_DOORSTEP) for o in layout.openings]
        self._kept.append(Rect(0.0, 0.0, 0.0, 0.0).grown(_HOME))
        self._rects: dict[str, tuple[int, Rect]] = {}  # room and outline of each placed piece
        bounds = layout.bounds
        self._x0, self._y0 = bounds.x0, bounds.y0
        shape = (math.ceil((bounds.y1 - bounds.y0) / CELL), math.ceil((bounds.x1 - bounds.x0) / CELL))
        self._inside = np.zeros(shape, bool)
        for room in layout.rooms:
            self._fill(self._inside, room.grown(-INNER / 2.0))
        self._rooms = [self._cells(room) for room in layout.rooms]
        for opening in layout.openings:
            self._fill(self._inside, opening.clear(OUTER, 0.0))

    def furnish(self) -> Furnished:
        """Furnish all rooms."""
        made = Furnished(kinds=self._kinds())
        for room, kind in enumerate(made.kinds):
            counts: Counter[str] = Counter()
            seat_of: Rect | None = None
            for wish in self._catalogue.rooms[kind]:
                for _ in range(wish.most):
                    if self._rng.random() > wish.share:
                        continue
                    name = f"{wish.piece}_{room}_{counts[wish.piece]}"
                    piece = varied(self._catalogue.pieces[wish.piece], self._rng)
                    pose = self._place(name, room, wish, extent(piece), seat_of)
                    if pose is None:
                        continue
                    counts[wish.piece] += 1
                    made.pieces[name] = piece
                    made.furniture.append({"name": name, "piece": name, "pose": pose, "stands": wish.stands})
                    if wish.stands != "seat":
                        seat_of = self._rects[name][1]
        return made

    def moved(self, made: Furnished, count: int) -> list[Item]:
        """The furniture after somebody has moved up to `count` of its free pieces and seats within their rooms."""
        items = [dict(item) for item in made.furniture]
        loose = [item for item in items if item["stands"] != "wall"]
        for k in self._rng.permutation(len(loose))[:count]:
            item = loose[int(k)]
            room, before = self._rects.pop(item["name"])
            size = extent(made.pieces[item["piece"]])
            pose = self._place(item["name"], room, Wish(item["piece"], 1.0, 1, "free"), size, None)
            if pose is None:
                self._rects[item["name"]] = room, before
            else:
                item["pose"] = pose
        return items

    def _kinds(self) -> tuple[str, ...]:
        """Kind of each room: the spacious kinds, which the catalogue lists first, for the large rooms."""
        rooms, rng = self._layout.rooms, self._rng
        count = len(rooms) - 1
        listed = self._catalogue.offices if count >= 5 and rng.random() < 0.3 else self._catalogue.homes
        order = list(self._catalogue.rooms)
        chosen = sorted((listed[k % len(listed)] for k in range(count)), key=order.index)
        by_size = sorted(range(1, count + 1), key=lambda k: -rooms[k].area)
        kinds = dict(zip(by_size, chosen, strict=True))
        return ("hall", *(kinds[k] for k in range(1, count + 1)))

    def _place(
        self, name: str, room: int, wish: Wish, size: tuple[float, float, float, float], seat_of: Rect | None
    ) -> list[float] | None:
        """Find a place for a piece and take it; None if there is none."""
        for _ in range(_TRIES):
            if wish.stands == "wall":
                pose = self._at_wall(room, size)
            elif wish.stands == "seat" and seat_of is not None:
                pose = self._at_table(seat_of, size)
            else:
                pose = self._in_room(room)
            rect = _outline(size, pose)
            if self._fits(room, rect):
                self._rects[name] = room, rect
                if self._is_passable():
                    return [round(v, 3) for v in pose]
                del self._rects[name]
        return None

    def _at_wall(self, room: int, size: tuple[float, float, float, float]) -> tuple[float, float, float]:
        rect = self._layout.rooms[room].grown(-OUTER / 2.0 - 0.02)
        side = int(self._rng.integers(4))
        yaw = (0.0, math.pi / 2.0, math.pi, -math.pi / 2.0)[side]
        low_x, high_x, low_y, _ = size
        along = (rect.x0, rect.x1) if side % 2 == 0 else (rect.y0, rect.y1)
        first, last = along[0] - low_x, along[1] - high_x
        if side in (2, 3):  # x runs the other way
            first, last = along[0] + high_x, along[1] + low_x
        at = float(self._rng.uniform(min(first, last), max(first, last)))
        if side == 0:
            return at, rect.y0 - low_y, yaw
        if side == 1:
            return rect.x1 + low_y, at, yaw
        if side == 2:
            return at, rect.y1 + low_y, yaw
        return rect.x0 - low_y, at, yaw

    def _in_room(self, room: int) -> tuple[float, float, float]:
        rect = self._layout.rooms[room]
        x, y = self._rng.uniform((rect.x0, rect.y0), (rect.x1, rect.y1))
        yaw = float(self._rng.integers(4)) * math.pi / 2.0 + float(self._rng.normal(0.0, 0.2))
        return float(x), float(y), yaw

    def _at_table(self, table: Rect, size: tuple[float, float, float, float]) -> tuple[float, float, float]:
        """Beside a piece, with the front towards it."""
        side, share = int(self._rng.integers(4)), float(self._rng.uniform(0.25, 0.75))
        off = size[3] + 0.06 + float(self._rng.uniform(0.0, 0.2))
        yaw = float(self._rng.normal(0.0, 0.15))
        x, y = table.x0 + share * (table.x1 - table.x0), table.y0 + share * (table.y1 - table.y0)
        if side == 0:
            return x, table.y0 - off, yaw
        if side == 1:
            return table.x1 + off, y, yaw + math.pi / 2.0
        if side == 2:
            return x, table.y1 + off, yaw + math.pi
        return table.x0 - off, y, yaw - math.pi / 2.0

    def _fits(self, room: int, rect: Rect) -> bool:
        inner = self._layout.rooms[room].grown(-OUTER / 2.0 + 0.01)
        if rect.x0 < inner.x0 or rect.y0 < inner.y0 or rect.x1 > inner.x1 or rect.y1 > inner.y1:
            return False
        near = rect.grown(_GAP)
        return not any(near.meets(kept) for kept in self._kept) and not any(
            near.meets(other) for _, other in self._rects.values()
        )

    def _is_passable(self) -> bool:
        """Whether the robot, from its place, reaches enough of every room."""
        free = self._inside.copy()
        for _, rect in self._rects.values():
            self._fill(free, rect, value=False)
        open_to_robot = ~grown(~free, round(_ROBOT / CELL))
        ix, iy = self._cell(0.0, 0.0)
        if not open_to_robot[iy, ix]:
            return False
        reached = flood(open_to_robot, ix, iy)
        for cells, room in zip(self._rooms, self._layout.rooms, strict=True):
            if int(reached[cells].sum()) * CELL**2 < max(_REACHED[0] * room.area, _REACHED[1]):
                return False
        return True

    def _cell(self, x: float, y: float) -> tuple[int, int]:
        return int((x - self._x0) / CELL), int((y - self._y0) / CELL)

    def _cells(self, rect: Rect) -> tuple[slice, slice]:
        """Cells with their centres in a rectangle."""
        x0, x1 = ((x - self._x0) / CELL for x in (rect.x0, rect.x1))
        y0, y1 = ((y - self._y0) / CELL for y in (rect.y0, rect.y1))
        return slice(max(round(y0), 0), max(round(y1), 0)), slice(max(round(x0), 0), max(round(x1), 0))

    def _fill(self, mask: NDArray[np.bool_], rect: Rect, *, value: bool = True) -> None:
        mask[self._cells(rect)] = value


def _outline(size: tuple[float, float, float, float], pose: tuple[float, float, float]) -> Rect:
    """Upright rectangle around a turned piece."""
    x, y, yaw = pose
    c, s = math.cos(yaw), math.sin(yaw)
    corners = [(x + c * px - s * py, y + s * px + c * py) for px in size[:2] for py in size[2:]]
    xs, ys = zip(*corners, strict=True)
    return Rect(min(xs), min(ys), max(xs), max(ys))
