"""Draw boxes into a picture."""

from __future__ import annotations

from collections.abc import Iterable

import cv2
import numpy as np

from rosbot_patrol.detection.detector import Detection
from rosbot_patrol.images.encodings import Picture

# blue, green, red; well apart for colour-blind eyes too (Okabe and Ito)
COLOURS = ((0, 94, 213), (178, 114, 0), (66, 228, 240), (115, 158, 0), (167, 121, 204), (0, 159, 230), (233, 180, 86))


def draw_boxes(picture: Picture, found: Iterable[Detection]) -> Picture:
    """A copy of the picture in bgr8, with box, class and probability of everything found."""
    canvas = np.array(picture.to("bgr8").pixels, order="C")
    for one in found:
        colour = COLOURS[one.class_id % len(COLOURS)]
        thick = max(1, round(canvas.shape[0] / 240))
        cv2.rectangle(canvas, (one.xmin, one.ymin), (one.xmax, one.ymax), colour, thick)
        _label(canvas, f"{one.name} {one.probability:.0%}", (one.xmin, one.ymin), colour)
    return Picture(canvas, "bgr8")


def _label(canvas: np.ndarray, text: str, corner: tuple[int, int], colour: tuple[int, int, int]) -> None:
    scale = max(0.4, canvas.shape[0] / 960)
    (width, height), base = cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, scale, 1)
    left = min(max(corner[0], 0), max(canvas.shape[1] - width, 0))
    bottom = max(corner[1], height + base)
    cv2.rectangle(canvas, (left, bottom - height - base), (left + width, bottom), colour, cv2.FILLED)
    ink = (0, 0, 0) if sum(colour) > 380 else (255, 255, 255)
    cv2.putText(canvas, text, (left, bottom - base // 2 - 1), cv2.FONT_HERSHEY_SIMPLEX, scale, ink, 1, cv2.LINE_AA)
