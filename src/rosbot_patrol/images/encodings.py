"""Pictures as numpy arrays, in the encodings of sensor_msgs/Image.

Matches cv_bridge for mono, rgb, bgr, rgba and bgra of 8 and 16 bits, their 8UC and 16UC names, 32FC1, and a camera's
own bayer mosaics and yuv422. Only the last two need OpenCV (98 MB in a process that only reads pixels).
"""

from __future__ import annotations

import importlib
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.errors import ImageError


@dataclass(frozen=True)
class Encoding:
    """Type and number of the values of a pixel.

    Args:
        dtype: numpy's name of the type, without byte order.
        channels: values of a pixel.
        order: indices of red, green and blue, () without colours.
        raw: raw data of a camera's chip or driver, to be developed into colours (`raw_colours`).
    """

    dtype: str
    channels: int
    order: tuple[int, ...] = ()
    raw: bool = False


ENCODINGS = {
    "mono8": Encoding("u1", 1, (0, 0, 0)),
    "rgb8": Encoding("u1", 3, (0, 1, 2)),
    "bgr8": Encoding("u1", 3, (2, 1, 0)),
    "rgba8": Encoding("u1", 4, (0, 1, 2)),
    "bgra8": Encoding("u1", 4, (2, 1, 0)),
    "mono16": Encoding("u2", 1, (0, 0, 0)),
    "rgb16": Encoding("u2", 3, (0, 1, 2)),
    "bgr16": Encoding("u2", 3, (2, 1, 0)),
    "rgba16": Encoding("u2", 4, (0, 1, 2)),
    "bgra16": Encoding("u2", 4, (2, 1, 0)),
    "8UC1": Encoding("u1", 1, (0, 0, 0)),
    "8UC3": Encoding("u1", 3, (2, 1, 0)),
    "8UC4": Encoding("u1", 4, (2, 1, 0)),
    "16UC1": Encoding("u2", 1),
    "32FC1": Encoding("f4", 1),
    **{
        f"bayer_{pattern}{bits}": Encoding(dtype, 1, raw=True)
        for pattern in ("rggb", "bggr", "gbrg", "grbg")
        for bits, dtype in ((8, "u1"), (16, "u2"))
    },
    "yuv422": Encoding("u1", 2, raw=True),
    "yuv422_yuy2": Encoding("u1", 2, raw=True),
}


@dataclass(frozen=True)
class Picture:
    """A picture and its encoding.

    Args:
        pixels: values, shape (rows, columns, channels), in this machine's byte order; may be read-only.
        encoding: a key of `ENCODINGS`.
    """

    pixels: NDArray[Any]
    encoding: str

    @property
    def width(self) -> int:
        """Columns [px]."""
        return int(self.pixels.shape[1])

    @property
    def height(self) -> int:
        """Rows [px]."""
        return int(self.pixels.shape[0])

    @property
    def order(self) -> tuple[int, ...]:
        """Indices of the red, green and blue channels.

        Raises:
            ImageError: it has no colours (depth).
        """
        order = ENCODINGS[self.encoding].order
        if not order:
            raise self._no_colours()
        return order

    def eight_bits(self) -> Picture:
        """The picture with 8 bits per value, in colour or grey; 16 bits are scaled as in cv_bridge."""
        if ENCODINGS[self.encoding].raw:
            develop = importlib.import_module("rosbot_patrol.images.raw_colours").develop
            developed: Picture = develop(self)
            return developed.eight_bits()
        if self.pixels.dtype == np.uint8:
            return self
        if not ENCODINGS[self.encoding].order:
            raise self._no_colours()
        scaled = ((self.pixels.astype(np.uint32) * 255 + 32767) // 65535).astype(np.uint8)
        return Picture(scaled, self.encoding.replace("16", "8"))

    def to(self, encoding: str) -> Picture:
        """The picture in mono8, rgb8 or bgr8; it may share the pixels of this one."""
        if encoding == self.encoding:
            return self
        if encoding not in ("mono8", "rgb8", "bgr8"):
            raise ImageError(f"pictures are not converted to {encoding}, expected mono8, rgb8 or bgr8")
        source = self.eight_bits()
        if encoding == "mono8":
            return Picture(source.grey(), encoding)
        order = source.order if encoding == "rgb8" else source.order[::-1]
        if source.pixels.shape[2] == 3 and order == (0, 1, 2):
            return Picture(source.pixels, encoding)
        return Picture(np.ascontiguousarray(source.pixels[:, :, list(order)]), encoding)

    def _no_colours(self) -> ImageError:
        colours = ", ".join(name for name, known in ENCODINGS.items() if known.order or known.raw)
        return ImageError(f"a picture of encoding {self.encoding} has no colours, expected one of {colours}")

    def grey(self) -> NDArray[Any]:
        """Brightness of each pixel by BT.601, shape (height, width, 1)."""
        if self.pixels.shape[2] == 1:
            return self.pixels
        red, green, blue = (self.pixels[:, :, i].astype(np.uint32) for i in self.order)
        # weights of BT.601 in 14 bits, as in OpenCV
        grey: NDArray[np.uint8] = ((red * 4899 + green * 9617 + blue * 1868 + 8192) >> 14).astype(np.uint8)[:, :, None]
        return grey


def unpack(
    data: bytes | memoryview, encoding: str, *, width: int, height: int, step: int = 0, big_endian: bool = False
) -> Picture:
    """Read the bytes of a picture message.

    Args:
        data: rows of `step` bytes.
        encoding: the message's encoding.
        width: columns [px].
        height: rows [px].
        step: length of a row [bytes]; 0 means no gap between rows.
        big_endian: byte order of values of more than one byte.

    Raises:
        ImageError: the encoding is unknown, or the sizes do not fit; says which.
    """
    known = ENCODINGS.get(encoding)
    if known is None:
        raise ImageError(f"the encoding '{encoding}' is not known here, expected one of {', '.join(ENCODINGS)}")
    if width < 1 or height < 1:
        raise ImageError(f"a picture of {width}x{height} pixels is empty")
    dtype = np.dtype(known.dtype).newbyteorder(">" if big_endian else "<")
    row = width * known.channels * dtype.itemsize
    step = step or row
    if step < row or len(data) < step * height:
        raise ImageError(
            f"a picture of {width}x{height} {encoding} with rows of {step} bytes needs {max(step, row) * height} "
            f"bytes, it has {len(data)}"
        )
    rows = np.frombuffer(data, dtype=np.uint8, count=step * height).reshape(height, step)[:, :row]
    pixels = np.ascontiguousarray(rows).view(dtype).reshape(height, width, known.channels)
    return Picture(pixels.astype(dtype.newbyteorder("="), copy=False), encoding)


def pack(picture: Picture) -> tuple[bytes, int]:
    """Bytes of a picture message (little-endian, no gaps), and the length of a row [bytes]."""
    pixels = picture.pixels
    little = np.ascontiguousarray(pixels, dtype=pixels.dtype.newbyteorder("<"))
    return little.tobytes(), pixels.shape[1] * pixels.shape[2] * pixels.dtype.itemsize
