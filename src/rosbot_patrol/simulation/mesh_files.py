"""Read triangles from mesh files: STL (binary or text) and Wavefront OBJ."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.errors import WorldError

Triangles = tuple[NDArray[np.float64], NDArray[np.int64]]


def load_mesh(path: Path) -> Triangles:
    """Vertices (V, 3) and triangles (F, 3) of a mesh file.

    Raises:
        WorldError: the file is missing, of another kind, or holds no triangles.
    """
    readers = {".stl": _read_stl, ".obj": _read_obj}
    reader = readers.get(path.suffix.lower())
    if reader is None:
        raise WorldError(path, "is no mesh that can be read here (stl and obj are)")
    try:
        data = path.read_bytes()
    except OSError as err:
        raise WorldError(path, f"the mesh cannot be read: {err.strerror}") from err
    try:
        vertices, faces = reader(data)
    except (ValueError, IndexError) as err:
        raise WorldError(path, f"the mesh is broken: {err}") from err
    if len(faces) == 0:
        raise WorldError(path, "the mesh has no triangles")
    if faces.min() < 0 or faces.max() >= len(vertices):
        raise WorldError(path, f"a triangle names a vertex that is not there ({len(vertices)} are)")
    return vertices, faces


def _read_stl(data: bytes) -> Triangles:
    count = int.from_bytes(data[80:84], "little") if len(data) >= 84 else -1
    if len(data) == 84 + 50 * count:
        record = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
        corners = np.frombuffer(data, record, count, 84)["corners"].astype(float).reshape(-1, 3)
    elif data.lstrip()[:5].lower() == b"solid":
        words = [line.split() for line in data.decode("ascii", "replace").splitlines()]
        corners = np.array([[float(v) for v in w[1:4]] for w in words if w and w[0] == "vertex"]).reshape(-1, 3)
    else:
        raise ValueError(f"{len(data)} bytes do not fit {count} triangles")
    if len(corners) % 3:
        raise ValueError(f"{len(corners)} corners are no whole number of triangles")
    return corners, np.arange(len(corners)).reshape(-1, 3)


def _read_obj(data: bytes) -> Triangles:
    vertices: list[list[float]] = []
    faces: list[tuple[int, int, int]] = []
    for line in data.decode("utf-8", "replace").splitlines():
        words = line.split()
        if not words:
            continue
        if words[0] == "v":
            vertices.append([float(v) for v in words[1:4]])
        elif words[0] == "f":
            corner = [int(w.split("/")[0]) for w in words[1:]]
            corner = [c - 1 if c > 0 else len(vertices) + c for c in corner]
            faces += [(corner[0], corner[k], corner[k + 1]) for k in range(1, len(corner) - 1)]
    return np.array(vertices, float).reshape(-1, 3), np.array(faces, np.int64).reshape(-1, 3)
