"""Zones of a house as polygons in a file, such as those that the robot must keep out of.

zones:
- {name: dog's corner, points: [[1.0, 2.0], [2.0, 2.0], [2.0, 3.5]]}
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.errors import ParamError
from rosbot_patrol.grid import Grid, GridInfo
from rosbot_patrol.params import load_strict, param
from rosbot_patrol.yaml_files import read_mapping

ZONES = "zones.yaml"
"""Name of the file in a guard's folder of its house."""

_MOST = 100  # points of a zone, and zones
_RESOLUTION = 0.05  # [m] of a mask
_SMALLEST = 0.01  # [m2] area of a zone


@dataclass(frozen=True, kw_only=True)
class Zone:
    """A polygon in map: its name, and its corners [m] in order; the last one is joined to the first."""

    name: str
    points: tuple[tuple[float, float], ...]


def _bad_name(value: str) -> str | None:
    return None if value.strip() and value.isprintable() else f"is {value!r}, expected one line of text"


@dataclass(frozen=True, kw_only=True)
class _Entry:
    name: str = param(doc="name in messages", check=_bad_name)
    points: list[Any] = param(doc="corners [x, y] in map [m], in order")


@dataclass(frozen=True, kw_only=True)
class _File:
    zones: list[Any] = param(doc="list of the zones")


def read_zones(path: Path) -> tuple[Zone, ...]:
    """Read a file of zones; none where there is no such file.

    Raises:
        ParamError: it cannot be read or is wrong; names the file and the key.
    """
    if not path.exists():
        return ()
    file = load_strict(_File, read_mapping(path, keys="zones"), name=f"{path}: ")
    if len(file.zones) > _MOST:
        raise ParamError(f"{path}: zones", f"are {len(file.zones)}, expected at most {_MOST}")
    return tuple(zone_from(tree, f"{path}: zones[{i}]/") for i, tree in enumerate(file.zones))


def zone_from(tree: Any, name: str) -> Zone:
    """A zone from its keys; raises ParamError."""
    entry = load_strict(_Entry, tree, name=name)
    if not 3 <= len(entry.points) <= _MOST:
        raise ParamError(f"{name}points", f"are {len(entry.points)}, expected 3 to {_MOST} corners")
    points = tuple(_point(point, f"{name}points[{i}]") for i, point in enumerate(entry.points))
    if abs(_area(points)) < _SMALLEST:
        raise ParamError(f"{name}points", "lie on a line, expected the corners of an area")
    return Zone(name=entry.name.strip(), points=points)


def _point(value: Any, name: str) -> tuple[float, float]:
    is_pair = isinstance(value, (list, tuple)) and len(value) == 2
    if not is_pair or not all(isinstance(v, (int, float)) and math.isfinite(v) for v in value):
        raise ParamError(name, f"is {value!r}, expected [x, y] in metres")
    return float(value[0]), float(value[1])


def _area(points: tuple[tuple[float, float], ...]) -> float:
    pairs = zip(points, points[1:] + points[:1], strict=True)
    return 0.5 * sum(a[0] * b[1] - b[0] * a[1] for a, b in pairs)


def zones_mask(zones: Iterable[Zone], info: GridInfo) -> NDArray[np.bool_]:
    """Cells of a grid with their centres in any zone, shape (height, width), by the even-odd rule."""
    mask = np.zeros(info.shape, bool)
    xs = info.origin_x + (np.arange(info.width) + 0.5) * info.resolution
    ys = info.origin_y + (np.arange(info.height) + 0.5) * info.resolution
    for zone in zones:
        inside = np.zeros(info.shape, bool)
        for (ax, ay), (bx, by) in zip(zone.points, zone.points[1:] + zone.points[:1], strict=True):
            if ay == by:
                continue
            rows = np.flatnonzero((ys >= min(ay, by)) & (ys < max(ay, by)))
            crossings = ax + (ys[rows] - ay) * (bx - ax) / (by - ay)
            inside[rows] ^= xs[None, :] >= crossings[:, None]
        mask |= inside
    return mask


def zones_grid(zones: tuple[Zone, ...]) -> Grid:
    """A mask for a costmap: 100 in the zones, -1 (says nothing) elsewhere. One cell of nothing without zones."""
    points = np.array([point for zone in zones for point in zone.points]).reshape(-1, 2)
    low, high = (points.min(axis=0), points.max(axis=0)) if len(points) else (np.zeros(2), np.zeros(2))
    width, height = (max(math.ceil(span / _RESOLUTION), 1) for span in high - low)
    info = GridInfo(resolution=_RESOLUTION, width=width, height=height, origin_x=float(low[0]), origin_y=float(low[1]))
    return Grid(info, np.where(zones_mask(zones, info), 100, -1).astype(np.int8))
