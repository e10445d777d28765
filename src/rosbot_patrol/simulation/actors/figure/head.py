"""Head of a detailed person: neck, face, ears, hair and hats. Lengths are in heads (chin to top) above the chin."""

from __future__ import annotations

import numpy as np

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
from rosbot_patrol.simulation.actors.looks import Colour, Look

HEAD = 0.132
"""Height of the head, in heights of the person."""

_CHIN = 1.0 - HEAD - 0.004
_BACK = -0.004  # x of the head's middle, in heights
_SKULL: tuple[Knot, ...] = (
    # z, half width, front, back, middle
    (1.000, 0.030, 0.030, 0.040, -0.03),
    (0.985, 0.120, 0.120, 0.150, -0.03),
    (0.955, 0.200, 0.200, 0.250, -0.02),
    (0.900, 0.270, 0.285, 0.350, -0.01),
    (0.800, 0.325, 0.370, 0.445, 0.0),
    (0.700, 0.342, 0.402, 0.480, 0.0),
    (0.600, 0.340, 0.415, 0.480, 0.0),
    (0.520, 0.336, 0.395, 0.455, 0.0),
    (0.440, 0.328, 0.400, 0.415, 0.0),
    (0.350, 0.315, 0.412, 0.370, 0.0),
    (0.250, 0.290, 0.418, 0.330, 0.0),
    (0.150, 0.262, 0.410, 0.310, 0.0),
    (0.070, 0.235, 0.400, 0.300, 0.0),
    (0.020, 0.220, 0.360, 0.295, 0.0),
    (-0.010, 0.215, 0.270, 0.295, 0.0),
    (-0.050, 0.218, 0.180, 0.300, 0.0),
    (-0.200, 0.228, 0.160, 0.315, -0.02),
    (-0.300, 0.250, 0.170, 0.330, -0.03),
    (-0.420, 0.330, 0.200, 0.340, -0.04),
)


def head(look: Look, outfit: Outfit) -> list[Skin]:
    """Neck and head with a face; its colours are absolute, for a white material."""
    heights = np.concatenate(
        [
            np.linspace(1.0, 0.72, 6), np.linspace(0.66, 0.40, 11), np.linspace(0.38, 0.10, 11),
            np.linspace(0.06, -0.05, 3), np.linspace(-0.12, -0.42, 3),
        ]
    )  # fmt: skip
    grid = _grid(look, heights, columns_of(28, front=0.45), _SKULL, square=0.93)
    t = heights[:, None]
    y = grid.points[..., 1] / (HEAD * look.height)
    front = (np.cos(grid.angle) > 0.0).astype(float)[None, :]
    _shape_face(grid, t, y, front, look)
    tone = np.array(look.mask or look.skin)
    grid.colours = np.tile(tone, (*grid.points.shape[:2], 1))
    if look.mask is None and look.hair_style != "bald":
        edge = _hairline(grid.angle, 0.84, 0.74, 0.46, 0.10)[None, :]
        grid.paint(np.array(look.hair) * 0.9, ramp(t - edge, -0.02, 0.03))
    if look.mask is None:
        _paint_face(grid, t, y, look, outfit)
    else:
        for side in (-0.15, 0.15):
            grid.paint(look.skin, front * bump(t, 0.50, 0.05) * bump(y, side, 0.10))
    below = np.ones_like(y) * ramp(t, 0.0, -0.06) * (0.45 + 0.55 * front)
    grid.shade(1.0 - 0.34 * below * ramp(t, -0.42, -0.15))
    cap(grid, top=True)
    neck = 0.8 * ramp(heights, -0.12, -0.36)
    skins = [skin(grid, "head", {"torso": np.concatenate([[0.0], neck])})]
    if look.mask is None and look.hair_style not in ("hood",):
        skins += [_ear(look, sign) for sign in (1.0, -1.0)]
    return skins


def _grid(look: Look, heights: Floats, angle: Floats, knots: tuple[Knot, ...], *, square: float = 1.0) -> Grid:
    size = HEAD * look.height
    grid = tube(knots, heights, angle, square=square, scale=size)
    grid.points[..., 0] += _BACK * look.height
    grid.points[..., 2] += _CHIN * look.height
    return grid


