"""Reader of COLLADA files (pycollada), as in Gazebo classic: <unit> scales, <up_axis> is ignored.

Ignoring <up_axis> is gazebo-classic's issue 1305: a mesh that is upright in Gazebo is upright here. Only shapes and
their colours are read. Errors elsewhere in the file (lamps, cameras, animations) do not matter. A missing material only
loses its colour, and without a named scene the first one is used.
"""

from __future__ import annotations

import io
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.simulation.meshes.colours import Rgba, worn_colour
from rosbot_patrol.simulation.meshes.parts import MeshPart, compact

_NOT_SHAPES = re.compile(
    rb"<library_(lights|cameras|animations|animation_clips|physics_\w+|force_fields)\b.*?</library_\1\s*>", re.DOTALL
)
_MATERIALS = re.compile(rb"<material\b[^>]*\bid=[\"']([^\"']*)")
_BOUND = re.compile(
    rb"<instance_material\b[^>]*?\btarget=[\"']#([^\"']*)[\"'](?:[^>]*/>|.*?</instance_material\s*>)", re.DOTALL
)
_BINDING = re.compile(rb"<bind_material\b.*?</bind_material\s*>", re.DOTALL)


def read_dae(path: Path) -> list[MeshPart]:
    """Read the parts of a COLLADA file.

    Raises:
        OSError: it cannot be read.
        ValueError: it is broken.
    """
    data = _NOT_SHAPES.sub(b"", path.read_bytes())
    there = set(_MATERIALS.findall(data))
    data = _BOUND.sub(lambda bound: bound[0] if bound[1] in there else b"", data)
    parts = _parts(data, path.parent)
    return parts or _parts(_BINDING.sub(b"", data), path.parent)


def _parts(data: bytes, folder: Path) -> list[MeshPart]:
    import collada  # 7 MB and 0.1 s: only for worlds that need it

    try:
        bearable = [collada.common.DaeUnsupportedError, collada.common.DaeBrokenRefError]  # as a missing texture
        document = collada.Collada(io.BytesIO(data), ignore=bearable)
        metres = float(document.assetInfo.unitmeter or 1.0)
        scene = document.scene if b"<scene" in data else next(iter(document.scenes), None)
        bound = [found for node in (scene.nodes if scene is not None else ()) for found in _bound(node, np.eye(4), "")]
        parts = [part for name, geometry in bound for part in _dae_parts(name, geometry, folder)]
    except Exception as err:  # pycollada passes on errors of lxml, of numpy and its own
        raise ValueError(str(err) or type(err).__name__) from err
    return [MeshPart(part.name, part.vertices * metres, part.faces, part.rgba) for part in parts]


def _bound(node: Any, world_from_parent: NDArray[np.float64], name: str) -> Iterator[tuple[str, Any]]:
    """(name of the node, geometry in the scene) for all nodes below one of a COLLADA scene."""
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
            yield name, getattr(controller, "geometry", controller)  # a skin, in its bind pose


def _dae_parts(name: str, geometry: Any, folder: Path) -> Iterator[MeshPart]:
    for primitive in geometry.primitives():
        if not hasattr(primitive, "triangleset") and not hasattr(primitive, "vertex_index"):
            continue
        triangles = primitive.triangleset() if hasattr(primitive, "triangleset") else primitive
        if triangles.vertex_index is None or triangles.vertex_index.ndim != 2 or triangles.vertex_index.shape[1] != 3:
            continue  # lines and points
        vertices = np.asarray(triangles.vertex, float).reshape(-1, 3)
        yield MeshPart(
            name, *compact(vertices, np.asarray(triangles.vertex_index, np.int64)), _dae_colour(primitive, folder)
        )


def _dae_colour(primitive: Any, folder: Path) -> Rgba | None:
    effect = getattr(getattr(primitive, "material", None), "effect", None)
    colour = getattr(effect, "diffuse", None)
    picture = getattr(getattr(getattr(colour, "sampler", None), "surface", None), "image", None)
    if picture is not None:
        return worn_colour([str(picture.path)], folder)
    if not isinstance(colour, tuple | list) or len(colour) < 3 or not _names_colour(effect):
        return None
    r, g, b = (float(min(max(v, 0.0), 1.0)) for v in colour[:3])
    return (r, g, b, 1.0)


def _names_colour(effect: Any) -> bool:
    """Whether a file states the colour: otherwise pycollada's is black."""
    diffuse = [element for element in effect.xmlnode.iter() if str(element.tag).endswith("}diffuse")]
    return any(str(child.tag).endswith("}color") for element in diffuse for child in element)
