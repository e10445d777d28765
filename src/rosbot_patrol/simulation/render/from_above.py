"""A picture of a whole world from high above, north up, without ceilings and lintels."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.errors import WorldError
from rosbot_patrol.simulation.actors.walkers import Walker
from rosbot_patrol.simulation.noise import noise_of
from rosbot_patrol.simulation.physics.bullet_shapes import bounds_of
from rosbot_patrol.simulation.scene.matrices import from_pose2d
from rosbot_patrol.simulation.scene.scene import Body, Collision, Intrinsics, SceneRenderer, Visual
from rosbot_patrol.simulation.sdf.world import World

_CUT = 1.9  # parts that begin higher (ceilings, lintels, lamps) are left out [m]
_MARGIN = 0.5  # margin around the walls [m]
_FAR = 4.0  # height of the camera in widths of the world: nearly a plan view


@dataclass(frozen=True)
class WorldPicture:
    """Pixels, RGB, shape (height, width, 3), and the part of the world that they show.

    Attributes:
        low, high: lower left and upper right corner on the floor, x, y [m].
    """

    pixels: NDArray[np.uint8]
    low: tuple[float, float]
    high: tuple[float, float]

    def pixel_of(self, x: float, y: float) -> tuple[float, float]:
        """Column and row of a point on the floor."""
        height, width = self.pixels.shape[:2]
        column = (x - self.low[0]) / (self.high[0] - self.low[0]) * width
        return column, (self.high[1] - y) / (self.high[1] - self.low[1]) * height


def draw_world(world: World, renderer: SceneRenderer, *, width: int = 1200) -> WorldPicture:
    """Draw a world, with its actors, `width` pixels wide.

    Raises:
        WorldError: the world has nothing but its floor.
    """
    low, high = _extent(world)
    for body in (*world.bodies, *(door.body for door in world.doors)):
        renderer.add(_without_ceiling(body))
    for i, actor in enumerate(world.actors):
        walker = Walker(actor.name, actor.model, "", actor.pose, noise_of(0, "look", i))
        renderer.add(replace(walker.body, pose=from_pose2d(actor.pose)))
    span = high - low
    camera_height = _FAR * float(span.max())
    height = max(round(width * span[1] / span[0]), 1)
    focal = width * camera_height / float(span[0])
    intrinsics = Intrinsics(
        width=width, height=height, fx=focal, fy=focal, cx=width / 2.0, cy=height / 2.0,
        near=0.5 * camera_height, far=1.5 * camera_height,
    )  # fmt: skip
    above = np.diag([1.0, -1.0, -1.0, 1.0])  # x right, y down, z into the picture
    above[:3, 3] = *((low + high) / 2.0), camera_height
    pixels, _ = renderer.render(above, intrinsics)
    return WorldPicture(np.array(pixels), (float(low[0]), float(low[1])), (float(high[0]), float(high[1])))


def _extent(world: World) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    bounds = []
    for body in (*world.bodies, *(door.body for door in world.doors)):
        parts = [*body.collisions, *(Collision(shape=v.shape, pose=v.pose) for v in body.visuals)]
        bounds += [bounds_of(part, body.pose) for part in parts if part.shape.kind != "plane"]
    around = np.array([[-0.5], [0.5]])
    bounds += [around + np.array([actor.pose.x, actor.pose.y, 1.0]) for actor in world.actors]
    if not bounds:
        raise WorldError(f"world '{world.name}'", "has nothing to look at but its floor")
    every = np.array(bounds)
    low, high = every[:, 0, :2].min(axis=0) - _MARGIN, every[:, 1, :2].max(axis=0) + _MARGIN
    if not math.isfinite(float(np.ptp(np.stack([low, high])))):
        raise WorldError(f"world '{world.name}'", "has no finite extent")
    return low, high


def _without_ceiling(body: Body) -> Body:
    return replace(body, visuals=tuple(v for v in body.visuals if not _hangs(v, body)))


def _hangs(visual: Visual, body: Body) -> bool:
    if visual.shape.kind == "plane":
        return bool((body.pose @ visual.pose)[2, 3] > _CUT)
    return bool(bounds_of(Collision(shape=visual.shape, pose=visual.pose), body.pose)[0, 2] > _CUT)
