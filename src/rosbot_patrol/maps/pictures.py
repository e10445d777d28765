"""Image files of maps: pgm and ppm are read by numpy, other formats by OpenCV if it is installed."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.counts import count_of
from rosbot_patrol.errors import MapError

_CHANNELS = {b"P2": 1, b"P3": 3, b"P5": 1, b"P6": 3}
_TOKEN = re.compile(rb"(?:\s|#[^\n]*\n)*([0-9]+)")
_MAX_PIXELS = 1 << 30


def read_picture(path: Path) -> NDArray[np.uint8]:
    """Read the pixels of an image, shape (rows, columns) or (rows, columns, channels), top row first.

    Raises:
        MapError: the file is missing, cut short, or no picture.
    """
    try:
        data = path.read_bytes()
    except OSError as err:
        raise MapError(path, f"the map's picture cannot be read: {err.strerror}") from err
    if data[:2] in _CHANNELS:
        return _read_netpbm(path, data)
    return _read_by_opencv(path, data)


def _read_netpbm(path: Path, data: bytes) -> NDArray[np.uint8]:
    kind = data[:2]
    numbers, at = [], 2
    for what in ("width", "height", "largest value"):
        found = _TOKEN.match(data, at)
        if found is None:
            raise MapError(path, f"the picture is cut short or broken: its header has no {what}")
        numbers.append(int(found[1]))
        at = found.end()
    width, height, largest = numbers
    if not (0 < width * height <= _MAX_PIXELS and 0 < largest < 65536):
        raise MapError(path, f"the picture's header is broken: {width} x {height} pixels, largest value {largest}")
    count = width * height * _CHANNELS[kind]
    if kind in (b"P5", b"P6"):
        values = _binary_values(path, data[at + 1 :], count, largest)
    else:
        values = _text_values(path, data[at:], count)
    if largest != 255:
        values = np.minimum(values.astype(np.float64) * (255.0 / largest), 255.0)
    shape = (height, width) if _CHANNELS[kind] == 1 else (height, width, 3)
    return values.astype(np.uint8).reshape(shape)


def _binary_values(path: Path, body: bytes, count: int, largest: int) -> NDArray[Any]:
    kind = np.dtype(np.uint8) if largest < 256 else np.dtype(">u2")
    if len(body) < count * kind.itemsize:
        found = count_of(len(body), "byte")
        raise MapError(path, f"the picture is cut short: {found} of pixels, expected {count * kind.itemsize}")
    return np.frombuffer(body, dtype=kind, count=count).copy()


def _text_values(path: Path, body: bytes, count: int) -> NDArray[Any]:
    words = re.sub(rb"#[^\n]*", b"", body).split()
    if len(words) < count:
        raise MapError(path, f"the picture is cut short: {count_of(len(words), 'pixel value')}, expected {count}")
    try:
        return np.array([int(w) for w in words[:count]], dtype=np.int64)
    except ValueError as err:
        raise MapError(path, f"the picture has a pixel that is no number: {err}") from err


def _read_by_opencv(path: Path, data: bytes) -> NDArray[np.uint8]:
    try:
        import cv2
    except ImportError as err:
        raise MapError(path, "reading a picture that is no pgm or ppm needs OpenCV (python3-opencv)") from err
    if _is_cut_short(data):
        raise MapError(path, "the picture is cut short")
    picture = cv2.imdecode(np.frombuffer(data, dtype=np.uint8), cv2.IMREAD_UNCHANGED) if data else None
    if picture is None:
        raise MapError(path, "is no picture that can be read (pgm, png or bmp are expected), or is cut short")
    if picture.dtype == np.uint16:
        picture = picture // 257
    return np.ascontiguousarray(picture, dtype=np.uint8)


def _is_cut_short(data: bytes) -> bool:
    """Whether a png lacks its last chunk or a bmp is shorter than it states (OpenCV pads the rest in silence)."""
    if data.startswith(b"\x89PNG"):
        return b"IEND" not in data[-64:]
    if data.startswith(b"BM") and len(data) >= 6:
        return len(data) < int.from_bytes(data[2:6], "little")
    return False


def pgm_bytes(picture: NDArray[np.uint8], comment: str) -> bytes:
    """Bytes of a grey image as binary pgm, exactly as map_saver writes it."""
    height, width = picture.shape
    header = f"P5\n# {comment}\n{width} {height}\n255\n".encode()
    return header + np.ascontiguousarray(picture).tobytes()