def _shape_face(grid: Grid, t: Floats, y: Floats, front: Floats, look: Look) -> None:
    """Nose, sockets, brows, cheeks, lips and chin, as steps along x."""
    size = HEAD * look.height
    bridge = np.interp(t, [0.335, 0.355, 0.40, 0.47, 0.55, 0.60], [0.0, 0.105, 0.115, 0.065, 0.025, 0.0])
    width = np.interp(t, [0.33, 0.39, 0.48, 0.56], [0.070, 0.060, 0.040, 0.045])
    step = bridge * np.exp(-((y / width) ** 2))
    step = step + 0.030 * bump(t, 0.365, 0.025) * (bump(y, 0.055, 0.03) + bump(y, -0.055, 0.03))
    for side in (-0.15, 0.15):
        step = step - 0.045 * bump(t, 0.505, 0.055) * bump(y, side, 0.085)
        step = step + 0.020 * bump(t, 0.50, 0.025) * bump(y, side, 0.05)
        step = step + 0.018 * bump(t, 0.40, 0.07) * bump(y, 1.35 * side, 0.07)
    step = step + 0.020 * bump(t, 0.585, 0.035) * bump(np.abs(y), 0.13, 0.11)
    mouth = np.exp(-((y / 0.10) ** 2))
    step = step + mouth * (
        0.022 * bump(t, 0.255, 0.018) + 0.024 * bump(t, 0.205, 0.020) - 0.018 * bump(t, 0.231, 0.008)
    )
    step = step - 0.020 * bump(t, 0.155, 0.025) * mouth + 0.022 * bump(t, 0.075, 0.05) * np.exp(-((y / 0.12) ** 2))
    grid.points[..., 0] += size * step * front


def _paint_face(grid: Grid, t: Floats, y: Floats, look: Look, outfit: Outfit) -> None:
    """Eyes, brows, lips, cheeks and beard."""
    front = (np.cos(grid.angle) > 0.0).astype(float)[None, :]
    tone = np.array(look.skin)
    red = tone * np.array((1.02, 0.80, 0.78))
    dark = np.array(look.hair) * 0.7 + tone * 0.12
    grid.paint(red, 0.35 * front * bump(t, 0.37, 0.09) * (bump(y, 0.20, 0.09) + bump(y, -0.20, 0.09)))
    grid.paint(red, 0.35 * front * bump(t, 0.38, 0.04) * bump(y, 0.0, 0.06))
    grid.paint(tone * np.array((0.85, 0.55, 0.53)), 0.8 * front * bump(t, 0.23, 0.034) * ramp(np.abs(y), 0.135, 0.10))
    grid.paint(tone * 0.35, 0.75 * front * bump(t, 0.231, 0.009) * ramp(np.abs(y), 0.13, 0.10))
    grid.paint(tone * 0.45, 0.7 * front * bump(t, 0.345, 0.012) * bump(np.abs(y), 0.035, 0.022))
    if outfit.stubble > 0.0:
        beard = np.maximum(ramp(t, 0.20, 0.13), bump(t, 0.295, 0.025)) * ramp(np.cos(grid.angle), -0.1, 0.25)[None, :]
        beard = np.maximum(
            beard, ramp(t, 0.42, 0.30) * ramp(np.abs(y), 0.17, 0.24) * ramp(np.cos(grid.angle), -0.1, 0.1)
        )
        grid.paint(dark, outfit.stubble * beard * ramp(t, -0.04, 0.02))
    _paint_eyes(grid, t, y, front, dark)


def _paint_eyes(grid: Grid, t: Floats, y: Floats, front: Floats, dark: Floats) -> None:
    for side in (-0.15, 0.15):
        inside = front * (((y - side) / 0.082) ** 2 + ((t - 0.500) / 0.036) ** 2)
        socket = front * bump(t, 0.515, 0.05) * bump(y, side, 0.095)
        grid.shade(1.0 - 0.30 * socket)
        grid.paint((0.86, 0.84, 0.82), front * ramp(inside, 1.1, 0.75) * (inside > 0))
        grid.paint((0.10, 0.07, 0.05), front * ramp(((y - side) / 0.034) ** 2 + ((t - 0.503) / 0.036) ** 2, 1.3, 0.7))
        grid.paint(dark * 0.6, 0.8 * front * bump(t, 0.533 - 0.6 * (y - side) ** 2 / 0.1, 0.010) * bump(y, side, 0.085))
        arch = 0.600 - 1.2 * (np.abs(y) - 0.13) ** 2 / 0.1
        grid.paint(dark, 0.85 * front * bump(t, arch, 0.020) * ramp(np.abs(y - side), 0.115, 0.085))


