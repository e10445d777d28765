"""Training pictures made of others, by their masks: who was drawn in one room stands in another, in other clothes.

Copy and paste ("Simple Copy-Paste is a Strong Data Augmentation Method for Instance Segmentation", Ghiasi et al. 2021).
The camera's height never changes, so somebody who is moved sideways only stands on the floor of the other picture too.
Costs a few ms a picture, a tenth of drawing one.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from training.pictures.labels import COLUMNS, column
from training.pictures.overlay import draw_from_bank, lay_patterns

FURNITURE = 100
LARGEST = 0.35
FEWEST = 3
_BOX = [COLUMNS.index(name) for name in ("x0", "y0", "x1", "y1")]
_SHARES = [COLUMNS.index(name) for name in ("seen_of_whole", "seen_of_part", "pixels")]
_WHOLE, _MASK = COLUMNS.index("seen_of_whole"), COLUMNS.index("mask")


@dataclass
class View:
    """A picture, what is in it, and where.

    Attributes:
        picture: RGB, uint8, shape (288, 384, 3).
        rows: of labels (`labels.py`), shape (N, columns).
        mask: uint8, shape (288, 384): 1 to 99 an actor, `FURNITURE` and more what else is labelled, 0 the rest.
    """

    picture: NDArray[Any]
    rows: NDArray[Any]
    mask: NDArray[Any]

    def mirrored(self) -> View:
        """Left and right changed."""
        rows = self.rows.copy()
        rows[:, _BOX[0]], rows[:, _BOX[2]] = 1 - self.rows[:, _BOX[2]], 1 - self.rows[:, _BOX[0]]
        return View(cv2.flip(self.picture, 1), rows, cv2.flip(self.mask, 1))


def mix(view: View, donor: View, rng: np.random.Generator, *, furniture: float = 0.3) -> View:
    """Put people, hydrants and pets of one picture into another, and some of its furniture, before what is there.

    Args:
        view: what is put into; not changed.
        donor: what is taken from; not changed.
        rng: chance.
        furniture: share of the donor's pieces of furniture that come along.
    """
    if rng.random() < 0.5:
        donor = donor.mirrored()
    counts = np.bincount(donor.mask.ravel(), minlength=256)
    kinds = np.flatnonzero(counts)
    counts = counts[kinds]
    share = np.where(kinds >= FURNITURE, furniture, 0.85)
    share[(kinds == 0) | (counts > LARGEST * donor.mask.size)] = 0.0
    chosen = np.zeros(256, bool)
    chosen[kinds[rng.random(len(kinds)) < share]] = True
    wide = view.mask.shape[1]
    shift = int(rng.integers(-wide // 2, wide // 2 + 1)) if rng.random() < 0.7 else 0
    taken = np.zeros_like(view.mask)
    into, out = slice(max(shift, 0), wide + min(shift, 0)), slice(max(-shift, 0), wide + min(-shift, 0))
    taken[:, into] = np.where(chosen[donor.mask[:, out]], donor.mask[:, out], 0)
    there = taken > 0
    if not there.any():
        return view
    before = donor.picture[:, out]
    if rng.random() < 0.5:
        levels = np.clip(np.arange(256) * np.exp(rng.normal(0, 0.25)), 0, 255).astype(np.uint8)
        before = cv2.LUT(np.ascontiguousarray(before), levels)
    picture = view.picture.copy()
    _lay(picture[:, into], before, there[:, into], soft=bool(rng.random() < 0.6))
    mask = np.where(there, 0, view.mask)
    rows = _seen(view.rows, view.mask, mask)
    used = int(column(rows, "mask").max(initial=0)) + 1
    used = max(used, int(mask[mask < FURNITURE].max(initial=0)) + 1)
    added = donor.rows[chosen[column(donor.rows, "mask").astype(int)]].copy()
    added = _cut(added, donor.mask, taken)
    added[:, _MASK] += used
    moved = np.where(there & (taken < FURNITURE), np.minimum(taken + used, FURNITURE - 1), taken)
    both = np.concatenate([rows, added])
    if len(view.rows):
        both[:, 0] = view.rows[0, 0]
    return View(picture, both, np.where(there, moved, mask).astype(np.uint8))


def disguise(view: View, rng: np.random.Generator, *, share: float = 0.35) -> View:
    """Dress people anew: a share of them gets other colours, one colour, or a pattern, in part or in whole."""
    picture = None
    for row in view.rows[column(view.rows, "kind") == 0]:
        if rng.random() >= share:
            continue
        picture = view.picture.copy() if picture is None else picture
        x0, y0, x1, y1 = _pixels(row, view.mask.shape)
        where = view.mask[y0:y1, x0:x1] == int(row[_MASK])
        if rng.random() < 0.5:  # trousers only, or what is above them
            edge = int(rng.uniform(0.1, 0.9) * (y1 - y0))
            where[(slice(0, edge), slice(edge, None))[int(rng.integers(2))]] = False
        if where.any():
            part = picture[y0:y1, x0:x1]
            part[where] = _dyed(part, rng)[where]
    return view if picture is None else View(picture, view.rows, view.mask)


def repaper(view: View, rng: np.random.Generator) -> View:
    """Lay patterns over what is no actor, up to his outline."""
    picture = lay_patterns(view.picture, np.zeros((0, 4)), rng)
    actors = (view.mask > 0) & (view.mask < FURNITURE)
    picture[actors] = view.picture[actors]
    return View(picture, view.rows, view.mask)


def zoom(view: View, rng: np.random.Generator, *, most: float = 0.25) -> View:
    """Enlarge about a point of the horizon, across and upwards by factors of their own, up to 1 + `most`."""
    high, wide = view.mask.shape
    sx, sy = 1 + rng.uniform(0, most, 2)
    middle = float(rng.uniform(0, wide - 1))
    matrix = np.array([[sx, 0, middle * (1 - sx)], [0, sy, (high - 1) / 2 * (1 - sy)]], np.float64)
    picture = cv2.warpAffine(view.picture, matrix, (wide, high), flags=cv2.INTER_LINEAR)
    mask = cv2.warpAffine(view.mask, matrix, (wide, high), flags=cv2.INTER_NEAREST)
    return View(picture, _cut(view.rows, view.mask, mask, scale=sx * sy), mask)


def _lay(under: NDArray[Any], over: NDArray[Any], where: NDArray[Any], *, soft: bool) -> None:
    """Put one picture over another where it is to be, in place; `soft` with edges as a camera has them."""
    columns, lines = np.flatnonzero(where.any(axis=0)), np.flatnonzero(where.any(axis=1))
    part = slice(max(lines[0] - 1, 0), lines[-1] + 2), slice(max(columns[0] - 1, 0), columns[-1] + 2)
    if not soft:
        np.copyto(under[part], over[part], where=where[part][:, :, None])
        return
    share = cv2.merge([cv2.blur(where[part].astype(np.uint8) * 255, (3, 3))] * 3)
    above = cv2.multiply(over[part], share, scale=1 / 255.0)
    under[part] = cv2.add(above, cv2.multiply(under[part], cv2.bitwise_not(share), scale=1 / 255.0))


def _dyed(part: NDArray[Any], rng: np.random.Generator) -> NDArray[Any]:
    kind = rng.random()
    if kind < 0.35:  # one colour, shaded as before
        grey = part.max(axis=2).astype(np.float32)
        colour = rng.random(3) * rng.uniform(0.15, 1.0)
        level = 255.0 / max(float(grey.mean()), 8.0) * float(np.clip(grey.mean() / 128.0, 0.2, 1.0))
        dyed: NDArray[Any] = np.clip(grey[:, :, None] * (colour * level), 0, 255).astype(np.uint8)
        return dyed
    if kind < 0.7:  # a pattern, on what is there or on white
        pattern = draw_from_bank(rng)
        times = float(np.exp(rng.uniform(np.log(0.15), np.log(1.0))))
        side = max(int(pattern.shape[0] * times), 4)
        y, x = rng.integers(0, pattern.shape[0] - side + 1, 2)
        laid = cv2.resize(pattern[y : y + side, x : x + side], part.shape[1::-1], interpolation=cv2.INTER_LINEAR)
        if rng.random() < 0.5:
            darkened: NDArray[Any] = cv2.multiply(part, laid, scale=1 / 255.0)
            return darkened
        grey = cv2.multiply(laid, np.repeat(part.max(axis=2)[:, :, None], 3, axis=2), scale=1 / 200.0)
        tinted: NDArray[Any] = (grey * rng.uniform(0.3, 1.0, 3)).astype(np.uint8)
        return tinted
    out = part[:, :, rng.permutation(3)]
    gains = np.exp(rng.normal(0, 0.4, 3)).astype(np.float32)
    recoloured: NDArray[Any] = np.clip(out * gains, 0, 255).astype(np.uint8)
    return recoloured


def _pixels(row: NDArray[Any], shape: tuple[int, ...]) -> tuple[int, int, int, int]:
    """The row's box in pixels, one more on each side: it was measured at 640 x 480."""
    x0, y0, x1, y1 = row[_BOX] * [shape[1], shape[0], shape[1], shape[0]]
    return max(int(x0) - 1, 0), max(int(y0) - 1, 0), min(int(x1) + 2, shape[1]), min(int(y1) + 2, shape[0])


