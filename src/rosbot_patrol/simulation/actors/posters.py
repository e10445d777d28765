"""Posters: boards on a wall with the picture of a person.

The picture is the person's own body pressed flat: its colour and outline are a person's, its depth is a board's.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rosbot_patrol.simulation.actors.people import Look, person_body
from rosbot_patrol.simulation.scene.matrices import from_xyz_rpy
from rosbot_patrol.simulation.scene.scene import Body, Collision, Detail, Material, Matrix, Shape, Visual
from rosbot_patrol.simulation.scene.shapes import triangles_of
from rosbot_patrol.simulation.scene.slices import Slice, slice_bodies

BOTTOM, SHARE = 0.45, 0.7  # lower edge [m]; size of the picture relative to the person
_THICK, _PRESSED = 0.01, 0.01  # thickness of the board [m]; depth of the picture relative to the person's
_MARGIN = 0.06  # margin of the board around the picture [m]
_BOARD = (0.86, 0.84, 0.78, 1.0)


def poster_body(name: str, look: Look) -> Body:
    """Make a poster that hangs on a wall in the plane x = 0 and faces along x."""
    size = SHARE * look.height
    wide, high = 0.5 * size + 2.0 * _MARGIN, size + 2.0 * _MARGIN
    middle = from_xyz_rpy((0.0, 0.0, BOTTOM + high / 2.0), (0.0, 0.0, 0.0))
    board = Shape(kind="box", size=(_THICK, wide, high))
    visuals = [Visual(shape=board, pose=middle, material=Material(rgba=_BOARD)), *_pressed(look)]
    solid = Collision(shape=board, pose=middle)
    return Body(name=name, kind="object", static=False, visuals=tuple(visuals), collisions=(solid,))


def _pressed(look: Look) -> list[Visual]:
    """The parts of a standing person, flattened onto the board."""
    scale = np.array([_PRESSED, SHARE, SHARE])
    shift = np.array([_THICK / 2.0 + 0.005, 0.0, BOTTOM + _MARGIN])
    parts = []
    for visual in person_body("person", look).visuals:
        vertices, faces = triangles_of(visual.shape)
        placed = vertices @ visual.pose[:3, :3].T + visual.pose[:3, 3]
        detail = _printed(visual.shape.detail) if visual.shape.detail is not None else None
        shape = Shape(kind="mesh", vertices=placed * scale + shift, faces=faces, detail=detail)
        parts.append(Visual(shape=shape, material=visual.material))
    return parts


def _printed(detail: Detail) -> Detail:
    """The details on paper: all face along x, with the light of the photograph in their colours."""
    towards = detail.normals @ (0.8, 0.36, 0.48)
    colours = detail.colours * (0.75 + 0.25 * np.clip(towards, -1.0, 1.0))[:, None]
    normals = np.broadcast_to((1.0, 0.0, 0.0), detail.normals.shape)
    return replace(detail, normals=normals, colours=colours, weights=np.zeros(len(normals)))


class PosterFigure:
    """A poster as an actor: it neither moves nor is warm."""

    warmth = 0.0
    warm_heights: tuple[float, ...] = ()
    radius = 0.05
    cycle = 1.0
    turn_rate = 2.5

    def __init__(self, name: str, look: Look) -> None:
        self.body = poster_body(name, look)
        self.look = look.name
        self._still = Body(name=name, collisions=self.body.collisions)

    def pose_parts(self, phase: float, speed: float) -> Matrix | None:
        """None: no moving parts."""

    def cut(self, height: float, phase: float, speed: float) -> Slice:
        """Section of the board, if the plane is at its height."""
        return slice_bodies([self._still], height)
