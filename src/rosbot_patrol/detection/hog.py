"""People detector of OpenCV up to version 4, without any weights.

Histograms of oriented gradients and a linear support vector machine (Dalal and Triggs, CVPR 2005), trained by them on
whole standing and walking people. It does not find people who sit, lie, are cut off by the picture's border or are
nearer than about 2.5 m to a usual camera. Furniture and door frames may be detected as people.

The probability is 1 / (1 + exp(-2 margin)) of the machine's margin: it grows with the margin and is not calibrated.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.detection.darknet.decode import Candidates, suppress_by_objectness
from rosbot_patrol.detection.detector import IOU_THRESHOLD, Detection, to_detections
from rosbot_patrol.errors import DetectorError
from rosbot_patrol.images.encodings import Picture

NAMES = ("person",)
WINDOW = (64, 128)
"""Width and height of what it looks at [px]; the person in it is about half as wide and three quarters as high."""
PERSON_SHARE = (0.6, 0.8)
STRIDE = (8, 8)
PADDING = (16, 16)
SCALE_STEP = 1.05
MOST_PIXELS = 480 * 360
"""Larger pictures are shrunk: a person at 7 m before a usual camera is still as high as it needs."""


class HogDetector:
    """Detects people without any files.

    Args:
        threshold: minimum probability, 0 to 1.
        threads: number of cores it may use; OpenCV applies it to the whole process.

    Raises:
        DetectorError: this OpenCV has no such detector.
    """

    def __init__(self, *, threshold: float = 0.7, threads: int = 1) -> None:
        if not hasattr(cv2, "HOGDescriptor"):
            raise DetectorError(f"OpenCV {cv2.__version__} has no HOGDescriptor, so hog is gone: use network:=auto")
        self._hog = cv2.HOGDescriptor()
        self._hog.setSVMDetector(cv2.HOGDescriptor_getDefaultPeopleDetector())
        self._threshold = threshold
        cv2.setNumThreads(threads)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of its classes."""
        return NAMES

    @property
    def runtime(self) -> str:
        """Its run-time."""
        return f"OpenCV {cv2.__version__} HOG"

    def detect(self, picture: Picture) -> list[Detection]:
        """Detect people in one picture; ImageError if it has no colours."""
        pixels = picture.to("bgr8").pixels
        shrink = min(1.0, (MOST_PIXELS / (picture.width * picture.height)) ** 0.5)
        if shrink < 1.0:
            pixels = cv2.resize(pixels, None, fx=shrink, fy=shrink, interpolation=cv2.INTER_AREA)
        if pixels.shape[1] < WINDOW[0] or pixels.shape[0] < WINDOW[1]:
            return []
        found, margins = self._hog.detectMultiScale(pixels, winStride=STRIDE, padding=PADDING, scale=SCALE_STEP)
        if not len(found):
            return []
        boxes = _people(np.asarray(found, dtype=np.float64), pixels.shape[1], pixels.shape[0])
        likely = (1.0 / (1.0 + np.exp(-2.0 * np.asarray(margins, dtype=np.float64)))).reshape(-1)
        keep = likely > self._threshold
        best = Candidates(boxes[keep], likely[keep], likely[keep, None])
        return to_detections(suppress_by_objectness(best, IOU_THRESHOLD), NAMES, picture.width, picture.height)


def _people(windows: NDArray[np.float64], width: int, height: int) -> NDArray[np.float64]:
    """Candidates from windows (left, top, width, height [px], shape (N, 4)): relative centres and sizes."""
    size = np.array([width, height], dtype=np.float64)
    centres = (windows[:, :2] + windows[:, 2:] / 2.0) / size
    return np.concatenate([centres, windows[:, 2:] * PERSON_SHARE / size], axis=1)
