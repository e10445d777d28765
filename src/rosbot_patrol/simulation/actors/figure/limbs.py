"""Legs and arms of a detailed person: trousers, shorts or bare legs; long or short sleeves."""

from __future__ import annotations

import numpy as np

from rosbot_patrol.simulation.actors.figure.skeleton import ELBOW, HIP, HIP_WIDTH, KNEE, SHOULDER, SHOULDER_WIDTH
from rosbot_patrol.simulation.actors.figure.surface import (
    Floats,
    Grid,
    Knot,
    Noise,
    Skin,
    bump,
    cap,
    columns_of,
    hem,
    ramp,
    skin,
    tube,
)
from rosbot_patrol.simulation.actors.figure.wardrobe import Outfit
from rosbot_patrol.simulation.actors.looks import Look

_LEG: tuple[Knot, ...] = (
    # z, half width, front, back, middle: bare
    (0.545, 0.036, 0.034, 0.040, 0.0),
    (0.515, 0.048, 0.046, 0.056, 0.0),
    (0.475, 0.050, 0.050, 0.056, 0.0),
    (0.420, 0.046, 0.050, 0.050, 0.002),
    (0.350, 0.039, 0.042, 0.040, 0.004),
    (0.305, 0.034, 0.036, 0.034, 0.004),
    (0.285, 0.033, 0.037, 0.032, 0.003),
    (0.262, 0.031, 0.034, 0.031, 0.001),
    (0.215, 0.032, 0.029, 0.039, -0.003),
    (0.175, 0.029, 0.026, 0.036, -0.004),
    (0.120, 0.022, 0.022, 0.026, -0.005),
    (0.075, 0.0185, 0.021, 0.023, -0.005),
    (0.045, 0.0185, 0.023, 0.025, -0.005),
)
_ARM: tuple[Knot, ...] = (
    (0.830, 0.006, 0.010, 0.010, -0.003),
    (0.824, 0.018, 0.021, 0.021, -0.003),
    (0.812, 0.026, 0.029, 0.029, -0.003),
    (0.785, 0.031, 0.034, 0.034, -0.003),
    (0.755, 0.030, 0.033, 0.032, -0.003),
    (0.700, 0.026, 0.030, 0.029, -0.003),
    (0.650, 0.024, 0.025, 0.026, -0.003),
    (0.630, 0.024, 0.024, 0.026, -0.003),
    (0.600, 0.025, 0.027, 0.026, -0.003),
    (0.550, 0.021, 0.023, 0.022, -0.003),
    (0.505, 0.0155, 0.018, 0.018, -0.003),
    (0.480, 0.0145, 0.018, 0.018, -0.003),
)


def leg(look: Look, outfit: Outfit, side: str, sign: float) -> list[tuple[Skin, str]]:
    """The leg's parts, with what each is made of: bottom or skin."""
    covered = {"trousers": 0.060, "shorts": 0.325}.get(look.legs, 0.0)
    parts: list[tuple[Skin, str]] = []
    if covered:
        parts += [(s, "bottom") for s in _trouser_leg(look, outfit, side, sign, covered)]
    if look.legs != "trousers":
        start = 0.40 if look.legs == "shorts" else 0.545
        parts += [(s, "skin") for s in _split_leg(_bare_leg(look, sign, start), look.height, side)]
    return parts


def _leg_grid(look: Look, sign: float, knots: tuple[Knot, ...], heights: Floats, columns: int) -> Grid:
    b = 0.55 + 0.45 * look.build
    wide = [(z, w * b, f * b, r * b, m) for z, w, f, r, m in knots]
    y = sign * HIP_WIDTH * (0.75 + 0.25 * look.build) * look.height
    return tube(wide, heights, columns_of(columns), y=y, scale=look.height)


