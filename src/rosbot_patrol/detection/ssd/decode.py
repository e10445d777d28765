"""Decoding of an SSD's outputs to boxes, as TensorFlow's object-detection API computes them.

Box coder: `faster_rcnn_box_coder` with the scales 10, 10, 5, 5. Scores: a logistic function for each class.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.detection.darknet.decode import Candidates, logistic

CENTRE_SCALE = 10.0
SIZE_SCALE = 5.0


def decode(
    encodings: NDArray[np.float32], logits: NDArray[np.float32], anchors: NDArray[np.float32], *, threshold: float
) -> Candidates:
    """Boxes above the threshold, before suppression.

    Args:
        encodings: y, x, height and width of each anchor's box in the coder's scale, shape (N, 4).
        logits: of the background and then of each class, shape (N, 1 + classes).
        anchors: centre x, centre y, width, height, shape (N, 4).
        threshold: on the score of a class, 0 to 1.
    """
    scores = logistic(logits[:, 1:])
    keep = (scores > threshold).any(axis=1)
    scores, raw, at = scores[keep], encodings[keep], anchors[keep]
    boxes = np.empty_like(at)
    boxes[:, :2] = raw[:, [1, 0]] / CENTRE_SCALE * at[:, 2:] + at[:, :2]
    with np.errstate(over="ignore"):
        boxes[:, 2:] = np.exp(raw[:, [3, 2]] / SIZE_SCALE) * at[:, 2:]
    return Candidates(boxes, scores.max(axis=1, initial=0.0), np.where(scores > threshold, scores, np.float32(0.0)))
