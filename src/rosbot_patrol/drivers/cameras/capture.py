"""A picture as a camera gives it, and what every camera has in common."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import simplejpeg
from numpy.typing import NDArray

from rosbot_patrol.errors import ImageError
from rosbot_patrol.images.encodings import Picture

_END = b"\xff\xd9"
_AFTER_END = 4096  # bytes of padding that cameras send after the end of a JPEG


@dataclass(frozen=True)
class Capture:
    """One picture, either as the camera's JPEG or as pixels.

    Attributes:
        width: number of columns; height: number of rows.
        at: steady time at which it was taken [s].
        jpeg: its bytes, b"" if the camera sends none.
        pixels: shape (height, width, 3), blue first, None for a JPEG.
    """

    width: int
    height: int
    at: float
    jpeg: bytes = b""
    pixels: NDArray[np.uint8] | None = None

    @property
    def picture(self) -> Picture:
        """The pixels as rgb8 or bgr8. Raises ImageError for a JPEG that cannot be decoded."""
        if self.pixels is not None:
            return Picture(self.pixels, "bgr8")
        try:
            return Picture(simplejpeg.decode_jpeg(self.jpeg, "RGB"), "rgb8")
        except ValueError as err:
            raise ImageError(f"a JPEG of {len(self.jpeg)} bytes cannot be decoded: {err}") from err


class Camera(Protocol):
    """An open camera."""

    def read(self) -> Capture:
        """The next picture. Raises DeviceError if the camera is lost or silent, ImageError if this one is spoilt."""

    def close(self) -> None:
        """Close it."""


def jpeg_capture(data: bytes, at: float) -> Capture:
    """A camera's JPEG, as it is. Raises ImageError if it is cut short or none at all."""
    if data.find(_END, max(len(data) - _AFTER_END, 0)) < 0:
        raise ImageError(f"a JPEG of {len(data)} bytes has no end")
    try:
        height, width, _, _ = simplejpeg.decode_jpeg_header(data)
    except ValueError as err:
        raise ImageError(f"{len(data)} bytes are no JPEG: {err}") from err
    return Capture(width, height, at, jpeg=data)


def pixel_capture(pixels: NDArray[Any], at: float) -> Capture:
    """A picture of pixels, shape (height, width, 3), blue first."""
    return Capture(pixels.shape[1], pixels.shape[0], at, pixels=pixels)
