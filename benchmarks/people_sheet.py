"""Contact sheet of wrong and missed persons, to look at before a "false" box is counted."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from people_pictures import BIG, Photograph
from people_scores import Answer

TILE = (320, 240)
COLUMNS = 6
MOST = 60
ORANGE, RED, GREEN = (0, 140, 255), (0, 0, 255), (0, 200, 0)


def draw_sheet(photographs: list[Photograph], answers: list[Answer], target: Path) -> tuple[int, int]:
    """Draw the surest false boxes (orange) and the missed big persons (red) on a sheet.

    Returns:
        Number of false boxes and of missed persons drawn.
    """
    false, missed = [], []
    for one, answer in zip(photographs, answers, strict=True):
        matches = answer.matches()
        for i in np.flatnonzero(matches < 0):
            text = f"{answer.boxes[i, 0]:.2f}"
            false.append((answer.boxes[i, 0], _tile(one, answer, answer.boxes[i, 1:], ORANGE, text)))
        gone = (answer.heights() >= BIG) & ~np.isin(np.arange(len(answer.persons)), matches)
        missed += [_tile(one, answer, box, RED, "missed") for box in answer.persons[gone]]
    false.sort(key=lambda pair: -pair[0])
    tiles = [tile for _, tile in false[:MOST]] + missed[:MOST]
    tiles += [np.zeros((TILE[1], TILE[0], 3), np.uint8)] * (-len(tiles) % COLUMNS)
    rows = [np.hstack(tiles[i : i + COLUMNS]) for i in range(0, len(tiles), COLUMNS)]
    if rows:
        cv2.imwrite(str(target), np.vstack(rows), [cv2.IMWRITE_JPEG_QUALITY, 80])
    return min(len(false), MOST), min(len(missed), MOST)


def _tile(
    one: Photograph, answer: Answer, box: NDArray[np.float64], colour: tuple[int, int, int], text: str
) -> NDArray[np.uint8]:
    """The photograph with the labelled persons (green, thin) and one box."""
    rows, columns = one.pixels.shape[:2]
    scale = min(TILE[0] / columns, TILE[1] / rows)
    small = cv2.resize(one.pixels, (int(columns * scale), int(rows * scale)), interpolation=cv2.INTER_AREA)
    for person in answer.persons:
        _frame(small, person * scale, GREEN, 1)
    _frame(small, box * scale, colour, 2)
    at = (int(box[0] * scale), max(int(box[1] * scale) - 3, 10))
    cv2.putText(small, text, at, cv2.FONT_HERSHEY_SIMPLEX, 0.45, colour, 1, cv2.LINE_AA)
    cv2.putText(small, one.name[-10:-4], (2, small.shape[0] - 4), cv2.FONT_HERSHEY_SIMPLEX, 0.35, (255, 255, 255), 1)
    tile = np.zeros((TILE[1], TILE[0], 3), np.uint8)
    tile[: small.shape[0], : small.shape[1]] = small
    return tile


def _frame(picture: NDArray[np.uint8], box: NDArray[np.float64], colour: tuple[int, int, int], width: int) -> None:
    x0, y0, x1, y1 = (int(v) for v in box)
    cv2.rectangle(picture, (x0, y0), (x1, y1), colour, width)
