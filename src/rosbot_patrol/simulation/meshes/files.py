"""Reader of triangles from mesh files: STL (binary or text), Wavefront OBJ with its colours, and COLLADA (`collada`).

Units and axes are as in Gazebo classic: metres and z up in STL and OBJ.
"""

from __future__ import annotations

import logging
from pathlib import Path

import numpy as np

from rosbot_patrol.counts import count_of
from rosbot_patrol.errors import WorldError
from rosbot_patrol.simulation.meshes.collada import read_dae
from rosbot_patrol.simulation.meshes.colours import Rgba, worn_colour
from rosbot_patrol.simulation.meshes.parts import MeshPart, Triangles, compact, merged

__all__ = ["MeshPart", "load_mesh", "load_parts", "merged"]

log = logging.getLogger(__name__)


def load_mesh(path: Path) -> Triangles:
    """Read the vertices (V, 3) and triangles (F, 3) of a mesh file, with all parts merged.

    Raises:
        WorldError: the file is missing, of another kind, or has no triangles.
    """
    return merged(load_parts(path))


def load_parts(path: Path) -> tuple[MeshPart, ...]:
    """Read the parts of a mesh file, at least one.

    Raises:
        WorldError: the file is missing, of another kind, broken, or has no triangles.
    """
    readers = {".stl": _read_stl, ".obj": _read_obj, ".dae": read_dae}
    reader = readers.get(path.suffix.lower())
    if reader is None:
        raise WorldError(path, "is no mesh that can be read here (stl, obj and dae are)")
    try:
        path.open("rb").close()
    except OSError as err:
        raise WorldError(path, f"the mesh cannot be read: {err.strerror}") from err
    try:
        parts = tuple(part for part in reader(path) if len(part.faces))
    except (ValueError, IndexError, OverflowError) as err:
        raise WorldError(path, f"the mesh is broken: {err}") from err
    if not parts:
        raise WorldError(path, "the mesh has no triangles")
    for part in parts:
        if part.faces.min() < 0 or part.faces.max() >= len(part.vertices):
            raise WorldError(path, f"a triangle names a vertex that is not there ({len(part.vertices)} are)")
        if not np.isfinite(part.vertices).all():
            raise WorldError(path, "the mesh is broken: a vertex is not finite")
    return parts


def _read_stl(path: Path) -> list[MeshPart]:
    data = path.read_bytes()
    count = int.from_bytes(data[80:84], "little") if len(data) >= 84 else -1
    if len(data) == 84 + 50 * count:
        record = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
        corners = np.frombuffer(data, record, count, 84)["corners"].astype(float).reshape(-1, 3)
    elif data.lstrip()[:5].lower() == b"solid":
        words = [line.split() for line in data.decode("ascii", "replace").splitlines()]
        corners = np.array([[float(v) for v in w[1:4]] for w in words if w and w[0] == "vertex"]).reshape(-1, 3)
    else:
        raise ValueError(f"{count_of(len(data), 'byte does', 'bytes do')} not fit {count_of(count, 'triangle')}")
    if len(corners) % 3:
        raise ValueError(f"{count_of(len(corners), 'corner is', 'corners are')} no whole number of triangles")
    return [MeshPart("", corners, np.arange(len(corners)).reshape(-1, 3))]


def _read_obj(path: Path) -> list[MeshPart]:
    vertices: list[list[float]] = []
    faces: dict[tuple[str, str], list[tuple[int, int, int]]] = {}
    name, material = "", ""
    colours: dict[str, Rgba] = {}
    for line in path.read_text(encoding="utf-8", errors="replace").splitlines():
        words = line.split()
        if not words:
            continue
        if words[0] == "v":
            vertices.append([float(v) for v in words[1:4]])
        elif words[0] == "f":
            corner = [int(w.split("/")[0]) for w in words[1:]]
            corner = [c - 1 if c > 0 else len(vertices) + c for c in corner]
            faces.setdefault((name, material), []).extend(
                (corner[0], corner[k], corner[k + 1]) for k in range(1, len(corner) - 1)
            )
        elif words[0] in ("o", "g"):
            name = " ".join(words[1:])
        elif words[0] == "usemtl":
            material = " ".join(words[1:])
        elif words[0] == "mtllib":
            colours |= _read_mtl(path.parent / " ".join(words[1:]))
    points = np.array(vertices, float).reshape(-1, 3)
    return [
        MeshPart(name, *compact(points, np.array(some, np.int64).reshape(-1, 3)), colours.get(material))
        for (name, material), some in faces.items()
    ]


def _read_mtl(path: Path) -> dict[str, Rgba]:
    """Colours by material, from its texture if it has one; an unusable library only loses the colours."""
    colours: dict[str, Rgba] = {}
    name = ""
    try:
        for line in path.read_text(encoding="utf-8", errors="replace").splitlines():
            words = line.split()
            if words[:1] == ["newmtl"]:
                name = " ".join(words[1:])
            elif words[:1] == ["Kd"]:
                r, g, b = (min(max(float(w), 0.0), 1.0) for w in words[1:4])
                colours.setdefault(name, (r, g, b, 1.0))
            elif words[:1] == ["map_Kd"]:
                worn = worn_colour([words[-1]], path.parent)
                colours |= {name: worn} if worn is not None else {}
    except OSError as err:
        log.warning("%s: the colours of the mesh cannot be read: %s", path, err.strerror)
    except ValueError as err:
        log.warning("%s: the colours of the mesh are broken: %s", path, err)
    return colours
