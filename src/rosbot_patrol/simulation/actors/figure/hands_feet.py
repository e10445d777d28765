"""Hands with fingers, and shoes with soles, socks and laces."""

from __future__ import annotations

import numpy as np

from rosbot_patrol.simulation.actors.figure.skeleton import HIP_WIDTH, SHOULDER_WIDTH, WRIST
from rosbot_patrol.simulation.actors.figure.surface import Floats, Grid, Skin, bump, cap, columns_of, ramp, skin, tube
from rosbot_patrol.simulation.actors.figure.wardrobe import Outfit
from rosbot_patrol.simulation.actors.looks import Look

_FINGERS = ((0.030, 0.068), (0.010, 0.078), (-0.010, 0.073), (-0.029, 0.056))
"""x of each finger's root and its length [m], forefinger first, of a person of 1.75 m."""


_PALM = (
    (0.015, 0.017, 0.024, 0.025),
    (0.0, 0.017, 0.026, 0.026),
    (-0.03, 0.015, 0.037, 0.034),
    (-0.07, 0.012, 0.042, 0.040),
    (-0.092, 0.009, 0.038, 0.038),
)
"""Sections of the palm: height above the wrist, half width, front and back [m]."""


def hand(look: Look, side: str, sign: float) -> list[Skin]:
    """A hanging hand, slightly bent, the palm to the body."""
    s = look.height / 1.75
    root = np.array([-0.005 - 0.003, sign * SHOULDER_WIDTH * (0.75 + 0.25 * look.build), WRIST]) * look.height
    z = np.linspace(0.015, -0.092, 5)
    table = np.array(_PALM[::-1])
    knots = [(float(v), *(float(np.interp(v, table[:, 0], table[:, k])) for k in (1, 2, 3)), 0.0) for v in z]
    palm = tube(knots, z, columns_of(8), square=0.8, scale=s)
    cap(palm)
    palm.points += root
    parts = [palm]
    for x, length in _FINGERS:
        parts.append(_finger(root + s * np.array([x, 0.0, -0.086]), s * length, s * 0.0088, sign))
    parts.append(_thumb(root + s * np.array([0.026, 0.0, -0.025]), s, sign))
    return [skin(part, f"forearm_{side}") for part in parts]


def _finger(root: Floats, length: float, radius: float, sign: float) -> Grid:
    """A finger that bends inward."""
    t = np.array([0.0, 0.45, 0.8, 0.97])
    path = root + np.stack([0.10 * length * t, -sign * 0.42 * length * t**2, -length * t * (1.0 - 0.15 * t)], axis=1)
    return _along(path, radius * np.array([1.0, 0.96, 0.85, 0.45]))


def _thumb(root: Floats, s: float, sign: float) -> Grid:
    t = np.array([0.0, 0.35, 0.7, 0.97])
    path = root + s * np.stack([0.030 * np.sqrt(t), -sign * 0.012 * t, -0.070 * t], axis=1)
    return _along(path, s * np.array([0.013, 0.012, 0.0105, 0.005]))


def _along(path: Floats, radius: Floats) -> Grid:
    angle = columns_of(5)
    points = np.empty((len(path), len(angle), 3))
    points[..., 0] = path[:, 0, None] + radius[:, None] * np.cos(angle)
    points[..., 1] = path[:, 1, None] + radius[:, None] * np.sin(angle)
    points[..., 2] = path[:, 2, None]
    grid = Grid(points, angle, np.ones_like(points))
    tips = np.linspace(1.0, 0.93, len(path))[:, None] * np.ones((1, len(angle)))
    grid.shade(tips * (1.0 - 0.14 * np.abs(np.cos(angle))[None, :]))
    cap(grid)
    return grid


