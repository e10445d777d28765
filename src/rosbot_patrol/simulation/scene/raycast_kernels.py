"""Planar ray casting against segments and circles: exact, and only for the beams that an obstacle can cover."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.kernels import kernel

Array = NDArray[np.float64]


@kernel("void(float64, float64, float64, float64, float64[:, ::1], float64[:, ::1], float64[:, ::1], float64[::1])")
def cast_fan(
    px: float, py: float, first: float, step: float, segments: Array, circles: Array, groups: Array, ranges: Array
) -> None:
    """Shorten each beam of a fan to the nearest obstacle.

    Args:
        px: x of the beams' origin [m].
        py: y of the beams' origin [m].
        first: bearing of beam 0 [rad].
        step: angle between beams [rad], positive; at most one turn in all.
        segments: x0, y0, x1, y1, shape (S, 4).
        circles: x, y, radius, shape (C, 3).
        groups: circles around runs of consecutive segments, starting with segment 0: x, y, radius, number of segments,
            shape (G, 4); segments after the last run are in no group. The nearest groups are cast first, and those
            behind a hit are skipped.
        ranges: longest length on entry, length to the nearest obstacle on return [m], shape (N,).
    """
    turn = 2.0 * math.pi
    n = ranges.shape[0]
    cosines, sines = np.empty(n), np.empty(n)
    for k in range(n):
        cosines[k], sines[k] = math.cos(first + k * step), math.sin(first + k * step)
    count = groups.shape[0]
    starts = np.zeros(count + 1, np.int64)
    gaps, near = np.empty(count), np.empty(count, np.int64)
    farthest, found = ranges.max(), 0
    for g in range(count):
        starts[g + 1] = starts[g] + int(groups[g, 3])
        gaps[g] = math.hypot(groups[g, 0] - px, groups[g, 1] - py) - groups[g, 2]
        if gaps[g] < farthest:
            near[found] = g
            found += 1
    order = near[:found][np.argsort(gaps[near[:found]])]
    for i in range(found + 1):
        if i < found:
            g = order[i]
            begin, end = starts[g], starts[g + 1]
            if gaps[g] > 0.0:
                away = math.hypot(groups[g, 0] - px, groups[g, 1] - py)
                half = math.asin(min(groups[g, 2] / away, 1.0)) + 1e-9
                offset = (math.atan2(groups[g, 1] - py, groups[g, 0] - px) - half - first) % turn
                is_hidden = True
                for lap in range(2):
                    k0 = math.ceil((offset - lap * turn) / step)
                    k1 = math.floor((offset - lap * turn + 2.0 * half) / step)
                    for k in range(max(k0, 0), min(k1, n - 1) + 1):
                        if ranges[k] > gaps[g]:
                            is_hidden = False
                            break
                if is_hidden:
                    continue
        else:
            begin, end = starts[count], segments.shape[0]
        for s in range(begin, end):
            ax, ay = segments[s, 0] - px, segments[s, 1] - py
            dx, dy = segments[s, 2] - segments[s, 0], segments[s, 3] - segments[s, 1]
            cross = ax * dy - ay * dx
            a0 = math.atan2(ay, ax)
            width = math.atan2(ay + dy, ax + dx) - a0
            if width > math.pi:
                width -= turn
            elif width <= -math.pi:
                width += turn
            long = math.hypot(dx, dy)
            low = a0 if width >= 0.0 else a0 + width
            offset = (low - first) % turn - 1e-9
            for lap in range(2):
                k0 = math.ceil((offset - lap * turn) / step)
                k1 = math.floor((offset - lap * turn + abs(width) + 2e-9) / step)
                for k in range(max(k0, 0), min(k1, n - 1) + 1):
                    below = cosines[k] * dy - sines[k] * dx
                    if abs(below) > 1e-9 * long:
                        length = cross / below
                    elif abs(cross) <= 1e-9 * long:  # seen end-on
                        length = min(math.hypot(ax, ay), math.hypot(ax + dx, ay + dy))
                    else:
                        continue
                    if 0.0 <= length < ranges[k]:
                        ranges[k] = length
    for c in range(circles.shape[0]):
        cx, cy, radius = circles[c, 0] - px, circles[c, 1] - py, circles[c, 2]
        away = math.hypot(cx, cy)
        centre = math.atan2(cy, cx)
        half = math.pi if away <= radius else math.asin(radius / away)
        offset = (centre - half - first) % turn
        for lap in range(2):
            k0 = math.ceil((offset - lap * turn) / step)
            k1 = math.floor((offset - lap * turn + 2.0 * half) / step)
            for k in range(max(k0, 0), min(k1, n - 1) + 1):
                along = cx * cosines[k] + cy * sines[k]
                inside = radius * radius - (away * away - along * along)
                if inside < 0.0:
                    continue
                root = math.sqrt(inside)
                length = along - root if along > root else along + root
                if 0.0 <= length < ranges[k]:
                    ranges[k] = length


@kernel("boolean(float64, float64, float64, float64, float64[:, ::1], float64[:, ::1], float64[:, ::1])")
def is_blocked(x0: float, y0: float, x1: float, y1: float, segments: Array, circles: Array, groups: Array) -> bool:
    """Whether a segment or a circle lies between two points; groups as in `cast_fan`."""
    dx, dy = x1 - x0, y1 - y0
    reach = math.hypot(dx, dy)
    end = 0
    for g in range(groups.shape[0] + 1):
        begin = end
        if g < groups.shape[0]:
            end = begin + int(groups[g, 3])
            gx, gy, radius = groups[g, 0] - x0, groups[g, 1] - y0, groups[g, 2]
            if gx * gx + gy * gy > (reach + radius) ** 2 or abs(gx * dy - gy * dx) > radius * reach * (1.0 + 1e-9):
                continue
        else:
            end = segments.shape[0]
        for s in range(begin, end):
            ex, ey = segments[s, 2] - segments[s, 0], segments[s, 3] - segments[s, 1]
            below = dx * ey - dy * ex
            if below == 0.0:
                continue
            ax, ay = segments[s, 0] - x0, segments[s, 1] - y0
            t = (ax * ey - ay * ex) / below
            u = (ax * dy - ay * dx) / below
            if 0.0 < t < 1.0 and 0.0 <= u <= 1.0:
                return True
    length2 = dx * dx + dy * dy
    for c in range(circles.shape[0]):
        t = 0.0
        if length2 > 0.0:
            t = ((circles[c, 0] - x0) * dx + (circles[c, 1] - y0) * dy) / length2
            t = min(max(t, 0.0), 1.0)
        nx, ny = circles[c, 0] - (x0 + t * dx), circles[c, 1] - (y0 + t * dy)
        if nx * nx + ny * ny < circles[c, 2] * circles[c, 2]:
            return True
    return False


NO_SEGMENTS = np.zeros((0, 4))
NO_CIRCLES = np.zeros((0, 3))
NO_GROUPS = np.zeros((0, 4))
