"""Letterbox: the picture in the network's input, as large as fits, centred, with grey around it, as in darknet."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Letterbox:
    """Position of a picture of `width` x `height` in an input of `net_width` x `net_height` [px]."""

    width: int
    height: int
    net_width: int
    net_height: int

    @property
    def fitted(self) -> tuple[int, int]:
        """Width and height of the fitted picture [px]; at least 1, where darknet would have 0."""
        if self.net_width / self.width < self.net_height / self.height:
            return self.net_width, max(self.height * self.net_width // self.width, 1)
        return max(self.width * self.net_height // self.height, 1), self.net_height

    @property
    def margins(self) -> tuple[int, int, int, int]:
        """Grey pixels left, above, right and below."""
        width, height = self.fitted
        left, top = (self.net_width - width) // 2, (self.net_height - height) // 2
        return left, top, self.net_width - width - left, self.net_height - height - top

    @property
    def row_gains(self) -> NDArray[np.float32]:
        """Factor of each row of the fitted picture, float32, shape (rows,): 1, except for the last.

        Darknet omits one of the last row's two summands, because the other has all the weight. If single precision puts
        that row just above the picture's last one, it becomes black instead, and the network sees that.
        """
        rows = self.fitted[1]
        gains = np.ones(rows, dtype=np.float32)
        if rows > 1:
            at = np.float32(rows - 1) * (np.float32(self.height - 1) / np.float32(rows - 1))
            gains[-1] = 1.0 - (at - np.floor(at))
        return gains

    def to_picture(self, boxes: NDArray[np.float32]) -> NDArray[np.float32]:
        """Convert boxes (x, y, width, height, relative to the input, shape (N, 4)) to the picture."""
        width, height = self.fitted
        out = np.empty_like(boxes)
        # darknet centres by half pixels here and by whole ones when it draws the picture; we keep that
        out[:, 0] = (boxes[:, 0] - (self.net_width - width) / 2.0 / self.net_width) / (width / self.net_width)
        out[:, 1] = (boxes[:, 1] - (self.net_height - height) / 2.0 / self.net_height) / (height / self.net_height)
        out[:, 2] = boxes[:, 2] * (self.net_width / width)
        out[:, 3] = boxes[:, 3] * (self.net_height / height)
        return out

    def draw(self, picture: NDArray[np.float32]) -> NDArray[np.float32]:
        """Input of the network: float32, shape (channels, net_height, net_width), 0 to 1, from a uint8 picture.

        It uses the same arithmetic as the first nodes of the ONNX graph, for run-times without them and for training.
        """
        width, height = self.fitted
        left, top, _, _ = self.margins
        rows = _along(picture.astype(np.float32) / np.float32(255.0), height, axis=0)
        fitted = _along(rows, width, axis=1) * self.row_gains[:, None, None]
        out = np.full((picture.shape[2], self.net_height, self.net_width), 0.5, dtype=np.float32)
        out[:, top : top + height, left : left + width] = fitted.transpose(2, 0, 1)
        return out


def _along(values: NDArray[np.float32], length: int, *, axis: int) -> NDArray[np.float32]:
    """Linear interpolation to `length` samples along an axis; the first and last samples stay."""
    have = values.shape[axis]
    at = np.arange(length, dtype=np.float32) * np.float32((have - 1) / max(length - 1, 1))
    low = np.minimum(at.astype(np.intp), have - 1)
    high = np.minimum(low + 1, have - 1)
    share = (at - low).reshape([-1 if i == axis else 1 for i in range(values.ndim)])
    resampled: NDArray[np.float32] = np.take(values, low, axis) * (1 - share) + np.take(values, high, axis) * share
    return resampled
