"""Contact shadows: soft dark spots on the floor under people and pets, in colour only, not in depth or labels."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.simulation.scene.scene import Body, Matrix
from rosbot_patrol.simulation.scene.shapes import mesh_of

CASTERS = ("person", "pet", "fire_hydrant")

_SIDES = 20
_RINGS = ((0.0, 0.50), (0.35, 0.42), (0.65, 0.18), (1.0, 0.0))
"""Share of the radius, and share of the light that is missing."""

_ABOVE = 0.004  # height above the floor [m]
_VERTEX = """
#version 330
uniform mat4 view;
uniform mat4 projection;
uniform mat4 placed;
in vec3 position_and_shade;
out float v_shade;
void main() {
    gl_Position = projection * (view * (placed * vec4(position_and_shade.xy, 0.0, 1.0)));
    v_shade = position_and_shade.z;
}
"""
_FRAGMENT = """
#version 330
in float v_shade;
out vec4 fragment;
void main() {
    fragment = vec4(vec3(1.0 - v_shade), 1.0);
}
"""


class Shadows:
    """Draws the shadows of one context.

    Args:
        context: OpenGL's.
    """

    def __init__(self, context: Any) -> None:
        self._context = context
        self.program = context.program(_VERTEX, _FRAGMENT)
        corners = context.buffer(np.ascontiguousarray(_disc(), "<f4").tobytes())
        self._disc = context.vertex_array(self.program, [(corners, "3f", "position_and_shade")])

    def draw(self, places: list[Matrix]) -> None:
        """Darken the floor; `places` is world_from_disc of each shadow, shape (4, 4).

        The picture must be drawn already, and the program's `view` and `projection` be set.
        """
        context = self._context
        context.enable(context.BLEND)
        context.blend_func = context.ZERO, context.SRC_COLOR, context.ZERO, context.ONE  # labels stay
        context.fbo.depth_mask = False
        for place in places:
            self.program["placed"].write(np.ascontiguousarray(place.T, "<f4").tobytes())
            self._disc.render()
        context.fbo.depth_mask = True
        context.disable(context.BLEND)


def _disc() -> NDArray[np.float64]:
    """Triangles of a disc of radius 1: x, y and shade of each corner, shape (N, 3)."""
    angle = np.linspace(0.0, 2.0 * np.pi, _SIDES + 1)
    around = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    rings = [np.column_stack([radius * around, np.full(len(around), shade)]) for radius, shade in _RINGS]
    corners = []
    for inner, outer in itertools.pairwise(rings):
        corners += [inner[:-1], outer[:-1], outer[1:], inner[:-1], outer[1:], inner[1:]]
    made: NDArray[np.float64] = np.stack(corners, axis=1).reshape(-1, 3)
    return made


def shadow_of(body: Body) -> Matrix | None:
    """body_from_disc of a body's shadow, None for a body without one."""
    if body.kind not in CASTERS or not body.collisions:
        return None
    corners = [mesh_of(solid.shape).positions @ solid.pose[:3, :3].T + solid.pose[:3, 3] for solid in body.collisions]
    x, y, _ = np.abs(np.vstack(corners)).max(axis=0)
    place = np.diag([x + 0.14, y + 0.12, 1.0, 1.0])
    place[2, 3] = _ABOVE
    return place