def _ear(look: Look, sign: float) -> Skin:
    t = np.linspace(0.60, 0.36, 6)
    width = np.sqrt(np.clip(1.0 - ((t - 0.49) / 0.115) ** 2, 0.02, 1.0))
    knots = tuple((float(z), 0.030, 0.075 * float(w), 0.085 * float(w), -0.045) for z, w in zip(t, width, strict=True))
    grid = _grid(look, t, columns_of(8), knots)
    grid.points[..., 1] += sign * 0.345 * HEAD * look.height
    grid.colours = np.tile(np.array(look.skin) * np.array((0.98, 0.84, 0.82)), (*grid.points.shape[:2], 1))
    grid.shade(1.0 - 0.3 * bump(t, 0.49, 0.05)[:, None] * bump(np.abs(grid.angle), 0.0, 0.9)[None, :])
    cap(grid)
    cap(grid, top=True)
    return skin(grid, "head")


def hair(look: Look, outfit: Outfit) -> tuple[list[Skin], Colour] | None:
    """Hair, hood or hat, and its colour; None for a bald head."""
    style = look.hair_style
    if style == "bald":
        return None
    if style in ("beanie", "cap"):
        return [_hat(look, style), *([_brim(look)] if style == "cap" else [])], look.hat
    if style == "hood":
        return [_hood(look, outfit)], look.top
    return [_long(look, outfit) if style == "long" else _short(look, outfit)], look.hair


def _shell(look: Look, heights: Floats, thickness: Floats, columns: int = 28) -> Grid:
    """A shell about the skull; thickness in heads, negative where it is hidden, shape (rings, columns + 1)."""
    grid = _grid(look, heights, columns_of(columns), _SKULL, square=0.93)
    grid.push(HEAD * look.height * thickness)
    return grid


def _strands(grid: Grid, seed: int, depth: float, size: float) -> None:
    turn = grid.angle[None, :] / (2 * np.pi)
    strand = Noise(seed, 24, 4).at(turn + 0.0 * grid.points[..., 2], 1.5 * grid.points[..., 2])
    grid.push(depth * size * strand)
    grid.shade(1.0 + 0.30 * strand)


def _hairline(angle: Floats, front: float, temple: float, side: float, back: float) -> Floats:
    """Lower edge of the hair at each angle: forehead, temples, above the ears, nape."""
    a = np.abs(angle)
    return np.interp(
        a, [0.0, 0.55, 0.95, 1.25, 1.60, 2.05, 2.6, np.pi], [front, front, temple, side, side + 0.12, 0.20, back, back]
    )


