"""Surfaces of cats and dogs: trunk, neck, head, legs with hocks, and fur with its pattern.

The surfaces are made about a pet that stands still; each follows its joint, and blends into the next one.
"""

from __future__ import annotations

import zlib
from collections.abc import Mapping

import numpy as np

from rosbot_patrol.simulation.actors.figure.surface import (
    Floats,
    Grid,
    Noise,
    Skin,
    bump,
    cap,
    columns_of,
    curve,
    ramp,
    skin,
)
from rosbot_patrol.simulation.actors.pet_looks import PetLook
from rosbot_patrol.simulation.scene.scene import Matrix


def trunk(look: PetLook) -> Skin:
    """Chest, loin and rump."""
    h = look.height
    deep, wide = look.depth / 0.46, look.width / 0.36
    x = np.array([1.10, 0.97, 0.78, 0.40, 0.0, -0.40, -0.75, -0.96, -1.06])
    upper = np.array([0.80, 0.92, 0.99, 0.98, 0.955, 0.945, 0.965, 0.94, 0.86])
    lower = 1.0 - deep * (1.0 - np.array([0.66, 0.55, 0.50, 0.485, 0.505, 0.545, 0.55, 0.58, 0.70]))
    half = wide * np.array([0.06, 0.115, 0.150, 0.170, 0.168, 0.148, 0.150, 0.135, 0.07])
    stations = np.linspace(1.10, -1.06, 20)
    a = [curve(stations, x[::-1], values[::-1]) for values in (upper, lower, half)]
    grid = _lengthwise(0.5 * look.length * h * stations, h * a[0], h * a[1], h * a[2])
    _fur(grid, look, 1.0)
    for end in (True, False):
        cap(grid, top=end)
    return skin(grid, "trunk")


def neck(look: PetLook, frame: Matrix) -> Skin:
    """The neck; its base blends into the trunk."""
    h = look.height
    z = np.linspace(0.34, -0.20, 8) * h
    depth = curve(z / h, (-0.2, 0.0, 0.2, 0.34), (0.25, 0.20, 0.16, 0.145)) * h
    width = curve(z / h, (-0.2, 0.0, 0.2, 0.34), (0.17, 0.145, 0.125, 0.12)) * h
    grid = _upright(z, depth, width)
    grid.points = _placed(grid.points, frame)
    _fur(grid, look, 1.2)
    cap(grid, top=True)
    weights = np.concatenate([[0.0], ramp(z / h, 0.08, -0.12)])
    return skin(grid, "neck", {"trunk": weights})


def head(look: PetLook, frame: Matrix) -> Skin:
    """Skull and muzzle, with the mouth."""
    r = (0.17 if look.model == "dog" else 0.20) * look.height
    long = look.muzzle * look.height / r
    x = np.array([0.72 + long, 0.66 + long, 0.55 + long, 0.85, 0.55, 0.15, -0.35, -0.8, -1.05])
    upper = np.array([-0.12, 0.06, 0.12, 0.26, 0.62, 0.86, 0.86, 0.55, 0.05])
    lower = np.array([-0.28, -0.42, -0.48, -0.58, -0.62, -0.66, -0.66, -0.5, -0.2])
    half = np.array([0.10, 0.24, 0.31, 0.46, 0.66, 0.84, 0.84, 0.60, 0.2])
    if look.model == "cat":
        half = half * np.array([1.0, 1.1, 1.1, 1.25, 1.1, 1.0, 1.0, 1.0, 1.0])
    stations = np.linspace(x[0], x[-1], 16)
    a = [r * curve(stations, x[::-1], values[::-1]) for values in (upper, lower, half)]
    grid = _lengthwise(r * stations, *a)
    side = np.abs(np.sin(grid.angle))[None, :]
    local = grid.points.copy()
    grid.points = _placed(grid.points, frame)
    _fur(grid, look, 0.5)
    front = ramp(local[..., 0] / r, 0.45, 0.95)
    grid.paint(look.belly, front * ramp(local[..., 2] / r, 0.15, -0.15))
    mouth = front * bump(local[..., 2] / r, -0.34, 0.045) * (0.3 + 0.7 * side)
    grid.shade(1.0 - 0.6 * mouth)
    for sign in (1.0, -1.0):
        grid.shade(
            1.0
            - 0.45
            * bump(local[..., 0] / r, 0.70, 0.2)
            * bump(local[..., 1] / r, 0.42 * sign, 0.2)
            * bump(local[..., 2] / r, 0.28, 0.2)
        )
    for end in (True, False):
        cap(grid, top=end)
    return skin(grid, "head")


