"""Read triangles from mesh files: STL (binary or text), Wavefront OBJ with its colours, and COLLADA (pycollada).

Units and axes are taken as Gazebo classic takes them: metres and z up in STL and OBJ; a COLLADA file's <unit> scales
it, its <up_axis> is not looked at (gazebo-classic issue 1305), so that what stands right in Gazebo stands right here.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.errors import WorldError
from rosbot_patrol.simulation.picture_colours import Rgba, worn_colour

log = logging.getLogger(__name__)

Triangles = tuple[NDArray[np.float64], NDArray[np.int64]]


@dataclass(frozen=True)
class MeshPart:
    """Triangles of one name and one colour.

    Attributes:
        name: of the object or node in the file, "" where it has none.
        vertices: shape (V, 3) [m].
        faces: shape (F, 3), F > 0.
        rgba: the file's own colour, None where it has none.
    """

    name: str
    vertices: NDArray[np.float64]
    faces: NDArray[np.int64]
    rgba: Rgba | None = None


def load_mesh(path: Path) -> Triangles:
    """Vertices (V, 3) and triangles (F, 3) of a mesh file, all parts together.

    Raises:
        WorldError: the file is missing, of another kind, or holds no triangles.
    """
    return merged(load_parts(path))


def load_parts(path: Path) -> tuple[MeshPart, ...]:
    """The parts of a mesh file, at least one.

    Raises:
        WorldError: the file is missing, of another kind, broken, or holds no triangles.
    """
    readers = {".stl": _read_stl, ".obj": _read_obj, ".dae": _read_dae}
    reader = readers.get(path.suffix.lower())
    if reader is None:
        raise WorldError(path, "is no mesh that can be read here (stl, obj and dae are)")
    try:
        path.open("rb").close()
    except OSError as err:
        raise WorldError(path, f"the mesh cannot be read: {err.strerror}") from err
    try:
        parts = tuple(part for part in reader(path) if len(part.faces))
    except (ValueError, IndexError) as err:
        raise WorldError(path, f"the mesh is broken: {err}") from err
    if not parts:
        raise WorldError(path, "the mesh has no triangles")
    for part in parts:
        if part.faces.min() < 0 or part.faces.max() >= len(part.vertices):
            raise WorldError(path, f"a triangle names a vertex that is not there ({len(part.vertices)} are)")
        if not np.isfinite(part.vertices).all():
            raise WorldError(path, "the mesh is broken: a vertex is not finite")
    return parts


def merged(parts: tuple[MeshPart, ...]) -> Triangles:
    """Vertices and triangles of several parts as one."""
    starts = np.cumsum([0] + [len(part.vertices) for part in parts])
    faces = [part.faces + start for part, start in zip(parts, starts, strict=False)]
    return np.vstack([part.vertices for part in parts]), np.vstack(faces)


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
        raise ValueError(f"{len(data)} bytes do not fit {count} triangles")
    if len(corners) % 3:
        raise ValueError(f"{len(corners)} corners are no whole number of triangles")
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
        MeshPart(name, *_compact(points, np.array(some, np.int64).reshape(-1, 3)), colours.get(material))
        for (name, material), some in faces.items()
    ]


def _read_mtl(path: Path) -> dict[str, Rgba]:
    """Colour by material, of its texture where it has one; where the library is no good only the colours are lost."""
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


def _compact(vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> Triangles:
    """Only the vertices that the faces use; indices that are out of range stay so."""
    if not len(faces) or faces.min() < 0 or faces.max() >= len(vertices):
        return vertices, faces
    used, places = np.unique(faces, return_inverse=True)
    return vertices[used], places.reshape(-1, 3)


def _read_dae(path: Path) -> list[MeshPart]:
    import collada  # 7 MB and 0.1 s, for the worlds that need it

    try:
        bearable = [collada.common.DaeUnsupportedError, collada.common.DaeBrokenRefError]  # as a missing texture
        document = collada.Collada(str(path), ignore=bearable)
        metres = float(document.assetInfo.unitmeter or 1.0)
        nodes = document.scene.nodes if document.scene is not None else []
        bound = [found for node in nodes for found in _bound(node, np.eye(4), "")]
        parts = [part for name, geometry in bound for part in _dae_parts(name, geometry, path.parent)]
    except Exception as err:  # pycollada lets what it stumbles over through: of lxml, of numpy, its own
        raise ValueError(str(err) or type(err).__name__) from err
    return [MeshPart(part.name, part.vertices * metres, part.faces, part.rgba) for part in parts]


def _bound(node: Any, world_from_parent: NDArray[np.float64], name: str) -> Iterator[tuple[str, Any]]:
    """(name of the node, geometry in the scene) below a node of a COLLADA scene."""
    import collada.scene as scene

    if isinstance(node, scene.Node | scene.NodeNode):
        own = node.node if isinstance(node, scene.NodeNode) else node
        label = (own.xmlnode.get("name") or own.id or name) if own.xmlnode is not None else name
        for child in own.children:
            yield from _bound(child, world_from_parent @ own.matrix, label)
    elif isinstance(node, scene.GeometryNode):
        for geometry in node.objects("geometry", world_from_parent):
            yield name, geometry
    elif isinstance(node, scene.ControllerNode):
        for controller in node.objects("controller", world_from_parent):
            yield name, controller


def _dae_parts(name: str, geometry: Any, folder: Path) -> Iterator[MeshPart]:
    for primitive in geometry.primitives():
        if not hasattr(primitive, "triangleset") and not hasattr(primitive, "vertex_index"):
            continue
        triangles = primitive.triangleset() if hasattr(primitive, "triangleset") else primitive
        if triangles.vertex_index is None or triangles.vertex_index.ndim != 2 or triangles.vertex_index.shape[1] != 3:
            continue  # lines and points
        vertices = np.asarray(triangles.vertex, float).reshape(-1, 3)
        yield MeshPart(
            name, *_compact(vertices, np.asarray(triangles.vertex_index, np.int64)), _dae_colour(primitive, folder)
        )


def _dae_colour(primitive: Any, folder: Path) -> Rgba | None:
    effect = getattr(getattr(primitive, "material", None), "effect", None)
    colour = getattr(effect, "diffuse", None)
    picture = getattr(getattr(getattr(colour, "sampler", None), "surface", None), "image", None)
    if picture is not None:
        return worn_colour([str(picture.path)], folder)
    if not isinstance(colour, tuple | list) or len(colour) < 3:
        return None
    r, g, b = (float(min(max(v, 0.0), 1.0)) for v in colour[:3])
    return (r, g, b, 1.0)
