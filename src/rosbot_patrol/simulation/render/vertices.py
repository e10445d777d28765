"""Vertices of bodies as the renderer's programs read them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.simulation.scene.scene import Matrix, Visual
from rosbot_patrol.simulation.scene.shapes import mesh_of

MAX_PARTS = 48
"""Number of visuals of a body that are drawn at once; a vertex's partner must be among them."""

VERTEX = np.dtype(
    [
        ("position", "<f4", 3),
        ("normal", "<f4", 3),
        ("uv", "<f4", 2),
        ("colour", "<f4", 3),
        ("part_layer_label", "<f4", 3),
        ("partner", "<f4", 2),
    ]
)

Triangles = tuple[NDArray[np.void], NDArray[np.int64]]
"""Vertices of the type `VERTEX`, and the triangles' corners, shape (F, 3)."""


def vertices_of(visual: Visual, part: int, layer: tuple[int, float], label: int) -> Triangles:
    """Make the vertices of a visual.

    Args:
        visual: shape and material.
        part: index of its pose among those of the program.
        layer: the texture's layer and its size [m], 0 where it fills the face.
        label: 0 to 255.
    """
    mesh = mesh_of(visual.shape)
    vertices = np.zeros(len(mesh.positions), VERTEX)
    vertices["position"], vertices["normal"] = mesh.positions, mesh.normals
    vertices["uv"] = mesh.uv / layer[1] if layer[1] > 0 else mesh.uv / mesh.span + 0.5
    vertices["colour"] = visual.material.rgba[:3]
    vertices["part_layer_label"] = (part, layer[0], label / 255.0)
    detail = visual.shape.detail
    if detail is not None:
        vertices["colour"] *= detail.colours
        vertices["partner"] = np.stack([np.maximum(detail.partners, 0), detail.weights], axis=1)
    return vertices, mesh.faces


def placed(arrays: list[Triangles], poses: Matrix) -> list[Triangles]:
    """Vertices of visuals in the world, without parts; `poses` is world_from_visuals, shape (N, 4, 4)."""
    found = []
    for (vertices, faces), matrix in zip(arrays, poses, strict=True):
        moved = vertices.copy()
        moved["position"] = vertices["position"] @ matrix[:3, :3].T + matrix[:3, 3]
        moved["normal"] = vertices["normal"] @ matrix[:3, :3].T
        moved["part_layer_label"][:, 0] = 0
        moved["partner"] = 0
        found.append((moved, faces))
    return found
