"""The simulated world's model for physics and camera: bodies with shapes, poses and looks.

Poses are homogeneous matrices of shape (4, 4), `world_from_body`, `body_from_visual` (metres, x forward, z up).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray

Matrix = NDArray[np.float64]
ShapeKind = Literal["box", "cylinder", "sphere", "capsule", "plane", "mesh"]
BodyKind = Literal["floor", "wall", "furniture", "person", "fire_hydrant", "robot", "pet", "door", "object"]


def identity() -> Matrix:
    """The identity pose, shape (4, 4)."""
    return np.eye(4)


@dataclass(frozen=True, kw_only=True)
class Detail:
    """Details of a mesh's vertices, V in number, for the renderer.

    A vertex with a partner moves with the weighted mean of two poses: its own visual's, and that of another visual of
    the body. At a joint such visuals form one smooth surface. Only the OpenGL renderer uses colours and partners.

    Attributes:
        normals: unit normals, shape (V, 3).
        colours: factors on the material's colour, shape (V, 3).
        uv: place on the texture [m], shape (V, 2).
        partners: index of the other visual in its body, -1 for none, shape (V,).
        weights: weight of the other visual's pose, 0 to 1, shape (V,).
    """

    normals: NDArray[np.float64]
    colours: NDArray[np.float64]
    uv: NDArray[np.float64]
    partners: NDArray[np.int64]
    weights: NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Shape:
    """A geometric primitive about its own origin.

    Attributes:
        kind: box (size = x, y, z), cylinder (radius, length along z), sphere (radius,), capsule (radius, length of
            the cylindrical part along z), plane (x, y; normal +z), mesh (scale x, y, z).
        mesh: file of a mesh (stl, obj, dae), or None.
        vertices, faces: the triangles of a mesh, shapes (V, 3) and (F, 3), or None to read them from the file.
        detail: normals, colours and joints of those vertices, or None.
    """

    kind: ShapeKind
    size: tuple[float, ...] = ()
    mesh: Path | None = None
    vertices: NDArray[np.float64] | None = None
    faces: NDArray[np.int64] | None = None
    detail: Detail | None = None


@dataclass(frozen=True, kw_only=True)
class Material:
    """Colour (linear 0 to 1, RGBA), and optionally the name of one of the renderer's procedural textures."""

    rgba: tuple[float, float, float, float] = (0.7, 0.7, 0.7, 1.0)
    texture: str = ""


@dataclass(frozen=True, kw_only=True)
class Visual:
    """A shape that is visible to the camera."""

    shape: Shape
    pose: Matrix = field(default_factory=identity)
    material: Material = Material()


@dataclass(frozen=True, kw_only=True)
class Collision:
    """A shape that lidar, range sensors and the robot's base meet."""

    shape: Shape
    pose: Matrix = field(default_factory=identity)


@dataclass(frozen=True, kw_only=True)
class Body:
    """A named body. `pose` is world_from_body at the start; `static` bodies never move."""

    name: str
    kind: BodyKind = "object"
    pose: Matrix = field(default_factory=identity)
    static: bool = True
    visuals: tuple[Visual, ...] = ()
    collisions: tuple[Collision, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Intrinsics:
    """A pinhole camera without distortion: size [px], focal lengths and principal point [px], clip distances [m].

    As in camera_info, the centre of the first pixel is at 0, so the picture's centre is at (width - 1) / 2.
    """

    width: int = 640
    height: int = 480
    fx: float = 554.3827
    fy: float = 554.3827
    cx: float = 319.5
    cy: float = 239.5
    near: float = 0.1
    far: float = 100.0


class Mover(Protocol):
    """A body that moves on its own: an actor, a door."""

    @property
    def name(self) -> str:
        """Unique in the world."""

    @property
    def body(self) -> Body:
        """Its shapes and looks."""

    @property
    def matrix(self) -> Matrix:
        """world_from_body."""

    def pose_parts(self) -> Matrix | None:
        """body_from_visuals, shape (number of visuals, 4, 4); None without moving parts."""


class SceneRenderer(Protocol):
    """Renderer of a scene of bodies; one per process and thread."""

    def add(self, body: Body) -> None:
        """Add a body to the scene; its name must be new."""

    def remove(self, name: str) -> None:
        """Remove a body from the scene."""

    def move(self, name: str, world_from_body: Matrix) -> None:
        """Move a body."""

    def pose_visuals(self, name: str, body_from_visuals: Matrix) -> None:
        """Set the poses of a body's visuals (limbs, wheels) relative to it, shape (number of visuals, 4, 4)."""

    def render(
        self, world_from_optical: Matrix, intrinsics: Intrinsics
    ) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
        """Draw the picture of a camera with the given pose of its optical frame (x right, y down, z forward).

        Returns:
            Colour, RGB, shape (height, width, 3), and depth along the optical axis [m], shape (height, width),
            inf where nothing is nearer than the far clip.
        """

    def close(self) -> None:
        """Release the renderer's resources."""
