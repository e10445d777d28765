"""Map files: a yaml file and its image, read as map_server does and written as map_saver does.

The grid's row 0 is the lowest y; the picture's first row is the highest. Only this module flips.
"""

from __future__ import annotations

import math
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from rosbot_patrol.errors import MapError
from rosbot_patrol.files import write_atomic
from rosbot_patrol.grid import Grid, GridInfo
from rosbot_patrol.maps.occupancy import MODES, Thresholds, cells_from_picture, picture_from_cells
from rosbot_patrol.maps.pictures import pgm_bytes, read_picture


@dataclass(frozen=True, kw_only=True)
class MapFile:
    """Contents of a map's yaml: image, edge of a pixel [m], lower left corner (x, y [m], yaw [rad]), thresholds."""

    image: Path
    resolution: float
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)
    thresholds: Thresholds = Thresholds()


def read_map(path: Path | str) -> Grid:
    """Read a map as int8 cells (-1 unknown, 0 free to 100 occupied), from its yaml.

    Raises:
        MapError: the yaml or its picture is missing or broken; names file and key.
    """
    return read_grid(read_map_file(path))


def read_map_file(path: Path | str) -> MapFile:
    """Read and check a map's yaml; the image's path is relative to the yaml's folder. Raises MapError."""
    path = Path(path)
    tree = _yaml_tree(path)
    image = _value(path, tree, "image", str, "the picture's file name")
    if not image:
        raise MapError(path, "key 'image' is empty, expected the picture's file name")
    resolution = _number(path, tree, "resolution")
    if not resolution > 0.0:
        raise MapError(path, f"key 'resolution' is {resolution}, expected more than 0 m")
    return MapFile(
        image=path.parent / image,
        resolution=resolution,
        origin=_origin(path, tree),
        thresholds=_thresholds(path, tree),
    )


def read_grid(map_file: MapFile) -> Grid:
    """Read the cells of a map after its yaml. Raises MapError."""
    picture = read_picture(map_file.image)
    cells = np.ascontiguousarray(np.flipud(cells_from_picture(picture, map_file.thresholds)))
    height, width = cells.shape
    x, y, yaw = map_file.origin
    info = GridInfo(resolution=map_file.resolution, width=width, height=height, origin_x=x, origin_y=y, yaw=yaw)
    return Grid(info, cells)


def map_bytes(grid: Grid, image_name: str, *, occupied: int = 65, free: int = 25) -> tuple[bytes, bytes]:
    """Bytes of a map's pgm and yaml, exactly as map_saver writes them."""
    info = grid.info
    picture = picture_from_cells(np.flipud(grid.cells), occupied=occupied, free=free)
    pgm = pgm_bytes(picture, f"CREATOR: map_saver.cpp {info.resolution:.3f} m/pix")
    text = (
        f"image: {image_name}\n"
        f"resolution: {info.resolution:f}\n"
        f"origin: [{info.origin_x:f}, {info.origin_y:f}, {info.yaw:f}]\n"
        "negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n\n"
    )
    return pgm, text.encode()


def write_map(stem: str, grid: Grid, *, occupied: int = 65, free: int = 25) -> tuple[Path, Path]:
    """Write `stem`.pgm and `stem`.yaml, each completely or not at all; returns both paths.

    The yaml names the image as given if `stem` is absolute or has no folder, else by its file name alone.

    Raises:
        MapError: a file cannot be written.
    """
    pgm_path, yaml_path = Path(f"{stem}.pgm"), Path(f"{stem}.yaml")
    name = f"{stem}.pgm" if os.path.isabs(stem) else pgm_path.name
    pgm, text = map_bytes(grid, name, occupied=occupied, free=free)
    for path, data in ((pgm_path, pgm), (yaml_path, text)):
        try:
            write_atomic(path, data)
        except OSError as err:
            raise MapError(path, f"cannot be written: {err.strerror}") from err
    return pgm_path, yaml_path


def _yaml_tree(path: Path) -> dict[str, Any]:
    try:
        tree = yaml.safe_load(path.read_bytes())
    except OSError as err:
        raise MapError(path, f"the map's yaml cannot be read: {err.strerror}") from err
    except (yaml.YAMLError, UnicodeDecodeError) as err:
        where = getattr(err, "problem_mark", None)
        line = f" in line {where.line + 1}" if where is not None else ""
        problem = getattr(err, "problem", None) or "it is no text"
        raise MapError(path, f"is no valid yaml{line}: {problem}") from err
    if not isinstance(tree, dict):
        raise MapError(path, "expected a yaml with the keys image, resolution, origin, ...")
    return tree


def _value(path: Path, tree: dict[str, Any], key: str, kind: type, expected: str) -> Any:
    if key not in tree:
        raise MapError(path, f"key '{key}' is missing, expected {expected}")
    value = tree[key]
    if not isinstance(value, kind):
        raise MapError(path, f"key '{key}' is {value!r}, expected {expected}")
    return value


def _as_number(value: Any) -> float | None:
    """Convert to a number; yaml 1.1 reads `1e-2` as a text, yaml-cpp as a number: accept both."""
    if isinstance(value, bool):
        return None
    try:
        number = float(value)
    except (TypeError, ValueError):
        return None
    return number if math.isfinite(number) else None


def _number(path: Path, tree: dict[str, Any], key: str) -> float:
    number = _as_number(_value(path, tree, key, object, "a number"))
    if number is None:
        raise MapError(path, f"key '{key}' is {tree[key]!r}, expected a number")
    return number


def _origin(path: Path, tree: dict[str, Any]) -> tuple[float, float, float]:
    values = _value(path, tree, "origin", object, "[x, y, yaw]")
    numbers = [_as_number(v) for v in values] if isinstance(values, list) else []
    if len(numbers) != 3 or None in numbers:
        raise MapError(path, f"key 'origin' is {values!r}, expected [x, y, yaw]")
    x, y, yaw = (float(n) for n in numbers if n is not None)
    return x, y, yaw


def _thresholds(path: Path, tree: dict[str, Any]) -> Thresholds:
    mode = tree.get("mode", "trinary")
    if mode not in MODES:
        raise MapError(path, f"key 'mode' is {mode!r}, expected one of {', '.join(MODES)}")
    negate = _value(path, tree, "negate", object, "0 or 1")
    if negate not in (0, 1):
        raise MapError(path, f"key 'negate' is {negate!r}, expected 0 or 1")
    return Thresholds(
        occupied=_number(path, tree, "occupied_thresh"),
        free=_number(path, tree, "free_thresh"),
        negate=bool(negate),
        mode=mode,
    )