def _seen(rows: NDArray[Any], before: NDArray[Any], after: NDArray[Any]) -> NDArray[Any]:
    """Rows of who is still seen where something was laid over a part of the mask: boxes and shares as it is now."""
    kept = []
    for row in rows:
        x0, y0, x1, y1 = _pixels(row, before.shape)
        value = int(row[_MASK])
        was = int((before[y0:y1, x0:x1] == value).sum())
        still = after[y0:y1, x0:x1] == value
        now = int(still.sum())
        if now == was and was:
            kept.append(row)
        elif now >= FEWEST:
            row = row.copy()
            row[_BOX] = _bounds(still, x0, y0, before.shape)
            row[_SHARES] *= now / max(was, 1)
            kept.append(row)
    return np.array(kept, rows.dtype).reshape(-1, rows.shape[1])


def _cut(rows: NDArray[Any], before: NDArray[Any], after: NDArray[Any], *, scale: float = 1.0) -> NDArray[Any]:
    """Rows of who is inside the picture still, of masks that were moved or enlarged."""
    kept = []
    for row in rows:
        still = after == row[_MASK]
        now = int(still.sum())
        if now < FEWEST:
            continue
        row = row.copy()
        was = max(int((before == row[_MASK]).sum()), 1) * scale
        row[_BOX] = _bounds(still, 0, 0, before.shape)
        row[_WHOLE] *= min(now / was, 1.0)
        row[_SHARES[2]] *= now / was * scale
        kept.append(row)
    return np.array(kept, rows.dtype).reshape(-1, rows.shape[1])


def _bounds(where: NDArray[Any], x0: int, y0: int, shape: tuple[int, ...]) -> list[float]:
    columns, lines = np.flatnonzero(where.any(axis=0)), np.flatnonzero(where.any(axis=1))
    wide, high = shape[1], shape[0]
    return [
        (x0 + columns[0]) / wide,
        (y0 + lines[0]) / high,
        (x0 + columns[-1] + 1) / wide,
        (y0 + lines[-1] + 1) / high,
    ]
