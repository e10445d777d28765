"""Plots of a result over the stored one: a drawing (svg) per table, a picture (png) per map."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.errors import ResultError
from rosbot_patrol.files import write_atomic
from rosbot_patrol.grid import Grid
from rosbot_patrol.replay.results.comparison import Field, column_errors, field_of, map_difference, paired
from rosbot_patrol.replay.results.tables import STAMP, Result, Table

WIDTH, HEIGHT, LEFT, TOP, GAP = 900.0, 110.0, 80.0, 24.0, 34.0  # size of a panel, and its margins [px]
MOST = 4000  # most points of a line
STORED, FOUND, WRONG = "#9aa5b1", "#1f6feb", "#d1242f"
DIFFERENCE = np.array([[205, 205, 205], [235, 245, 235], [209, 36, 47]], dtype=np.uint8)  # unknown, same, different

Array = NDArray[np.float64]


def write_plots(folder: Path, found: Result, stored: Result | None, fields: Mapping[str, Field]) -> list[Path]:
    """Write all plots; returns their paths.

    Args:
        folder: output folder; created if missing.
        found: the new result.
        stored: the expected result, None if there is none.
        fields: rows that differ by more than these tolerances are marked.

    Raises:
        ResultError: a plot cannot be written.
    """
    pictures: dict[str, bytes] = {}
    for name, table in found.tables.items():
        other = None if stored is None else stored.tables.get(name)
        pictures[f"{name}.svg"] = table_drawing(name, table, other, fields).encode()
    for name, grid in found.grids.items():
        pictures[f"{name}.png"] = png_bytes(map_picture(grid))
        other_grid = None if stored is None else stored.grids.get(name)
        if other_grid is not None:
            pictures[f"{name}_stored.png"] = png_bytes(map_picture(other_grid))
            pictures[f"{name}_difference.png"] = png_bytes(DIFFERENCE[map_difference(other_grid, grid)[0][::-1]])
    for name, data in pictures.items():
        try:
            write_atomic(folder / name, data)
        except OSError as err:
            raise ResultError(folder / name, f"cannot be written: {err.strerror}") from err
    return [folder / name for name in pictures]


def map_picture(grid: Grid) -> NDArray[np.uint8]:
    """A map in map_saver's colours: walls black, floor white, unknown grey; shape (rows, columns, 3)."""
    cells = grid.cells[::-1]
    grey = np.where(cells < 0, 205, np.where(cells >= 65, 0, 254)).astype(np.uint8)
    return np.repeat(grey[:, :, None], 3, axis=2)


def png_bytes(picture: NDArray[np.uint8]) -> bytes:
    """Encode a colour picture, RGB, shape (rows, columns, 3), as png; small ones are enlarged to 400 pixels or more."""
    scale = max(1, -(-400 // max(picture.shape[:2])))
    large = cv2.resize(picture, None, fx=scale, fy=scale, interpolation=cv2.INTER_NEAREST)
    encoded: bytes = cv2.imencode(".png", large[:, :, ::-1])[1].tobytes()
    return encoded


def table_drawing(name: str, found: Table, stored: Table | None, fields: Mapping[str, Field]) -> str:
    """Draw a panel per column of numbers, one below the other."""
    columns = [key for key, values in found.items() if key != STAMP and values.dtype.kind in "fiub"]
    height = TOP + len(columns) * (HEIGHT + GAP) + 10.0
    width = LEFT + WIDTH + 20.0
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:.0f} {height:.0f}" width="{width:.0f}" '
        f'font-family="sans-serif" font-size="12"><rect width="100%" height="100%" fill="white"/>'
    ]
    stamps = np.concatenate([table[STAMP] for table in (found, stored) if table is not None and STAMP in table])
    span = (float(stamps.min()), float(stamps.max())) if len(stamps) else (0.0, 1.0)
    for i, column in enumerate(columns):
        parts += _panel(TOP + i * (HEIGHT + GAP), name, column, found, stored, span=span, fields=fields)
    return "\n".join([*parts, "</svg>\n"])