def shoe(look: Look, outfit: Outfit, side: str, sign: float) -> tuple[list[Skin], list[Skin]]:
    """A shoe, and the sock above it; the shoe's colours are absolute, for a white material."""
    h = look.height
    y = sign * HIP_WIDTH * (0.75 + 0.25 * look.build) * h
    s = h / 1.75
    body = _shoe_grid(s, sign, look, outfit)
    body.points += np.array([-0.005 * h, y, 0.0])
    skins = [skin(body, f"foot_{side}")]
    if look.legs == "trousers":
        return skins, []
    knots = (
        (0.13, 0.036, 0.038, 0.044, -0.008),
        (0.09, 0.034, 0.038, 0.044, -0.008),
        (0.05, 0.034, 0.045, 0.045, -0.006),
    )
    sock = tube(knots, np.linspace(0.13, 0.05, 4), columns_of(12), y=y, scale=s)
    sock.points[..., 0] -= 0.004 * h
    sock.shade(np.broadcast_to(1.0 + 0.06 * np.cos(40 * np.arange(13))[None, :], sock.points.shape[:2]))
    cap(sock, top=True)
    return skins, [skin(sock, f"foot_{side}", {f"shin_{side}": 0.6 * ramp(sock.points[:, 0, 2], 0.06 * s, 0.12 * s)})]


def _shoe_grid(s: float, sign: float, look: Look, outfit: Outfit) -> Grid:
    """Rings from the toe to the heel, each from the sole's middle around: sole, welt, upper, top."""
    x = np.array([0.197, 0.193, 0.182, 0.165, 0.14, 0.11, 0.08, 0.05, 0.02, -0.01, -0.035, -0.055, -0.066, -0.070])
    wide = np.array([0.012, 0.024, 0.036, 0.044, 0.049, 0.049, 0.046, 0.042, 0.039, 0.037, 0.036, 0.033, 0.024, 0.010])
    high = np.array([0.028, 0.040, 0.050, 0.055, 0.060, 0.068, 0.082, 0.098, 0.104, 0.100, 0.096, 0.094, 0.088, 0.070])
    narrow = np.array([0.3, 0.4, 0.5, 0.55, 0.55, 0.55, 0.6, 0.68, 0.80, 0.88, 0.85, 0.8, 0.7, 0.4])
    middle = sign * np.interp(x, [-0.07, 0.05, 0.14, 0.2], [0.0, 0.002, 0.0, -0.010])
    # around: share of the half width, and height as a share of sole or upper
    across = np.array([0.0, 0.98, 1.04, 1.03, 1.00, 1.0, 0.97, 0.80, 0.45, 0.0])
    up = np.array([0.0, 0.0, 0.004, 0.024, 0.027, 0.27, 0.52, 0.78, 0.95, 1.0])
    lift = 0.012 * np.clip((x - 0.13) / 0.07, 0.0, 1.0) ** 2
    half = np.empty((len(x), len(across), 3))
    half[..., 0] = x[:, None]
    taper = np.where(up > 0.027, 1.0 - (1.0 - narrow[:, None]) * np.clip((up - 0.2) / 0.7, 0, 1) ** 1.5, 1.0)
    half[..., 1] = wide[:, None] * across * taper
    half[..., 2] = np.where(up <= 0.027, up, 0.027 + (high[:, None] - 0.027) * up) + lift[:, None]
    other = half[:, ::-1] * np.array([1.0, -1.0, 1.0])
    points = np.concatenate([half, other[:, 1:]], axis=1) * s
    points[..., 1] += s * middle[:, None]
    grid = Grid(points, np.linspace(0, 2 * np.pi, points.shape[1]), np.ones_like(points))
    _paint_shoe(grid, s, look, outfit)
    for top in (True, False):
        cap(grid, top=top)
    return grid


def _paint_shoe(grid: Grid, s: float, look: Look, outfit: Outfit) -> None:
    x, y, z = (grid.points[..., k] / s for k in range(3))
    low = z - 0.012 * np.clip((x - 0.13) / 0.07, 0.0, 1.0) ** 2
    grid.colours = np.tile(np.array(look.shoes), (*x.shape, 1))
    top_line = (x > 0.045) & (x < 0.125)
    lace = top_line * ramp(np.abs(y), 0.022, 0.012) * (z > 0.05) * (np.cos(2 * np.pi * x / 0.03) > 0.0)
    grid.paint(outfit.laces, 0.8 * lace)
    grid.shade(1.0 - 0.22 * bump(x, 0.145, 0.012) * (z > 0.04))
    grid.paint(outfit.sole, (low < 0.0255).astype(float))
    grid.shade(1.0 - 0.5 * (low < 0.003) - 0.3 * bump(low, 0.028, 0.006))
