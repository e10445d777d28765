"""Trunk of a detailed person: the top with its collar and front, hips, skirt and backpack."""

from __future__ import annotations

import numpy as np

from rosbot_patrol.simulation.actors.figure.skeleton import HIP, WAIST
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


def _knots(look: Look, outfit: Outfit, ease: float) -> list[Knot]:
    """Sections of the trunk in heights; `ease` is the distance of the cloth from the body."""
    b, c = 0.55 + 0.45 * look.build, outfit.curvy
    belly = max(look.build - 1.0, 0.0)
    e = ease / look.height
    rows = [
        # z, half width, front, back, middle
        (0.868, 0.034, 0.034, 0.034, -0.010),
        (0.852, 0.040, 0.036, 0.038, -0.010),
        (0.842, 0.056, 0.040, 0.045, -0.010),
        (0.832, 0.078, 0.046, 0.052, -0.008),
        (0.818, 0.096 - 0.006 * c, 0.052, 0.058, -0.006),
        (0.790, 0.104 - 0.010 * c, 0.060, 0.064, -0.004),
        (0.750, 0.099 - 0.010 * c, 0.066 + 0.010 * c, 0.064, -0.003),
        (0.715, 0.095 - 0.012 * c, 0.066 + 0.008 * c, 0.060, -0.002),
        (0.670, 0.088 - 0.014 * c, 0.060 + 0.03 * belly, 0.054, 0.0),
        (0.625, 0.084 - 0.012 * c, 0.058 + 0.04 * belly, 0.052, 0.002),
        (0.585, 0.088 - 0.002 * c, 0.058 + 0.03 * belly, 0.058, 0.0),
        (0.545, 0.094 + 0.006 * c, 0.060, 0.068, -0.003),
        (0.510, 0.097 + 0.007 * c, 0.060, 0.072, -0.004),
        (0.470, 0.098 + 0.006 * c, 0.062, 0.070, -0.004),
        (0.420, 0.100 + 0.005 * c, 0.066, 0.070, -0.004),
        (0.330, 0.106, 0.074, 0.076, -0.004),
    ]
    return [(z, w * b + e, f * b + e, r * b + e, m) for z, w, f, r, m in rows]


def top(look: Look, outfit: Outfit) -> list[Skin]:
    """The top, from its hem to the neck, and its collar."""
    h = look.height
    ease = 0.008 + 0.016 * look.loose + (0.012 if look.coat or outfit.front in ("zip", "open") else 0.0)
    heights = np.concatenate([np.linspace(0.862, 0.80, 7), np.linspace(0.79, outfit.hem, 24 if look.coat else 19)])
    grid = tube(_knots(look, outfit, ease), heights, columns_of(28, front=0.25), square=0.86, scale=h)
    z = heights[:, None]
    _round_seat(grid, z)
    _fold_top(grid, z, outfit, 0.7 + 0.5 * look.loose)
    _finish_front(grid, z, look, outfit)
    grid.shade(np.broadcast_to(1.0 - 0.20 * bump(z, outfit.hem, 0.012), grid.points.shape[:2]))
    side = np.abs(np.sin(grid.angle))[None, :] ** 3
    grid.shade(1.0 - 0.30 * side * bump(z, 0.745, 0.05))  # under the arms
    hem(grid, depth=0.03)
    cap(grid, top=True)
    rings = grid.points[:, :, 2].mean(axis=1) / h
    hips = 1.0 - ramp(rings, HIP + 0.02, WAIST + 0.035)
    blends = {"pelvis": np.repeat(hips[:, None], len(grid.angle), axis=1)}
    if look.coat:
        blends = {**blends, **_thigh_weights(grid, h, 0.9)}
    skins = [skin(grid, "torso", blends)]
    return [*skins, *([_collar(look, outfit, ease)] if outfit.collar else [])]


def _round_seat(grid: Grid, z: Floats) -> None:
    seat = np.clip(-np.cos(grid.angle), 0.0, 1.0)[None, :]
    grid.push(0.010 * seat * bump(z, 0.505, 0.03) * (1.0 - 0.6 * bump(grid.points[..., 1], 0.0, 0.018)))


