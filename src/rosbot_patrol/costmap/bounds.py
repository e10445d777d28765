"""Rectangles of cells, such as the part of a costmap that an update changes."""

from __future__ import annotations

from typing import NamedTuple


class Bounds(NamedTuple):
    """Cells x0 <= ix < x1, y0 <= iy < y1."""

    x0: int
    y0: int
    x1: int
    y1: int

    @property
    def is_empty(self) -> bool:
        """Whether the rectangle holds no cell."""
        return self.x1 <= self.x0 or self.y1 <= self.y0

    @property
    def size(self) -> int:
        """Number of cells inside."""
        return 0 if self.is_empty else (self.x1 - self.x0) * (self.y1 - self.y0)

    def union(self, other: Bounds) -> Bounds:
        """Smallest rectangle around both."""
        if self.is_empty:
            return other
        if other.is_empty:
            return self
        return Bounds(min(self.x0, other.x0), min(self.y0, other.y0), max(self.x1, other.x1), max(self.y1, other.y1))

    def grown(self, cells: int) -> Bounds:
        """The rectangle, larger by this many cells on each side."""
        if self.is_empty:
            return self
        return Bounds(self.x0 - cells, self.y0 - cells, self.x1 + cells, self.y1 + cells)

    def clipped(self, width: int, height: int) -> Bounds:
        """The part inside a grid."""
        return Bounds(max(self.x0, 0), max(self.y0, 0), min(self.x1, width), min(self.y1, height))

    def overlaps(self, other: Bounds) -> bool:
        """Whether the two share a cell."""
        return self.x0 < other.x1 and other.x0 < self.x1 and self.y0 < other.y1 and other.y0 < self.y1

    def without(self, other: Bounds) -> list[Bounds]:
        """The rest of the rectangle after `other`, which overlaps it, is cut out: at most four rectangles."""
        y0, y1 = max(self.y0, other.y0), min(self.y1, other.y1)
        pieces = (
            Bounds(self.x0, self.y0, self.x1, y0),
            Bounds(self.x0, y1, self.x1, self.y1),
            Bounds(self.x0, y0, other.x0, y1),
            Bounds(other.x1, y0, self.x1, y1),
        )
        return [piece for piece in pieces if not piece.is_empty]


NOTHING = Bounds(0, 0, 0, 0)


def merged(areas: list[Bounds]) -> list[Bounds]:
    """Merge rectangles into ones without a common cell; they may cover a few cells more.

    Two overlapping rectangles become one if that adds few cells; otherwise the common part is cut off one of them.
    """
    todo = [a for a in areas if not a.is_empty]
    done: list[Bounds] = []
    while todo:
        area = todo.pop()
        other = next((o for o in done if area.overlaps(o)), None)
        if other is None:
            done.append(area)
        elif area.union(other).size <= 1.3 * (area.size + other.size):
            done.remove(other)
            todo.append(area.union(other))
        else:
            todo += area.without(other)
    return done
