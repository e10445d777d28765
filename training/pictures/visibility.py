"""How well an actor is seen in a picture: its outline were nothing before it, and by how much it stands out."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.simulation.scene.scene import Intrinsics, Matrix, Shape
from rosbot_patrol.simulation.scene.shapes import mesh_of
from training.pictures.labels import HEIGHT, WIDTH
from training.pictures.scenes import Actor


def silhouette(actor: Actor, optical: Matrix, intrinsics: Intrinsics) -> tuple[int, int]:
    """Pixels of an actor were nothing before it: on a picture without edges, and inside the real one's edges."""
    scale, pad = 2, 640
    canvas = np.zeros(((480 + 2 * pad) // scale, (640 + 2 * pad) // scale), np.uint8)
    eye_from_body = np.linalg.inv(optical) @ actor.pose
    poses = actor.parts if actor.parts is not None else [v.pose for v in actor.body.visuals]
    for visual, pose in zip(actor.body.visuals, poses, strict=True):
        vertices = visual.shape.vertices if visual.shape.vertices is not None else _corners(visual.shape)
        points = vertices @ (eye_from_body @ pose)[:3, :3].T + (eye_from_body @ pose)[:3, 3]
        depth = np.maximum(points[:, 2], 0.1)
        u = intrinsics.fx * points[:, 0] / depth + intrinsics.cx + pad
        v = intrinsics.fy * points[:, 1] / depth + intrinsics.cy + pad
        hull = cv2.convexHull((np.stack([u, v], axis=1) / scale).astype(np.float32))
        cv2.fillConvexPoly(canvas, hull.astype(np.int32), 1)
    inner = canvas[pad // scale : (pad + 480) // scale, pad // scale : (pad + 640) // scale]
    return cv2.countNonZero(canvas) * scale * scale, cv2.countNonZero(inner) * scale * scale


def _corners(shape: Shape) -> NDArray[Any]:
    return mesh_of(shape).positions


def contrast(picture: NDArray[Any], mask: NDArray[Any], *, reach: int = 11) -> float:
    """By how much [levels] what lies inside of an outline differs from what lies beside it, at its clearer quarter.

    Args:
        picture: RGB, uint8, shape (288, 384, 3).
        mask: where the figure is seen, at 640 x 480.
        reach: size [px] of the neighbourhoods that are compared.
    """
    small = cv2.resize(mask.astype(np.uint8), (WIDTH, HEIGHT), interpolation=cv2.INTER_AREA)
    near = _around(small, reach)
    small = small[near]
    grey, ones = picture[near].astype(np.float32).mean(axis=2), small.astype(np.float32)
    size = (reach, reach)
    edge = cv2.dilate(small, np.ones((3, 3), np.uint8)) != cv2.erode(small, np.ones((3, 3), np.uint8))
    inside, there = cv2.boxFilter(grey * ones, -1, size), cv2.boxFilter(ones, -1, size)
    outside, away = cv2.boxFilter(grey * (1 - ones), -1, size), cv2.boxFilter(1 - ones, -1, size)
    good = edge & (there > 0.1) & (away > 0.1)
    if not good.any():
        return 0.0
    gap = np.abs(inside[good] / there[good] - outside[good] / away[good])
    return float(np.percentile(gap, 75))


def _around(mask: NDArray[Any], reach: int) -> tuple[slice, slice]:
    """The rows and columns in which a mask is set, and `reach` more on each side: nothing beyond is looked at."""
    spans = []
    for axis in (1, 0):
        at = np.flatnonzero(mask.any(axis=axis))
        spans.append(slice(max(int(at[0]) - reach, 0), int(at[-1]) + reach + 1) if len(at) else slice(0, 1))
    return spans[0], spans[1]
