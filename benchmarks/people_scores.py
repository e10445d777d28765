"""Scores of a people detector on photographs: what is found, what is false, average precision.

A box finds the person it overlaps most, among those that no surer box has found, if their IoU is at least `FOUND`.
Every other box is false: a second box on somebody, a box of the wrong size, and a box on somebody whom the labels
leave out. Average precision asks for an IoU of `FOUND_FOR_AP`, as PASCAL VOC and Penn-Fudan do.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FOUND = 0.4
FOUND_FOR_AP = 0.5
SIZES = {"small": (0.0, 0.1), "medium": (0.1, 0.3), "big": (0.3, np.inf)}
"""Height of a person as a share of the picture's: from, up to."""


@dataclass(frozen=True)
class Answer:
    """What a detector said of one picture.

    Args:
        height: of the picture [px].
        persons: labelled boxes x0, y0, x1, y1 [px], shape (N, 4).
        boxes: probability, x0, y0, x1, y1 [px] of each box of a person, shape (M, 5).
    """

    height: int
    persons: NDArray[np.float64]
    boxes: NDArray[np.float64]

    def matches(self, least: float = FOUND) -> NDArray[np.int64]:
        """Index of the person that each box finds, -1 for none, shape (M,)."""
        found = np.full(len(self.boxes), -1)
        overlaps = iou(self.boxes[:, 1:], self.persons)
        for box in np.argsort(-self.boxes[:, 0], kind="stable"):
            free = np.where(np.isin(np.arange(len(self.persons)), found), -1.0, overlaps[box])
            if len(free) and free.max() >= least:
                found[box] = int(free.argmax())
        return found

    def heights(self) -> NDArray[np.float64]:
        """Height of each person as a share of the picture's, shape (N,)."""
        return (self.persons[:, 3] - self.persons[:, 1]) / self.height


@dataclass(frozen=True)
class Score:
    """Counts over a set of pictures.

    Args:
        there: persons by size; found: those of them that are found.
        boxes: all boxes; false: those that find nobody.
        empty: pictures without persons; alarms: those of them that show a box.
    """

    there: dict[str, int]
    found: dict[str, int]
    boxes: int
    false: int
    empty: int
    alarms: int

    def recall(self, size: str) -> float:
        """Share of the persons of a size that are found; 0 if there are none."""
        return self.found[size] / max(self.there[size], 1)

    @property
    def precision(self) -> float:
        """Share of the boxes that find somebody; 0 without boxes."""
        return (self.boxes - self.false) / max(self.boxes, 1)


def iou(boxes: NDArray[np.float64], others: NDArray[np.float64]) -> NDArray[np.float64]:
    """Intersection over union of boxes x0, y0, x1, y1, shapes (N, 4) and (M, 4) to (N, M)."""
    low = np.maximum(boxes[:, None, :2], others[None, :, :2])
    high = np.minimum(boxes[:, None, 2:], others[None, :, 2:])
    shared = np.maximum(high - low, 0.0).prod(axis=-1)
    areas, other_areas = ((b[:, 2:] - b[:, :2]).prod(axis=-1) for b in (boxes, others))
    overlaps: NDArray[np.float64] = shared / np.maximum(areas[:, None] + other_areas - shared, 1e-12)
    return overlaps


def score(answers: Sequence[Answer]) -> Score:
    """Count what is found and what is false."""
    there, found = dict.fromkeys(SIZES, 0), dict.fromkeys(SIZES, 0)
    boxes = false = 0
    for answer in answers:
        matches, heights = answer.matches(), answer.heights()
        hit = np.isin(np.arange(len(heights)), matches)
        for size, (least, most) in SIZES.items():
            of_size = (heights >= least) & (heights < most)
            there[size] += int(of_size.sum())
            found[size] += int((of_size & hit).sum())
        boxes += len(matches)
        false += int((matches < 0).sum())
    empty = [answer for answer in answers if not len(answer.persons)]
    return Score(there, found, boxes, false, len(empty), sum(bool(len(answer.boxes)) for answer in empty))


def average_precision(answers: Sequence[Answer]) -> float:
    """Area under the curve of precision over recall; precision is the best at this recall or more."""
    probabilities = np.concatenate([np.zeros(0), *(answer.boxes[:, 0] for answer in answers)])
    good = np.concatenate([np.zeros(0, bool), *(answer.matches(FOUND_FOR_AP) >= 0 for answer in answers)])
    hits = np.cumsum(good[np.argsort(-probabilities, kind="stable")])
    precision = hits / np.arange(1, len(hits) + 1)
    best = np.maximum.accumulate(precision[::-1])[::-1]
    recall = hits / max(sum(len(answer.persons) for answer in answers), 1)
    return float(np.sum(np.diff(recall, prepend=0.0) * best))