def _fold_top(grid: Grid, z: Floats, outfit: Outfit, amount: float) -> None:
    """Drape: long folds from the shoulders, bunched cloth above the hem."""
    drape = 0.0045 * amount * (0.25 + bump(z, 0.70, 0.10)) * (1.0 - ramp(z, 0.79, 0.83))
    grid.fold(Noise(outfit.seed, 7, 5), drape, around=1.0, along=0.9)
    bunch = 0.0050 * amount * (0.3 + bump(z, 0.60, 0.06))
    grid.fold(Noise(outfit.seed + 1, 5, 9), bunch * (1.0 - ramp(z, 0.70, 0.80)), around=1.0, along=1.7)


def _finish_front(grid: Grid, z: Floats, look: Look, outfit: Outfit) -> None:
    """Zip, buttons, or what is worn under an open jacket."""
    y = np.abs(grid.points[..., 1])
    front = np.broadcast_to(np.cos(grid.angle) > 0.3, y.shape)
    body = np.array(look.top)
    if outfit.front == "open":
        reach = 0.012 + 0.045 * ramp(z, 0.55, 0.84)
        grid.paint(np.array(outfit.inner) / np.maximum(body, 0.06), front * (y < reach))
        grid.shade(1.0 - 0.35 * front * bump(y, reach, 0.010))
    elif outfit.front == "zip":
        grid.shade(1.0 - 0.40 * front * bump(y, 0.0, 0.010))
    elif outfit.front == "buttons":
        grid.shade(1.0 - 0.18 * front * bump(y, 0.02, 0.008))
        dots = front * (y < 0.010) * (np.cos(2 * np.pi * z / 0.047) > 0.80)
        grid.shade(1.0 - 0.5 * dots)
    if look.legs != "skirt" and not look.coat:
        pocket = front * bump(y, 0.09, 0.03) * bump(z, 0.575, 0.006) * (outfit.front in ("zip", "open"))
        grid.shade(1.0 - 0.35 * pocket)


def _collar(look: Look, outfit: Outfit, ease: float) -> Skin:
    h, e = look.height, 0.5 * ease / look.height
    knots = [
        (0.884, 0.040 + e, 0.037 + e, 0.038 + e, -0.014),
        (0.870, 0.043 + e, 0.042 + e, 0.040 + e, -0.012),
        (0.850, 0.052 + e, 0.054 + e, 0.044 + e, -0.010),
        (0.836, 0.060 + e, 0.062 + e, 0.050 + e, -0.010),
    ]
    heights = np.linspace(0.884, 0.838, 7)
    grid = tube(knots, heights, columns_of(18), scale=h)
    gap = ramp(np.cos(grid.angle), 0.80, 1.0)[None, :] * np.linspace(1.0, 0.2, 7)[:, None]
    grid.points[..., 2] -= 0.030 * gap
    grid.shade(1.0 - 0.22 * bump(np.linspace(0.0, 1.0, 7), 1.0, 0.3)[:, None] * np.ones((1, len(grid.angle))))
    hem(grid, top=True, depth=0.015)
    return skin(grid, "torso", {"head": np.linspace(0.35, 0.0, len(grid.points))})


def hips(look: Look, outfit: Outfit) -> Skin:
    """The upper part of trousers or shorts, with fly."""
    h = look.height
    heights = np.linspace(outfit.hem + 0.03, 0.452, 10)
    narrow = [(z, w * (1.0 - 0.42 * float(ramp(np.array(z), 0.51, 0.43))), f, r, m) for z, w, f, r, m in
              _knots(look, outfit, 0.002)]  # fmt: skip
    grid = tube(narrow, heights, columns_of(18), square=0.9, scale=h)
    z = heights[:, None]
    _round_seat(grid, z)
    grid.fold(Noise(outfit.seed + 2, 9, 6), 0.0035 * ramp(z, 0.57, 0.49), around=1.0, along=1.6)
    crotch = np.ones_like(grid.points[..., 1]) * ramp(z, 0.52, 0.455)
    grid.shade(1.0 - 0.45 * crotch * bump(grid.points[..., 1], 0.0, 0.06))
    fly = bump(grid.points[..., 1], 0.008, 0.007) * (np.cos(grid.angle) > 0.5) * ramp(z, 0.48, 0.51)
    grid.shade(1.0 - 0.30 * fly)
    pocket = bump(np.abs(grid.points[..., 1]), 0.075, 0.045) * (np.cos(grid.angle) < -0.3)
    grid.shade(1.0 - 0.25 * pocket * np.maximum(bump(z, 0.512, 0.005), bump(z, 0.470, 0.005)))
    cap(grid)
    cap(grid, top=True)
    turn = grid.points[:, :, 1]
    low = ramp(grid.points[..., 2] / h, 0.515, 0.455)
    return skin(grid, "pelvis", {
        "thigh_left": 0.45 * low * (turn > 0.01), "thigh_right": 0.45 * low * (turn < -0.01)
    })  # fmt: skip


