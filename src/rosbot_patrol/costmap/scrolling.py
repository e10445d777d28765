"""Cells of a moving window: the window slides over its memory, so that a step copies nothing."""

from __future__ import annotations

import numpy as np

from rosbot_patrol.costmap.bounds import Bounds
from rosbot_patrol.costmap.costs import CostCells


class ScrollingCells:
    """Cells of shape (height, width), always contiguous, that shift in constant time.

    Rows lie one after the other in memory. Content that moves by (-dx, -dy) cells is therefore the same memory, read
    from dy * width + dx farther on. Whatever runs over the end of a row lies in entering cells and is overwritten. When
    the slack at one end is used up, the cells are moved back to the middle once.
    """

    def __init__(self, height: int, width: int, default: int, *, moves: bool = True) -> None:
        self._shape = (height, width)
        self._default = default
        self._slack = max(height // 32, 16) * width + width if moves else 0
        self._memory: CostCells = np.empty(height * width + 2 * self._slack, np.uint8)
        self._at = self._slack
        self.cells = self._view()
        self.cells.fill(default)

    def _view(self) -> CostCells:
        height, width = self._shape
        return self._memory[self._at : self._at + height * width].reshape(height, width)

    def shift(self, dx: int, dy: int) -> None:
        """Move the content by (-dx, -dy) cells; entering cells get the default. Earlier arrays become stale."""
        height, width = self._shape
        if abs(dx) >= width or abs(dy) >= height:
            self.cells.fill(self._default)
            return
        step = dy * width + dx
        if not 0 <= self._at + step <= 2 * self._slack:
            self._centre(step)
        self._at += step
        self.cells = self._view()
        for strip in strips(width, height, dx, dy):
            self.cells[strip.y0 : strip.y1, strip.x0 : strip.x1] = self._default

    def _centre(self, step: int) -> None:
        """Make room for a step of any length."""
        count = self._shape[0] * self._shape[1]
        if abs(step) > self._slack:
            self._slack = 2 * abs(step)
            memory = np.empty(count + 2 * self._slack, np.uint8)
        else:
            memory = self._memory
        memory[self._slack : self._slack + count] = self._memory[self._at : self._at + count]
        self._memory, self._at = memory, self._slack


def fill_outside(cells: CostCells, keep: Bounds, value: int) -> None:
    """Set all cells outside an area, which may lie partly or wholly off the grid."""
    keep = keep.clipped(cells.shape[1], cells.shape[0])
    if keep.is_empty:
        cells.fill(value)
        return
    cells[: keep.y0] = value
    cells[keep.y1 :] = value
    cells[keep.y0 : keep.y1, : keep.x0] = value
    cells[keep.y0 : keep.y1, keep.x1 :] = value


def strips(width: int, height: int, dx: int, dy: int) -> list[Bounds]:
    """Cells that enter a window which moved by (dx, dy), as rectangles without a common cell."""
    dx, dy = max(-width, min(dx, width)), max(-height, min(dy, height))
    found = []
    if dy:
        found.append(Bounds(0, height - dy, width, height) if dy > 0 else Bounds(0, 0, width, -dy))
    if dx:
        y0, y1 = max(-dy, 0), height - max(dy, 0)
        found.append(Bounds(width - dx, y0, width, y1) if dx > 0 else Bounds(0, y0, -dx, y1))
    return [strip for strip in found if not strip.is_empty]
