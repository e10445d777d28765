"""The house's map as a picture, with the robot's way, its place, and the person's."""

from __future__ import annotations

import io
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from rosbot_patrol.grid import Grid

_WALL, _FREE, _UNKNOWN = 40, 255, 214
_WAY, _ROBOT, _PERSON, _GOAL = (120, 160, 220), (20, 80, 200), (210, 30, 30), (60, 140, 60)
_MARGIN = 0.5  # [m] around the known area
_SIZE = 900  # [px] of the longer side
_FINE = 2  # factor by which the drawing is larger, for smooth lines


@dataclass(frozen=True, kw_only=True)
class MapView:
    """The part of a map that shows something: shades (row 0 is the highest y), edge of a pixel [m], lower left [m]."""

    shades: NDArray[np.uint8]
    resolution: float
    x: float
    y: float


@dataclass(frozen=True, kw_only=True)
class Marks:
    """Marks on the map, in its frame [m, rad]; None if unknown."""

    path: Sequence[tuple[float, float]] = ()
    robot: tuple[float, float, float] | None = None
    person: tuple[float, float] | None = None
    room: tuple[float, float] | None = None


def crop_map(grid: Grid) -> MapView:
    """What a map knows, with a margin."""
    known = grid.cells >= 0
    rows, columns = np.flatnonzero(known.any(axis=1)), np.flatnonzero(known.any(axis=0))
    resolution = grid.info.resolution
    if not len(rows):
        return MapView(shades=np.full((1, 1), _UNKNOWN, np.uint8), resolution=resolution, x=0.0, y=0.0)
    margin = math.ceil(_MARGIN / resolution)
    bottom, left = max(int(rows[0]) - margin, 0), max(int(columns[0]) - margin, 0)
    cells = grid.cells[bottom : int(rows[-1]) + margin + 1, left : int(columns[-1]) + margin + 1]
    shades = np.full(cells.shape, _UNKNOWN, np.uint8)
    shades[(cells >= 0) & (cells < 50)] = _FREE
    shades[cells >= 50] = _WALL
    x, y = grid.info.origin_x + left * resolution, grid.info.origin_y + bottom * resolution
    return MapView(shades=shades[::-1].copy(), resolution=resolution, x=x, y=y)


def view_of_marks(marks: Marks) -> MapView:
    """An empty map around all marks, if no map is known."""
    spots = [*marks.path, *(spot for spot in (marks.person, marks.room) if spot is not None)]
    spots += [marks.robot[:2]] if marks.robot else []
    xs, ys = [x for x, _ in spots] or [0.0], [y for _, y in spots] or [0.0]
    rows, columns = (math.ceil((max(v) - min(v) + 2.0) / 0.05) for v in (ys, xs))
    shades = np.full((min(rows, 4000), min(columns, 4000)), _FREE, np.uint8)
    return MapView(shades=shades, resolution=0.05, x=min(xs) - 1.0, y=min(ys) - 1.0)


def draw_map(view: MapView, marks: Marks) -> bytes:
    """The map with its marks, as PNG."""
    height, width = view.shades.shape
    scale = min(_SIZE * _FINE / max(height, width), 40.0)
    image = Image.fromarray(view.shades).resize(
        (max(round(width * scale), 1), max(round(height * scale), 1)), Image.Resampling.NEAREST
    )
    image = image.convert("RGB")
    _Pen(view, scale, image).draw(marks)
    small = image.resize((max(image.width // _FINE, 1), max(image.height // _FINE, 1)), Image.Resampling.LANCZOS)
    out = io.BytesIO()
    small.save(out, "PNG", optimize=True)
    return out.getvalue()


class _Pen:
    def __init__(self, view: MapView, scale: float, image: Image.Image) -> None:
        self._view, self._per_metre = view, scale / view.resolution
        self._height = image.height
        self._draw = ImageDraw.Draw(image)
        self._unit = 9.0 * _FINE  # [px] of a marker

    def draw(self, marks: Marks) -> None:
        if len(marks.path) > 1:
            self._draw.line([self._at(*spot) for spot in marks.path], fill=_WAY, width=4 * _FINE, joint="curve")
        if marks.room is not None:
            self._ring(marks.room, _GOAL, 0.6)
        if marks.robot is not None:
            self._arrow(*marks.robot)
        if marks.person is not None:
            self._figure(marks.person)

    def _at(self, x: float, y: float) -> tuple[float, float]:
        view = self._view
        return (x - view.x) * self._per_metre, self._height - (y - view.y) * self._per_metre

    def _ring(self, spot: tuple[float, float], colour: tuple[int, int, int], size: float) -> None:
        u, v = self._at(*spot)
        r = self._unit * size
        self._draw.ellipse((u - r, v - r, u + r, v + r), outline=colour, width=2 * _FINE)

    def _arrow(self, x: float, y: float, yaw: float) -> None:
        u, v = self._at(x, y)
        r = self._unit * 1.4
        corners = [
            (u + r * k * math.cos(yaw + turn), v - r * k * math.sin(yaw + turn))
            for k, turn in ((1.3, 0.0), (1.0, 2.5), (0.4, math.pi), (1.0, -2.5))
        ]
        self._draw.polygon(corners, fill=_ROBOT, outline=(255, 255, 255))

    def _figure(self, spot: tuple[float, float]) -> None:
        u, v = self._at(*spot)
        r = self._unit
        self._draw.ellipse((u - 1.9 * r, v - 1.9 * r, u + 1.9 * r, v + 1.9 * r), outline=_PERSON, width=2 * _FINE)
        self._draw.ellipse((u - 0.45 * r, v - 1.3 * r, u + 0.45 * r, v - 0.4 * r), fill=_PERSON)
        self._draw.pieslice((u - 0.9 * r, v - 0.3 * r, u + 0.9 * r, v + 2.0 * r), 180, 360, fill=_PERSON)