def tail(look: PetLook, frame: Matrix, tip: Matrix) -> list[Skin]:
    """The tail in two parts that bend into each other."""
    h = look.height
    bushy = 1.35 if look.model == "dog" else 1.0
    first, second = np.linspace(0.30, -0.04, 6) * h, np.linspace(0.30, 0.0, 6) * h
    root = bushy * curve(first / h, (-0.04, 0.1, 0.3), (0.038, 0.040, 0.036)) * h
    end = bushy * curve(second / h, (0.0, 0.15, 0.30), (0.036, 0.034, 0.012)) * h
    skins = []
    for z, radius, joint, place in ((first, root, "tail", frame), (second, end, "tip", tip)):
        grid = _upright(z, radius, radius, columns=9)
        grid.points = _placed(grid.points, place)
        _fur(grid, look, 1.0)
        if joint == "tip" and look.model == "dog":
            grid.paint(look.belly, 0.6 * np.ones(grid.points.shape[:2]))
        cap(grid, top=True)
        skins.append(skin(grid, joint))
    return skins


def leg(look: PetLook, name: str, joints: Mapping[str, Floats]) -> list[Skin]:
    """A leg along its joints at rest, from the trunk to the paw.

    Args:
        look: of the pet.
        name: of the leg.
        joints: positions of `upper`, `lower`, `hock` and `paw` [m].
    """
    h, r = look.height, look.leg_radius
    hind = name.startswith("hind")
    root, knee, hock, ankle = (joints[part] for part in ("upper", "lower", "hock", "paw"))
    top = root + np.array([-0.02 * h if hind else 0.01 * h, 0.0, 0.16 * h])
    stops = [top, root, knee, hock, ankle + np.array([0.0, 0.0, -0.02 * h])]
    along = np.array([0.0, 1.0, 2.0, 3.0, 4.0])
    t = np.concatenate(
        [
            np.linspace(0.0, 1.0, 4)[:-1],
            np.linspace(1.0, 2.0, 5)[:-1],
            np.linspace(2.0, 3.0, 5)[:-1],
            np.linspace(3, 4, 4),
        ]
    )
    path = np.stack([np.interp(t, along, [stop[k] for stop in stops]) for k in range(3)], axis=1)
    path[:, 1] -= np.sign(root[1]) * 0.035 * h * ramp(t, 1.5, 0.0)
    deep = curve(t, along, (1.6, 2.5, 1.35, 0.75, 0.68) if hind else (1.2, 1.7, 1.0, 0.72, 0.70)) * r
    wide = curve(t, along, (0.4, 0.95, 0.9, 0.55, 0.60) if hind else (0.4, 0.85, 0.75, 0.62, 0.64)) * r
    grid = _along(path, deep, wide)
    _fur(grid, look, 0.6)
    grid.paint(look.belly, np.broadcast_to(0.8 * ramp(t, 2.6, 3.6)[:, None], grid.points.shape[:2]))
    inner = np.clip(-np.sign(root[1]) * np.sin(grid.angle), 0.0, 1.0)[None, :]
    grid.shade(1.0 - 0.35 * inner * ramp(t, 2.5, 1.0)[:, None])
    cap(grid, top=True)
    upper, lower, foot = ramp(t, 2.35, 1.75), ramp(t, 3.25, 2.8), ramp(t, 3.8, 4.0)
    body = 0.85 * ramp(t, 1.0, 0.1)
    rings = np.concatenate([[0.0], t])
    knee_ring, hock_ring = int(np.argmax(rings >= 2.0)), int(np.argmax(rings >= 3.0))
    upper, lower, foot, body = (np.concatenate([[w[0]], w]) for w in (upper, lower, foot, body))
    middle = slice(knee_ring, hock_ring + 1)
    return [
        skin(grid, f"{name}_upper", {"trunk": body, f"{name}_lower": 1.0 - upper}, slice(0, knee_ring + 1)),
        skin(grid, f"{name}_lower", {f"{name}_upper": upper, f"{name}_hock": 1.0 - lower}, middle),
        skin(grid, f"{name}_hock", {f"{name}_lower": lower, f"{name}_paw": foot}, slice(hock_ring, None)),
        _paw(look, name, ankle),
    ]  # fmt: skip