def _short(look: Look, outfit: Outfit) -> Skin:
    heights = np.concatenate([np.linspace(1.0, 0.9, 4), np.linspace(0.85, 0.08, 16)])
    angle = columns_of(28)
    edge = _hairline(angle, 0.84, 0.74, 0.46, 0.10)[None, :]
    full = 0.045 + 0.040 * ((outfit.seed // 7) % 3) / 2
    thick = full * (0.45 + 0.55 * ramp(heights, 0.35, 0.85))[:, None]
    t = heights[:, None]
    grid = _shell(look, heights, np.where(t > edge, thick, 0.0) * ramp(t - edge, 0.0, 0.06) - 0.10 * (t <= edge + 0.01))
    _strands(grid, outfit.seed + 20, 0.016, HEAD * look.height)
    cap(grid, top=True)
    return skin(grid, "head")


def _long(look: Look, outfit: Outfit) -> Skin:
    heights = np.concatenate([np.linspace(1.0, 0.9, 4), np.linspace(0.85, -0.62, 22)])
    angle = columns_of(28)
    edge = _hairline(angle, 0.86, 0.70, -0.55, -0.60)[None, :]
    edge = np.where((np.abs(angle) > 1.25)[None, :], -0.56 - 0.05 * np.cos(5 * angle)[None, :], edge)
    t = heights[:, None]
    thick = 0.075 + 0.02 * ramp(t, 0.9, 0.5)
    grid = _shell(look, heights, np.where(t > edge, thick, 0.0) * ramp(t - edge, 0.0, 0.07) - 0.12 * (t <= edge + 0.01))
    size = HEAD * look.height
    side = np.abs(np.sin(grid.angle))[None, :]
    hanging = ramp(t, 0.35, 0.0)  # below the ears the hair hangs straight, outside the neck
    grid.points[..., 1] += size * 0.10 * hanging * np.sin(grid.angle)[None, :] * (t > edge)
    grid.points[..., 0] -= size * (0.06 + 0.08 * side) * hanging * (t > edge)
    _strands(grid, outfit.seed + 21, 0.016, size)
    grid.shade(1.0 - 0.25 * hanging * np.ones_like(side))
    cap(grid, top=True)
    return skin(grid, "head", {"torso": np.concatenate([[0.0], 0.35 * ramp(heights, -0.1, -0.6)])})


def _hat(look: Look, style: str) -> Skin:
    low = 0.60 if style == "beanie" else 0.66
    heights = np.concatenate([np.linspace(1.0, 0.9, 4), np.linspace(0.86, low, 6)])
    t = heights[:, None]
    thick = (0.075 if style == "beanie" else 0.05) + 0.03 * ramp(t, 0.9, 1.0)
    grid = _shell(look, heights, np.broadcast_to(thick, (len(heights), 29)))
    if style == "beanie":
        rib = np.cos(30 * grid.angle)[None, :]
        turned_up = (t < 0.74).astype(float)
        grid.push(HEAD * look.height * 0.020 * turned_up * np.ones_like(rib))
        grid.shade(1.0 + 0.10 * rib - 0.20 * bump(t, 0.745, 0.012))
    else:
        grid.shade(1.0 - 0.25 * np.maximum(bump(np.sin(3 * grid.angle), 0.0, 0.10), 0.0)[None, :] * np.ones_like(t))
    hem(grid, depth=0.01, dark=0.4)
    cap(grid, top=True)
    return skin(grid, "head")


def _brim(look: Look) -> Skin:
    knots = ((0.715, 0.30, 0.74, 0.0, 0.05), (0.70, 0.33, 0.80, 0.0, 0.05), (0.68, 0.33, 0.80, 0.0, 0.05))
    grid = _grid(look, np.array([0.715, 0.70, 0.68]), columns_of(24), knots)
    grid.points[..., 2] -= 0.10 * np.clip(grid.points[..., 0] - 0.06, 0.0, None) + 1.2 * grid.points[..., 1] ** 2
    cap(grid)
    cap(grid, top=True)
    return skin(grid, "head")


def _hood(look: Look, outfit: Outfit) -> Skin:
    heights = np.concatenate([np.linspace(1.0, 0.9, 4), np.linspace(0.86, -0.42, 18)])
    angle = columns_of(28)
    a = np.abs(angle)[None, :]
    t = heights[:, None]
    opening = np.interp(t, [-0.3, -0.1, 0.1, 0.5, 0.8, 0.88, 0.92], [0.15, 0.5, 0.80, 0.95, 0.75, 0.35, 0.0])
    inside = ramp(a, opening, opening + 0.22)
    thick = (0.10 + 0.10 * ramp(t, 0.3, -0.3) + 0.05 * ramp(t, 0.8, 1.0)) * (0.6 + 0.4 * inside) + 0.06 * bump(
        a, opening + 0.25, 0.15
    )
    grid = _shell(look, heights, np.where(a > opening, thick, -0.10))
    grid.fold(Noise(outfit.seed + 30, 6, 6), 0.005 * np.ones_like(t), around=1.0, along=2.0)
    grid.shade(1.0 - 0.45 * (1.0 - inside))
    cap(grid, top=True)
    return skin(grid, "head", {"torso": np.concatenate([[0.0], 0.9 * ramp(heights, 0.0, -0.35)])})
