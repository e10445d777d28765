"""Surfaces of a detailed person: tubes over smooth sections, folds of cloth, and the weights of their joints."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.simulation.scene.scene import Detail, Matrix, Shape
from rosbot_patrol.simulation.scene.shapes import grid_faces, smooth_normals, triangles_of
from rosbot_patrol.simulation.scene.textures import SIDE, smooth_noise

Floats = NDArray[np.float64]
Values = float | Floats
Knot = tuple[float, float, float, float, float]
"""A section: height, half width along y, reach forward, reach backward (both from x), x of the middle."""


def ramp(values: Values, start: Values, end: Values) -> Floats:
    """Smooth step: 0 up to `start`, 1 from `end` on; `end` may be the smaller."""
    t = np.clip((values - start) / (end - start), 0.0, 1.0)
    smooth: Floats = t * t * (3.0 - 2.0 * t)
    return smooth


def bump(values: Values, middle: Values, width: Values) -> Floats:
    """A bell of height 1 around `middle`."""
    bell: Floats = np.exp(-(((values - middle) / width) ** 2))
    return bell


def curve(x: Floats, knots: Sequence[float] | Floats, values: Sequence[float] | Floats) -> Floats:
    """Cubic Hermite curve through points with ascending knots, constant beyond them."""
    k, v = np.asarray(knots, float), np.asarray(values, float)
    slope = np.gradient(v, k)
    i = np.clip(np.searchsorted(k, x, side="right") - 1, 0, len(k) - 2)
    step = k[i + 1] - k[i]
    t = np.clip((x - k[i]) / step, 0.0, 1.0)
    t2, t3 = t * t, t * t * t
    drawn: Floats = (
        (2 * t3 - 3 * t2 + 1) * v[i]
        + (t3 - 2 * t2 + t) * step * slope[i]
        + (3 * t2 - 2 * t3) * v[i + 1]
        + (t3 - t2) * step * slope[i + 1]
    )
    return drawn


class Noise:
    """Smooth noise from -1 to 1 that repeats every unit of both coordinates."""

    def __init__(self, seed: int, cells_u: int, cells_v: int) -> None:
        self._field = 2.0 * smooth_noise(np.random.default_rng(seed), cells_u, cells_v) - 1.0

    def at(self, u: Floats, v: Floats) -> Floats:
        """Noise at coordinates of any shape, bilinear."""
        x, y = (u % 1.0) * SIDE, (v % 1.0) * SIDE
        x0, y0 = x.astype(int), y.astype(int)
        fx, fy = x - x0, y - y0
        x0, y0, x1, y1 = x0 % SIDE, y0 % SIDE, (x0 + 1) % SIDE, (y0 + 1) % SIDE
        f = self._field
        drawn: Floats = (f[y0, x0] * (1 - fx) + f[y0, x1] * fx) * (1 - fy) + (
            f[y1, x0] * (1 - fx) + f[y1, x1] * fx
        ) * fy
        return drawn

    def folds(self, u: Floats, v: Floats) -> Floats:
        """Ridges from -1 to 1: narrow valleys between round tops."""
        drawn: Floats = 2.0 * np.sqrt(np.abs(self.at(u, v))) - 1.0
        return drawn


@dataclass
class Grid:
    """A surface of rings, from the top down, each closed by a copy of its first point.

    Attributes:
        points: shape (rings, columns, 3) [m], in the frame of the body at rest.
        angle: of each column [rad], 0 forward, pi / 2 to the left; shape (columns,).
        colours: factors on the material's colour, shape (rings, columns, 3).
    """

    points: Floats
    angle: Floats
    colours: Floats

    @property
    def normals(self) -> Floats:
        """Unit normals outward, as the points."""
        rings, columns, _ = self.points.shape
        normals = smooth_normals(self.points.reshape(-1, 3), grid_faces(rings, columns))
        return normals.reshape(self.points.shape)

    def push(self, amount: Floats) -> None:
        """Move the points along their normals by `amount` [m], shape (rings, columns)."""
        self.points = self.points + self.normals * amount[..., None]

    def shade(self, factor: Floats) -> None:
        """Multiply the colours by a factor of shape (rings, columns)."""
        self.colours = self.colours * factor[..., None]

    def paint(self, colour: Sequence[float] | Floats, share: Floats) -> None:
        """Mix in a colour by a share of shape (rings, columns)."""
        self.colours = self.colours + (np.asarray(colour, float) - self.colours) * share[..., None]

    def fold(self, noise: Noise, depth: Floats, *, around: float, along: float) -> None:
        """Fold the cloth and darken the valleys.

        Args:
            noise: pattern of the folds.
            depth: of the folds [m], shape (rings, columns) or (rings, 1).
            around: repetitions of the pattern in a turn.
            along: repetitions of the pattern in a metre of height.
        """
        turn = np.broadcast_to(self.angle / (2 * np.pi), self.points.shape[:2])
        ridges = noise.folds(around * turn, along * self.points[..., 2] + 0.06 * np.sin(2 * np.pi * turn))
        deep = np.broadcast_to(depth, ridges.shape)
        self.push(deep * ridges)
        self.shade(1.0 + np.clip(deep * 28.0, 0.0, 0.22) * (ridges - 0.25))


def columns_of(count: int, *, front: float = 0.0) -> Floats:
    """Angles of `count` columns and the closing copy; `front`: up to 1, denser towards the front."""
    t = np.linspace(-np.pi, np.pi, count + 1)
    angles: Floats = t - front * np.sin(t)
    return angles


def tube(
    knots: Sequence[tuple[float, ...]],
    heights: Floats,
    angle: Floats,
    *,
    y: float = 0.0,
    square: float = 1.0,
    scale: float = 1.0,
) -> Grid:
    """Make a tube over sections.

    Args:
        knots: sections (`Knot`) with descending heights.
        heights: of the rings, descending, in the knots' unit.
        angle: of the columns [rad].
        y: middle of the tube [m].
        square: 1 an ellipse, less: nearer to a rectangle.
        scale: metres of the knots' unit.
    """
    table = np.array(knots[::-1], float)
    half, front, back, middle = (curve(heights, table[:, 0], table[:, k])[:, None] for k in (1, 2, 3, 4))
    c, s = np.cos(angle)[None, :], np.sin(angle)[None, :]
    c, s = np.sign(c) * np.abs(c) ** square, np.sign(s) * np.abs(s) ** square
    points = np.empty((len(heights), len(angle), 3))
    points[..., 0] = scale * (middle + np.where(c > 0, front, back) * c)
    points[..., 1] = y + scale * half * s
    points[..., 2] = scale * heights[:, None]
    return Grid(points, angle, np.ones_like(points))


def hem(grid: Grid, *, top: bool = False, depth: float = 0.02, dark: float = 0.4) -> None:
    """Close an end of a garment by a dark ring inside it."""
    edge = grid.points[0 if top else -1]
    middle = edge.mean(axis=0)
    inside = middle + 0.80 * (edge - middle)
    inside[:, 2] += -depth if top else depth
    shut = np.tile(middle, (len(edge), 1))
    shut[:, 2] = inside[:, 2].mean()
    ends = np.stack([shut, inside] if top else [inside, shut])
    tint = (grid.colours[0] if top else grid.colours[-1])[None] * dark
    tints = np.repeat(tint, 2, axis=0)
    grid.points = np.concatenate([ends, grid.points] if top else [grid.points, ends])
    grid.colours = np.concatenate([tints, grid.colours] if top else [grid.colours, tints])


def cap(grid: Grid, *, top: bool = False) -> None:
    """Close an end by a point."""
    edge = grid.points[0 if top else -1]
    shut = np.tile(edge.mean(axis=0), (1, len(edge), 1))
    tint = (grid.colours[0] if top else grid.colours[-1])[None]
    grid.points = np.concatenate([shut, grid.points] if top else [grid.points, shut])
    grid.colours = np.concatenate([tint, grid.colours] if top else [grid.colours, tint])


@dataclass(frozen=True)
class Skin:
    """Triangles that follow a joint, and near another joint partly that one.

    Attributes:
        joint: the joint's name.
        shape: triangles with their details; `Detail.partners` counts the joints in `partners`, -1 for none.
        partners: names of the other joints.
    """

    joint: str
    shape: Shape
    partners: tuple[str, ...] = ()


def skin(grid: Grid, joint: str, blends: dict[str, Floats] | None = None, rows: slice = slice(None)) -> Skin:
    """Make the skin of a grid.

    Args:
        grid: the surface.
        joint: that it follows.
        blends: other joint -> its weight, shape (rings,) or (rings, columns); the largest counts.
        rows: the rings of this skin; the others give it smooth normals.
    """
    points, normals, colours = grid.points[rows], grid.normals[rows], grid.colours[rows]
    rings, columns, _ = points.shape
    names = tuple(blends or {})
    every = [np.broadcast_to(w if w.ndim == 2 else w[:, None], grid.points.shape[:2]) for w in (blends or {}).values()]
    weights = np.stack(every)[:, rows] if every else np.zeros((1, rings, columns))
    weight = weights.max(axis=0)
    partners = np.where((weight > 0.0) & bool(names), weights.argmax(axis=0), -1)
    girth = np.linalg.norm(np.diff(points, axis=1), axis=2).cumsum(axis=1)
    uv = np.stack([np.pad(girth, ((0, 0), (1, 0))), points[..., 2]], axis=-1)
    detail = Detail(
        normals=normals.reshape(-1, 3),
        colours=np.clip(colours, 0.0, 1.6).reshape(-1, 3),
        uv=uv.reshape(-1, 2),
        partners=partners.ravel(),
        weights=weight.ravel(),
    )
    shape = Shape(kind="mesh", vertices=points.reshape(-1, 3), faces=grid_faces(rings, columns), detail=detail)
    return Skin(joint, shape, names)


def skin_of(shape: Shape, joint: str, frame: Matrix) -> Skin:
    """Make the skin of a plain shape in a joint's frame."""
    points, faces = triangles_of(shape)
    points = points @ frame[:3, :3].T + frame[:3, 3]
    count = len(points)
    detail = Detail(
        normals=smooth_normals(points, faces),
        colours=np.ones((count, 3)),
        uv=points[:, 1:],
        partners=np.full(count, -1),
        weights=np.zeros(count),
    )
    return Skin(joint, Shape(kind="mesh", vertices=points, faces=faces, detail=detail))
