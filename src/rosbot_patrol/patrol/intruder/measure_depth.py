"""What the depths over a detector's box tell of its object: how far it is, what stands before it, whether it is flat.

All take the depths as samples on a grid over the box, in metres along the optical axis, NaN where unknown, shape
(rows, columns). Figures were chosen on 1,100 boxes of people and 450 of posters in the three houses (the scenes of
`benchmarks/person_place.py`, photographed from four headings each).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

GRID = 48  # samples along each side of a box
ASIDE, UP = GRID // 2, GRID // 4  # samples beyond it, where it is asked what is around it: to either side, above
DEEP = 0.35  # what is so much farther than the nearest part is not of the person [m]
_FEW = 40  # depths, at least, to say anything
_KNOWN = 0.2  # of the middle of a box has depth; with less, that is of something else
_KNOWN_FLAT = 0.75  # of a box has depth, to tell a picture
_FLAT_SHARE = 0.88  # of the samples lie in a picture's plane
_BELIEVED = 0.05  # of a box's samples speak for the nearer thing
_UPRIGHT_ROWS = 0.5  # of the rows show one who stands
_CHEST = 0.45  # of a box, from above, show head and chest
_CHEST_SHARE = 0.1  # of that has to show, to tell a picture, and of what is around
_ASIDE, _ABOVE = 0.25, 0.2  # so much of a box is free beside or above its object at most: 99 % of those measured
_ROWS = 0.4  # of the rows of a box show its object, at least
_HEAD = GRID // 3  # rows that show the upper part of a person: not all of it is unknown
_HEAD_SHARE, _HEAD_FARTHER = 0.04, 0.05  # with less of it there, and so much of what is farther, it is something before
_HEAD_OTHER, _HEAD_TIMES = 0.15, 3.0  # so much of it at another distance, and so many times what is nearer
_ASIDE_UP = 0.4  # and beside its upper half
_BEFORE_MOST = 0.7  # of a box may show what stands before its object
_STRIP, _FREE = 0.1, 0.25  # of a row or column, to belong to it; so much of it has to lie beyond, to be free
_FRAME = 0.1  # so far before its wall a picture or a screen may be [m]
_BEFORE_SHARE = 0.35  # of a picture on the wall may be hidden
_NOISE = 0.003  # of a depth camera, at 1 m; it grows with the square [m]


def _middle(samples: Array) -> Array:
    """The middle of a box, and above."""
    rows, columns = samples.shape
    return samples[rows // 8 : rows * 3 // 4, columns // 4 : columns * 3 // 4]


def is_beyond(samples: Array) -> bool:
    """Whether most of a box may lie beyond what the depth camera measures: what it knows is of a thing before that."""
    return bool(np.isfinite(_middle(samples)).mean() < _KNOWN)


def upper_part_is_at(samples: Array, along: float, other: float) -> bool:
    """Whether the upper part of a box shows something at the other, farther distance [m] rather than the first one."""
    upper = samples[:_HEAD]
    first, second = (upper < along + DEEP).mean(), (np.abs(upper - other) < DEEP).mean()  # NaN is neither
    return bool(second >= _HEAD_OTHER and second > _HEAD_TIMES * first)


def _nearest(samples: Array) -> float | None:
    """How far the nearest thing of some size is [m]."""
    known = samples[np.isfinite(samples)]
    if known.size < _FEW:
        return None
    near = np.quantile(known, 0.2)
    return float(np.median(known[known < near + DEEP]))


def object_distance(samples: Array) -> tuple[float | None, Mask]:
    """Distance of the object that a box is drawn around [m], None if unknown, and the samples of what stands before it.

    A detector's box ends where its object does: head, arms and feet touch its sides. The nearest thing is not it
    if it leaves a strip of the box free beside or above it: a chair before somebody, or a picture on the wall.
    """
    first, along = _nearest(_middle(samples)), _nearest(samples)
    nothing = np.zeros(samples.shape, np.bool_)
    if first is None:
        return None, nothing
    is_before = nothing
    while along is not None:
        is_of_it, is_farther = samples < along + DEEP, samples >= along + DEEP  # NaN is neither
        if _fills(is_of_it, is_farther):
            return along, is_before | (samples < along - DEEP) if is_before.any() else is_before
        if is_of_it.mean() > _BEFORE_MOST:
            break
        is_before = is_of_it
        along = _nearest(samples[~is_before])
    return first, nothing


def _fills(is_of_it: Mask, is_farther: Mask) -> bool:
    """Whether something reaches the sides and the top of its box, and well down.

    Unknown parts may be of it, but not its whole upper part where that shows what is farther: before one at the end of
    the depth camera's range and a background beyond it, a desk leaves nothing free that is known.
    """

    def takes(axis: int, rows: int) -> Mask:
        is_there = is_of_it[:rows].mean(axis=axis) > _STRIP
        return np.asarray(is_there | (is_farther[:rows].mean(axis=axis) < _FREE))

    rows, columns, upper = takes(1, GRID), takes(0, GRID), takes(0, GRID // 2)
    is_high = rows.any() and rows.argmax() <= _ABOVE * GRID and rows.mean() >= _ROWS
    is_headless = is_of_it[:_HEAD].mean() < _HEAD_SHARE and is_farther[:_HEAD].mean() >= _HEAD_FARTHER
    return bool(is_high and not is_headless and _aside(columns) <= _ASIDE and _aside(upper) <= _ASIDE_UP)


def _aside(columns: Mask) -> float:
    """What is free beside those that are taken, on the freer side."""
    taken = np.flatnonzero(columns)
    return max(taken[0], len(columns) - 1 - taken[-1]) / len(columns) if len(taken) else 1.0


def nearest_within(samples: Array, most: float) -> float | None:
    """Distance of the thing within `most` [m], None if too few samples lie there."""
    near = samples[samples <= most]  # NaN is not
    return float(np.median(near)) if near.size >= max(_BELIEVED * samples.size, _FEW) else None


def upright_distance(samples: Array, least: float, most: float) -> float | None:
    """Distance of an upright thing between two distances [m], None if there is none.

    A leg at the edge of a box, before a wall that fills it: little of the box, but most of its rows, the upper ones
    with them, where furniture that hides the feet has none.
    """
    is_between = (samples >= least) & (samples <= most)
    rows = is_between.any(axis=1)
    if is_between.mean() < _BELIEVED or rows.mean() < _UPRIGHT_ROWS or not rows[: len(rows) // 3].any():
        return None
    return float(np.median(samples[is_between]))


def is_flat(samples: Array, is_before: Mask, around: Array | None = None) -> bool | None:
    """Whether what a box shows lies in one plane, None where too little of it is known.

    In a pinhole's picture the inverse of the depth of a plane is linear in row and column. The plane is that of the
    upper middle, where a person's chest is, by least squares, again of what lies near the first. All of the box has to
    lie in it but for what stands before it at the edges, as a sofa before a picture on the wall.

    Args:
        samples: of a box.
        is_before: those that are known to show something else.
        around: the samples with those ASIDE and UP of the box, NaN beyond the picture: if given, the plane has to go
            on there, as the wall does on which a picture hangs. What shows of a body may be as flat, where something
            hides the rest.
    """
    is_known = np.isfinite(samples) & (samples > 0.0)
    high, wide = samples.shape
    middle = is_known[high // 8 : high * 3 // 4, wide // 4 : wide * 3 // 4]
    if is_known.mean() < _KNOWN_FLAT or middle.mean() < 0.7:  # dark clothes before a wall: only the wall is known
        return None
    is_known &= ~is_before
    rows, columns = np.nonzero(is_known)
    metres = samples[rows, columns]
    terms = np.column_stack((rows, columns, np.ones(len(rows)))).astype(np.float64)
    is_chest = (rows < _CHEST * high) & (columns >= wide // 8) & (columns < wide - wide // 8)
    if is_chest.sum() < _CHEST_SHARE * _CHEST * samples.size:
        return None
    kept: Mask = is_chest
    plane: Array = np.zeros(3)
    fitted: Array = metres
    bound = np.maximum(0.03, 3.0 * _NOISE * metres**2)
    for _ in range(3):
        if kept.sum() < max(is_chest.sum() // 3, 3):
            return False
        plane, *_ = np.linalg.lstsq(terms[kept], 1.0 / metres[kept], rcond=None)
        inverse = terms @ plane
        fitted = np.where(inverse > 1e-3, 1.0 / np.maximum(inverse, 1e-3), np.inf)
        kept = is_chest & (np.abs(fitted - metres) < bound)
    is_in = np.abs(fitted - metres) < bound
    hides = (metres < fitted - bound) & ~is_chest
    if hides.mean() > _BEFORE_SHARE or is_in[is_chest].mean() < _FLAT_SHARE:
        return False
    if is_in[~hides].mean() < _FLAT_SHARE:
        return False
    return True if around is None else _goes_on(around, plane)


def _goes_on(around: Array, plane: Array) -> bool | None:
    """Whether what is beside and above a box, and not before its plane, is of the plane; None: too little is known."""
    rows, columns = np.indices(around.shape) - np.array([UP, ASIDE])[:, None, None]
    is_outside = (rows < 0) | (columns < 0) | (columns >= GRID)
    fitted = 1.0 / np.maximum(rows * plane[0] + columns * plane[1] + plane[2], 1e-3)
    bound = _FRAME + np.maximum(0.03, 3.0 * _NOISE * fitted**2)
    is_seen = is_outside & (around > fitted - bound)  # NaN is not
    if is_seen.sum() < _CHEST_SHARE * is_outside.sum():
        return None
    return bool((around < fitted + bound)[is_seen].mean() >= 0.5)
