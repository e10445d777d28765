"""Parts of a mesh: triangles with one name and one colour each."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.simulation.meshes.colours import Rgba

Triangles = tuple[NDArray[np.float64], NDArray[np.int64]]


@dataclass(frozen=True)
class MeshPart:
    """Triangles with one name and one colour.

    Attributes:
        name: name of the object or node in the file, "" if it has none.
        vertices: shape (V, 3) [m].
        faces: shape (F, 3), F > 0.
        rgba: the file's own colour, None if it has none.
    """

    name: str
    vertices: NDArray[np.float64]
    faces: NDArray[np.int64]
    rgba: Rgba | None = None


def merged(parts: tuple[MeshPart, ...]) -> Triangles:
    """Merge vertices and triangles of several parts."""
    starts = np.cumsum([0] + [len(part.vertices) for part in parts])
    faces = [part.faces + start for part, start in zip(parts, starts, strict=False)]
    return np.vstack([part.vertices for part in parts]), np.vstack(faces)


def compact(vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> Triangles:
    """Keep only the vertices that the faces use; indices out of range stay so."""
    if not len(faces) or faces.min() < 0 or faces.max() >= len(vertices):
        return vertices, faces
    used, places = np.unique(faces, return_inverse=True)
    return vertices[used], places.reshape(-1, 3)