def _trouser_leg(look: Look, outfit: Outfit, side: str, sign: float, end: float) -> list[Skin]:
    h, loose = look.height, look.loose
    heights = np.concatenate([np.linspace(0.545, 0.34, 9), np.linspace(0.33, max(end, 0.24), 8)])
    if end < 0.24:
        heights = np.concatenate([heights, np.linspace(0.228, end, 13)])
    ease = [_ease(z, loose, end) for z, *_ in _LEG]
    knots = tuple((z, w + e, f + e, r + e, m) for (z, w, f, r, m), e in zip(_LEG, ease, strict=True))
    grid = _leg_grid(look, sign, knots, heights, 16)
    z = heights[:, None]
    inner = np.clip(-sign * np.sin(grid.angle), 0.0, 1.0)[None, :]
    k = outfit.seed + (0 if sign > 0 else 50)
    long = end < 0.24
    grid.fold(Noise(k + 5, 5, 5), 0.0036 * (0.4 + loose) * (0.3 + bump(z, 0.45, 0.06)), around=1.0, along=1.3)
    grid.fold(Noise(k + 6, 3, 13), 0.0048 * (0.6 + 0.6 * loose) * bump(z, KNEE - 0.01, 0.05), around=1.0, along=2.3)
    if long:
        stack = 0.0060 * (0.5 + 0.7 * loose) * bump(z, 0.095, 0.05)
        grid.fold(Noise(k + 7, 3, 17), stack, around=1.0, along=3.0)
        grid.fold(Noise(k + 8, 4, 7), 0.0018 * np.ones_like(z), around=1.0, along=1.3)
    grid.shade(1.0 - (0.45 * ramp(z, 0.40, 0.50) + 0.12) * inner)
    outer = bump(np.abs(grid.points[..., 0]) / h, 0.0, 0.006) * (np.sin(grid.angle) * sign > 0.3)
    grid.shade(1.0 - 0.28 * outer)
    if outfit.jeans:
        worn = np.clip(np.cos(grid.angle), 0.0, 1.0)[None, :] ** 2 * (bump(z, 0.41, 0.06) + 0.8 * bump(z, KNEE, 0.03))
        grid.shade(1.0 + 0.30 * worn)
    grid.shade(1.0 - 0.22 * bump(z, end, 0.010) * np.ones((1, len(grid.angle))))
    if long:  # the hem lies on the shoe in front and hangs lower behind
        grid.points[..., 2] -= 0.018 * ramp(z, 0.12, end) * (0.4 - 0.6 * np.cos(grid.angle)[None, :])
    hem(grid, depth=0.02, dark=0.3)
    cap(grid, top=True)
    return _split_leg(grid, h, side)


def _ease(z: float, loose: float, end: float) -> float:
    """Distance of the trousers from the leg, in heights."""
    width = np.interp(z, [0.06, 0.12, 0.20, 0.30, 0.42, 0.50], [0.016, 0.013, 0.004, 0.0045, 0.003, 0.002])
    more = np.interp(z, [0.06, 0.20, 0.30, 0.45], [0.014, 0.012, 0.010, 0.005])
    return float(width + loose * more + (0.012 * loose if end > 0.24 and z < 0.40 else 0.0))


def _bare_leg(look: Look, sign: float, start: float) -> Grid:
    heights = np.concatenate([np.linspace(start, 0.33, 6), np.linspace(0.32, 0.24, 7), np.linspace(0.225, 0.045, 8)])
    grid = _leg_grid(look, sign, _LEG, heights, 14)
    z = heights[:, None]
    front = np.clip(np.cos(grid.angle), 0.0, 1.0)[None, :]
    grid.push(0.004 * front * bump(z, KNEE + 0.005, 0.014))
    grid.shade(1.0 - 0.14 * front * bump(z, KNEE - 0.022, 0.012) - 0.12 * (1 - front) * bump(z, KNEE, 0.02))
    inner = np.clip(-sign * np.sin(grid.angle), 0.0, 1.0)[None, :]
    grid.shade(1.0 - (0.10 + 0.35 * ramp(z, 0.38, 0.46)) * inner)
    grid.shade(1.0 + 0.06 * front * bump(z, 0.17, 0.07))
    cap(grid)
    cap(grid, top=True)
    return grid


def _split_leg(grid: Grid, h: float, side: str) -> list[Skin]:
    """Skins of thigh and shin, smooth at hip and knee."""
    z = grid.points[..., 2].mean(axis=1) / h
    shin = 1.0 - ramp(z, KNEE - 0.045, KNEE + 0.045)
    pelvis = 0.75 * ramp(z, HIP - 0.035, HIP + 0.03)
    ring = int(np.argmax(z < KNEE))
    if ring == 0:
        return [skin(grid, f"thigh_{side}", {"pelvis": pelvis, f"shin_{side}": shin})]
    return [
        skin(grid, f"thigh_{side}", {"pelvis": pelvis, f"shin_{side}": shin}, slice(0, ring + 1)),
        skin(grid, f"shin_{side}", {f"thigh_{side}": 1.0 - shin}, slice(ring, None)),
    ]