def _panel(
    top: float,
    name: str,
    column: str,
    found: Table,
    stored: Table | None,
    *,
    span: tuple[float, float],
    fields: Mapping[str, Field],
) -> list[str]:
    """Draw one column: its name, bounds, and lines."""
    title = f"{name}.{column}"
    field = field_of(title, fields)
    lines = [(found[STAMP], found[column].astype(np.float64), FOUND, 1.2)]
    has_stored = stored is not None and column in stored
    if stored is not None and has_stored:
        lines.insert(0, (stored[STAMP], stored[column].astype(np.float64), STORED, 4.0))
    values = np.concatenate([line[1] for line in lines])
    values = values[np.isfinite(values)]
    low, high = (float(values.min()), float(values.max())) if len(values) else (0.0, 1.0)
    high = high if high > low else low + 1.0
    frame = _Frame(top, span, (low, high))
    unit = f" [{field.unit}]" if field.unit else ""
    parts = [
        f'<text x="{LEFT}" y="{top - 5:.1f}" font-weight="bold">{escape(title + unit)}</text>',
        f'<rect x="{LEFT}" y="{top:.1f}" width="{WIDTH}" height="{HEIGHT}" fill="none" stroke="#d0d7de"/>',
        *(
            f'<text x="{LEFT - 6:.1f}" y="{y:.1f}" text-anchor="end">{value:.4g}</text>'
            for value, y in ((high, top + 10.0), (low, top + HEIGHT))
        ),
        f'<text x="{LEFT + WIDTH:.1f}" y="{top + HEIGHT + 13:.1f}" text-anchor="end">{span[1] - span[0]:.1f} s</text>',
    ]
    parts += [frame.line(*line) for line in lines]
    if stored is not None and has_stored:
        is_by_order = field_of(f"{name}.rows", fields).is_by_order
        parts += frame.marks(*_wrong_points(column, found, stored, field, is_by_order=is_by_order))
    return parts


def _wrong_points(column: str, found: Table, stored: Table, field: Field, *, is_by_order: bool) -> tuple[Array, Array]:
    """Times and new values of the rows that differ by more than the tolerance."""
    pairs = paired(stored, found, is_by_order=is_by_order)
    new = found[column][pairs.found]
    wrong = column_errors(stored[column][pairs.stored], new, field) > field.tolerance
    return found[STAMP][pairs.found][wrong], new[wrong].astype(np.float64)


class _Frame:
    """Coordinates of values in a panel."""

    def __init__(self, top: float, span: tuple[float, float], bounds: tuple[float, float]) -> None:
        self._top, self._begin, self._low = top, span[0], bounds[0]
        self._per_second = WIDTH / max(span[1] - span[0], 1e-9)
        self._per_value = HEIGHT / (bounds[1] - bounds[0])

    def places(self, times: Array, values: Array) -> tuple[NDArray[Any], NDArray[Any]]:
        return (
            LEFT + (times - self._begin) * self._per_second,
            self._top + HEIGHT - (values - self._low) * self._per_value,
        )

    def line(self, times: Array, values: Array, colour: str, width: float) -> str:
        step = max(1, len(times) // MOST)
        is_there = np.isfinite(values)
        x, y = self.places(times[is_there][::step], values[is_there][::step])
        points = " L".join(f"{a:.1f} {b:.1f}" for a, b in zip(x, y, strict=True))
        way = f"M{points}" if points else ""
        return f'<path d="{way}" fill="none" stroke="{colour}" stroke-width="{width}" stroke-linejoin="round"/>'

    def marks(self, times: Array, values: Array) -> list[str]:
        step = max(1, len(times) // 500)
        x, y = self.places(times[::step], np.nan_to_num(values[::step], nan=self._low))
        return [f'<circle cx="{a:.1f}" cy="{b:.1f}" r="2.5" fill="{WRONG}"/>' for a, b in zip(x, y, strict=True)]