def _paw(look: PetLook, name: str, ankle: Floats) -> Skin:
    """A paw with toes."""
    h, r = look.height, look.leg_radius
    z = np.array([0.02, 0.0, -0.015, -0.032, -0.05]) * h
    grid = _upright(
        z, np.array([0.70, 0.85, 1.20, 1.45, 1.45]) * r, np.array([0.66, 0.8, 0.98, 1.05, 1.02]) * r, columns=12
    )
    grid.points[..., 0] += np.array([0.0, 0.15, 0.4, 0.6, 0.6])[:, None] * r
    grid.points += ankle
    toes = np.clip(np.cos(grid.angle), 0.0, 1.0)[None, :] * (np.cos(5 * grid.angle) < -0.4)[None, :]
    grid.colours = np.tile(np.array(look.belly), (*grid.points.shape[:2], 1))
    grid.shade(1.0 - 0.4 * toes * np.array([0, 0, 0.4, 1, 1])[:, None])
    cap(grid)
    cap(grid, top=True)
    return skin(grid, f"{name}_paw")


def _fur(grid: Grid, look: PetLook, depth: float) -> None:
    """Colour the fur: darker back, paler belly, strands, and stripes, a saddle or patches; roughen it a little."""
    h = look.height
    seed = zlib.crc32(look.name.encode())
    x, z = grid.points[..., 0] / h, grid.points[..., 2] / h
    turn = np.broadcast_to(grid.angle / (2 * np.pi), x.shape)
    grid.colours = np.tile(np.array(look.fur), (*x.shape, 1))
    grid.paint(look.belly, 0.8 * ramp(z, 0.66, 0.52) * ramp(np.abs(grid.points[..., 1]) / h, 0.13, 0.05))
    if look.name == "tabby":
        stripes = ramp(np.sin(26.0 * x + 4.0 * z + 2.0 * Noise(seed, 5, 5).at(x, z)), 0.1, 0.6)
        grid.shade(1.0 - 0.5 * stripes * ramp(z, 0.45, 0.65))
    if look.name == "shepherd":
        grid.shade(1.0 - 0.75 * ramp(z, 0.74, 0.82) * ramp(x, 0.62, 0.45))
    if look.name in ("terrier", "spaniel"):
        patches = ramp(Noise(seed, 3, 3).at(0.7 * x + 0.2, 0.8 * z + 0.5 * turn), 0.15, 0.3)
        grid.paint(look.belly if look.name == "terrier" else (0.9, 0.87, 0.82), 0.85 * patches)
    strands = Noise(seed + 1, 40, 12).at(2.0 * turn + 0.6 * x, 2.2 * z + 0.7 * x)
    grid.push(0.010 * h * depth * strands)
    grid.shade(1.0 + 0.25 * strands)
    grid.shade(0.74 + 0.30 * ramp(z, 0.42, 0.88))


def _lengthwise(x: Floats, upper: Floats, lower: Floats, half: Floats) -> Grid:
    """A tube along x, from the front backwards, between an upper and a lower line; angle 0 is down."""
    angle = columns_of(18)
    middle, deep = 0.5 * (upper + lower)[:, None], 0.5 * (upper - lower)[:, None]
    points = np.empty((len(x), len(angle), 3))
    points[..., 0] = x[:, None]
    points[..., 1] = half[:, None] * np.sin(angle)
    points[..., 2] = middle - deep * np.cos(angle)
    return Grid(points, angle, np.ones_like(points))


def _upright(z: Floats, deep: Floats, wide: Floats, *, columns: int = 14) -> Grid:
    """A tube along z from the top down; angle 0 is forward."""
    angle = columns_of(columns)
    points = np.empty((len(z), len(angle), 3))
    points[..., 0] = deep[:, None] * np.cos(angle)
    points[..., 1] = wide[:, None] * np.sin(angle)
    points[..., 2] = z[:, None]
    return Grid(points, angle, np.ones_like(points))


def _along(path: Floats, deep: Floats, wide: Floats) -> Grid:
    grid = _upright(path[:, 2], deep, wide, columns=12)
    grid.points[..., :2] += path[:, None, :2]
    return grid


def _placed(points: Floats, frame: Matrix) -> Floats:
    placed: Floats = points @ frame[:3, :3].T + frame[:3, 3]
    return placed