def skirt(look: Look, outfit: Outfit) -> Skin:
    """A skirt from the waist to the knees; its sides follow the thighs."""
    h, flare = look.height, look.loose
    b = 0.55 + 0.45 * look.build
    low = 0.33 - 0.03 * flare
    knots = [
        *(knot for knot in _knots(look, outfit, 0.002) if knot[0] > 0.50),
        (0.42, (0.112 + 0.02 * flare) * b, (0.074 + 0.015 * flare) * b, (0.078 + 0.015 * flare) * b, -0.002),
        (low, (0.112 + 0.05 * flare) * b, (0.080 + 0.04 * flare) * b, (0.082 + 0.04 * flare) * b, 0.0),
    ]
    heights = np.linspace(outfit.hem + 0.03, low, 16)
    grid = tube(knots, heights, columns_of(32), scale=h)
    z = heights[:, None]
    pleats = np.cos((6 + outfit.seed % 5) * grid.angle + 1.5 * np.sin(3 * grid.angle))[None, :]
    grid.push((0.003 + 0.014 * flare) * ramp(z, 0.55, low) * pleats)
    grid.shade(1.0 + 0.14 * ramp(z, 0.56, low) * pleats)
    grid.fold(Noise(outfit.seed + 3, 6, 4), 0.003 * np.ones_like(z), around=1.0, along=0.8)
    hem(grid, depth=0.04, dark=0.3)
    return skin(grid, "pelvis", _thigh_weights(grid, h, 0.95))


def _thigh_weights(grid: Grid, height: float, most: float) -> dict[str, Floats]:
    """Weights of both thighs below the hips: each side follows its own, the middle neither fully."""
    low = most * ramp(grid.points[..., 2] / height, 0.56, 0.46)
    side = grid.points[..., 1]
    share = 0.5 + 0.5 * np.clip(side / 0.08, -1.0, 1.0)
    return {
        "thigh_left": low * (share >= 0.5) * (0.4 + 0.6 * share),
        "thigh_right": low * (share < 0.5) * (1 - 0.6 * share),
    }


def backpack(look: Look) -> list[Skin]:
    """A backpack with two straps."""
    h = look.height
    knots = [
        (0.845, 0.04, 0.010, 0.012, -0.105),
        (0.835, 0.070, 0.024, 0.030, -0.105),
        (0.80, 0.083, 0.036, 0.050, -0.105),
        (0.70, 0.088, 0.040, 0.066, -0.105),
        (0.63, 0.086, 0.040, 0.064, -0.105),
        (0.605, 0.07, 0.030, 0.050, -0.105),
    ]
    heights = np.linspace(0.845, 0.605, 11)
    pack = tube(knots, heights, columns_of(16), square=0.6, scale=h)
    z = heights[:, None]
    for line in (0.70, 0.785):
        pack.shade(1.0 - 0.4 * bump(z, line, 0.006) * np.ones((1, len(pack.angle))))
    pack.fold(Noise(7, 5, 5), 0.004 * np.ones_like(z), around=1.0, along=1.0)
    cap(pack)
    cap(pack, top=True)
    return [skin(pack, "torso"), *(_strap(h, sign) for sign in (1.0, -1.0))]


def _strap(h: float, sign: float) -> Skin:
    """A flat band from the pack over the shoulder to below the arm."""
    t = np.linspace(0.0, np.pi * 1.15, 10)
    path = (
        np.stack([-0.082 * np.cos(t) - 0.008, sign * (0.066 + 0.012 * np.sin(t)), 0.775 + 0.070 * np.sin(t)], axis=1)
        * h
    )
    across = np.array([0.0, 0.019, -0.004])
    out = np.stack([-np.cos(t), 0.3 * sign * np.ones_like(t), np.sin(t)], axis=1) * 0.006
    points = np.stack(
        [path + across + out, path - across + out, path - across - out, path + across - out, path + across + out],
        axis=1,
    )
    if sign < 0:
        points = points[:, ::-1]
    return skin(Grid(points, np.linspace(-np.pi, np.pi, 5), 0.85 * np.ones_like(points)), "torso")