def arm(look: Look, outfit: Outfit, side: str, sign: float) -> list[tuple[Skin, str]]:
    """The arm's parts, with what each is made of: top or skin."""
    end = 0.488 if look.sleeves == "long" else 0.695 - 0.03 * look.loose
    parts = [(s, "top") for s in _sleeve(look, outfit, side, sign, end)]
    if look.sleeves != "long":
        parts += [(s, "skin") for s in _split_arm(_bare_arm(look, sign), look.height, side)]
    return parts


def _arm_grid(look: Look, sign: float, ease: float, heights: Floats, columns: int) -> Grid:
    b = 0.55 + 0.45 * look.build
    eases = [ease / look.height * float(np.interp(z, [0.78, 0.83], [1.0, 0.15])) for z, *_ in _ARM]
    wide = [(z, w * b + e, f * b + e, r * b + e, m) for (z, w, f, r, m), e in zip(_ARM, eases, strict=True)]
    y = sign * SHOULDER_WIDTH * (0.75 + 0.25 * look.build) * look.height
    return tube(wide, heights, columns_of(columns), y=y, scale=look.height)


def _sleeve(look: Look, outfit: Outfit, side: str, sign: float, end: float) -> list[Skin]:
    jacket = look.coat or outfit.front in ("zip", "open")
    ease = 0.004 + 0.012 * look.loose + (0.007 if jacket else 0.0)
    heights = np.concatenate(
        [
            np.linspace(0.830, 0.79, 5),
            np.linspace(0.775, 0.69, 5),
            np.linspace(0.675, 0.58, 7),
            np.linspace(0.565, 0.488, 5),
        ]
    )
    if end > 0.58:
        heights = np.concatenate([np.linspace(0.830, 0.79, 5), np.linspace(0.78, end, 5)])
    grid = _arm_grid(look, sign, ease, heights, 12)
    z = heights[:, None]
    k = outfit.seed + (11 if sign > 0 else 61)
    grid.fold(Noise(k, 3, 11), 0.0042 * (0.5 + look.loose) * (0.35 + bump(z, ELBOW, 0.05)), around=1.0, along=2.0)
    grid.fold(Noise(k + 1, 4, 5), 0.0035 * (1.0 - ramp(z, 0.80, 0.82)), around=1.0, along=1.1)
    inner = np.clip(-sign * np.sin(grid.angle), 0.0, 1.0)[None, :]
    grid.shade(1.0 - (0.16 + 0.22 * ramp(z, 0.66, 0.78)) * inner)
    grid.shade(1.0 - 0.18 * bump(z, end + 0.012, 0.004) * np.ones((1, len(grid.angle))))
    grid.shade(1.0 - 0.16 * bump(z, 0.812, 0.006) * np.ones((1, len(grid.angle))))
    hem(grid, depth=0.02, dark=0.35)
    cap(grid, top=True)
    return _split_arm(grid, look.height, side)


def _bare_arm(look: Look, sign: float) -> Grid:
    heights = np.concatenate([np.linspace(0.80, 0.67, 4), np.linspace(0.655, 0.60, 4), np.linspace(0.585, 0.480, 4)])
    grid = _arm_grid(look, sign, 0.0, heights, 10)
    inner = np.clip(-sign * np.sin(grid.angle), 0.0, 1.0)[None, :]
    grid.shade(1.0 - 0.15 * inner * np.ones_like(heights)[:, None])
    cap(grid)
    cap(grid, top=True)
    return grid


def _split_arm(grid: Grid, h: float, side: str) -> list[Skin]:
    """Skins of upper arm and forearm, smooth at shoulder and elbow."""
    z = grid.points[..., 2].mean(axis=1) / h
    lower = 1.0 - ramp(z, ELBOW - 0.03, ELBOW + 0.03)
    torso = 0.7 * ramp(z, SHOULDER - 0.03, SHOULDER + 0.02)
    ring = int(np.argmax(z < ELBOW))
    if ring == 0:
        return [skin(grid, f"arm_{side}", {"torso": torso})]
    return [
        skin(grid, f"arm_{side}", {"torso": torso, f"forearm_{side}": lower}, slice(0, ring + 1)),
        skin(grid, f"forearm_{side}", {f"arm_{side}": 1.0 - lower}, slice(ring, None)),
    ]
