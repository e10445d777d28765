"""Decoding of a network's heads to boxes, as darknet computes them.

Threshold rules: a box counts if its objectness is above the threshold, and a class of it if objectness times class is.
Boxes are relative to the picture: x and y of the centre, width, height.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.detection.darknet.layers import Head, Region, Yolo
from rosbot_patrol.detection.darknet.letterbox import Letterbox

BLOCK = 64
"""Boxes compared with all others at once."""


@dataclass(frozen=True)
class Candidates:
    """Boxes before and after suppression.

    Args:
        boxes: centre x, centre y, width, height, shape (N, 4).
        objectness: shape (N,).
        probabilities: of each class, 0 where not above the threshold, shape (N, classes).
    """

    boxes: NDArray[np.float32]
    objectness: NDArray[np.float32]
    probabilities: NDArray[np.float32]

    def __len__(self) -> int:
        return len(self.boxes)

    def only(self, keep: NDArray[np.bool_ | np.int64]) -> Candidates:
        """The boxes selected by `keep` (a mask, or indices in a new order)."""
        return Candidates(self.boxes[keep], self.objectness[keep], self.probabilities[keep])


def decode_head(head: Head, values: NDArray[np.float32], net_size: tuple[int, int], threshold: float) -> Candidates:
    """Boxes of one head above the threshold, relative to the network's input.

    Args:
        head: a Region or Yolo layer.
        values: output of the layer before it, shape (channels, rows, columns).
        net_size: width and height of the network's input [px].
        threshold: on objectness and on probability.
    """
    rows, columns = values.shape[1:]
    grid = values.reshape(len(head.anchors), head.classes + 5, rows, columns)
    objectness = _objectness(head, grid[:, 4])
    # row by row, column by column, anchor by anchor, the order in which darknet counts
    at = np.argwhere((objectness > threshold).transpose(1, 2, 0))
    row, column, anchor = at.T
    found = grid[anchor, :, row, column].reshape(len(at), head.classes + 5)
    scores = objectness[anchor, row, column]
    anchors = np.asarray(head.anchors, dtype=np.float32)[anchor]
    boxes = _boxes(
        head, found[:, :4], np.stack([column, row], axis=1), anchors, grid_size=(columns, rows), net_size=net_size
    )
    probabilities = scores[:, None] * _classes(head, found[:, 5:])
    return Candidates(boxes, scores, np.where(probabilities > threshold, probabilities, np.float32(0.0)))


def decode(
    heads: list[Head], values: list[NDArray[np.float32]], place: Letterbox, *, threshold: float, iou_threshold: float
) -> Candidates:
    """Boxes of a picture: all heads, mapped back through the letterbox, suppressed as in darknet_ros.

    Args:
        heads: the network's heads.
        values: output of the layer before each, shape (channels, rows, columns).
        place: position of the picture in the input.
        threshold: on objectness and on probability.
        iou_threshold: of two boxes that overlap more, the one of lower objectness is dropped.
    """
    return suppress_by_objectness(candidates(heads, values, place, threshold=threshold), iou_threshold)


def candidates(
    heads: list[Head], values: list[NDArray[np.float32]], place: Letterbox, *, threshold: float
) -> Candidates:
    """Like `decode`, without suppression."""
    net_size = (place.net_width, place.net_height)
    parts = [decode_head(head, array, net_size, threshold) for head, array in zip(heads, values, strict=True)]
    boxes = np.concatenate([part.boxes for part in parts])
    objectness = np.concatenate([part.objectness for part in parts])
    return Candidates(place.to_picture(boxes), objectness, np.concatenate([part.probabilities for part in parts]))


def suppress_by_objectness(found: Candidates, iou_threshold: float) -> Candidates:
    """Drop boxes of any class that overlap one of higher objectness (darknet's do_nms_obj); sorts by it."""
    ranked = found.only(np.argsort(-found.objectness, kind="stable"))
    alive = np.ones(len(ranked), dtype=bool)
    for start in range(0, len(ranked), BLOCK):
        rows = start + np.flatnonzero(alive[start : start + BLOCK])
        apart = iou(ranked.boxes[rows, None], ranked.boxes[None, start:]) <= iou_threshold
        for row, i in zip(apart, rows, strict=True):
            if alive[i]:
                alive[i + 1 :] &= row[i + 1 - start :]
    return ranked.only(alive)


def suppress_by_class(found: Candidates, iou_threshold: float) -> Candidates:
    """Suppress within each class, as the program `darknet detector test` does (darknet's do_nms_sort)."""
    probabilities = found.probabilities.copy()
    for column in probabilities.T:
        order = np.argsort(-column, kind="stable")
        order = order[column[order] > 0.0]
        for rank, i in enumerate(order):
            if column[i] > 0.0:
                later = order[rank + 1 :]
                column[later[iou(found.boxes[i], found.boxes[later]) > iou_threshold]] = 0.0
    return Candidates(found.boxes, found.objectness, probabilities)


def iou(box: NDArray[np.float32], boxes: NDArray[np.float32]) -> NDArray[np.float32]:
    """Intersection over union of boxes, last axis x, y, width, height, the others as numpy broadcasts them."""
    with np.errstate(invalid="ignore"):
        half, halves = box[..., 2:] / 2, boxes[..., 2:] / 2
        low = np.maximum(box[..., :2] - half, boxes[..., :2] - halves)
        high = np.minimum(box[..., :2] + half, boxes[..., :2] + halves)
        width, height = (np.maximum(high[..., axis] - low[..., axis], 0.0) for axis in (0, 1))
        shared = width * height
        union = box[..., 2] * box[..., 3] + boxes[..., 2] * boxes[..., 3] - shared
    overlaps: NDArray[np.float32] = np.divide(shared, union, out=np.zeros_like(shared), where=union > 0.0)
    return overlaps


def logistic(values: NDArray[np.float32]) -> NDArray[np.float32]:
    """1 / (1 + exp(-x)), computed in double as darknet does, float32."""
    with np.errstate(over="ignore"):
        return (1.0 / (1.0 + np.exp(-values.astype(np.float64)))).astype(np.float32)


def softmax(values: NDArray[np.float32]) -> NDArray[np.float32]:
    """Softmax along the last axis, float32."""
    powers = np.exp(values - values.max(axis=-1, keepdims=True))
    shares: NDArray[np.float32] = powers / powers.sum(axis=-1, keepdims=True)
    return shares


def _objectness(head: Head, raw: NDArray[np.float32]) -> NDArray[np.float32]:
    if isinstance(head, Region) and head.background:
        return np.ones_like(raw)
    if isinstance(head, Yolo) and head.new_coords:
        return raw  # the convolution before it already applies the logistic function
    return logistic(raw)


def _classes(head: Head, raw: NDArray[np.float32]) -> NDArray[np.float32]:
    if isinstance(head, Region) and head.softmax:
        return softmax(raw)
    if isinstance(head, Yolo) and head.new_coords:
        return raw
    return logistic(raw)


def _boxes(
    head: Head,
    raw: NDArray[np.float32],
    cells: NDArray[np.float32],
    anchors: NDArray[np.float32],
    *,
    grid_size: tuple[int, int],
    net_size: tuple[int, int],
) -> NDArray[np.float32]:
    """Boxes relative to the input, shape (N, 4), from the network's output for each of N cells."""
    scale = np.asarray(net_size if isinstance(head, Yolo) else grid_size, dtype=np.float32)
    if isinstance(head, Yolo) and head.new_coords:
        offsets, sizes = raw[:, :2], 4.0 * raw[:, 2:] ** 2
    else:
        offsets = logistic(raw[:, :2])
        with np.errstate(over="ignore"):
            sizes = np.exp(raw[:, 2:])
    if isinstance(head, Yolo) and head.scale_x_y != 1.0:
        offsets = offsets * head.scale_x_y - 0.5 * (head.scale_x_y - 1.0)
    centres = (cells + offsets) / np.asarray(grid_size, dtype=np.float32)
    boxes: NDArray[np.float32] = np.concatenate([centres, sizes * anchors / scale], axis=1).astype(np.float32)
    return boxes
