"""Compression of depth pictures: PNG or RVL of 16-bit values.

Matches compressed_depth_image_transport (noetic-devel): 12 bytes of header (format, two parameters), metres as inverse
depth quantised to 16 bits, millimetres unchanged up to `depth_max`, and a format text such as "32FC1; compressedDepth
png".

Differs: values that are not positive are unknown, and values too near for 16 bits are clamped; upstream's result is
undefined for both. Data that end too soon, or state a wrong size, are refused.
"""

from __future__ import annotations

import importlib
import struct
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.errors import ImageError
from rosbot_patrol.images import rvl_kernels
from rosbot_patrol.images.encodings import Picture
from rosbot_patrol.params import param

HEADER = struct.Struct("<i2f")
_INVERSE_DEPTH = 0
_SIZE = struct.Struct("<2I")
MOST_PIXELS = 1 << 25
METRES, MILLIMETRES = ("32FC1",), ("16UC1", "mono16")


@dataclass(frozen=True, kw_only=True)
class CompressedDepthParams:
    """Parameters of a compressedDepth publisher; names and defaults as compressed_depth_image_transport's."""

    format: str = param("png", choices=("png", "rvl"), doc="compression of the values")
    depth_max: float = param(10.0, unit="m", lo=1.0, hi=100.0, doc="maximum depth; larger values become unknown")
    depth_quantization: float = param(100.0, lo=1.0, hi=150.0, doc="depth at which the accuracy is 1 m [m]")
    png_level: int = param(9, lo=1, hi=9, doc="compression effort of PNG")


def compress_depth(picture: Picture, params: CompressedDepthParams) -> tuple[str, bytes]:
    """Format text and bytes of a depth picture.

    Raises:
        ImageError: it is no depth picture.
    """
    a = b = 0.0
    if picture.encoding in METRES:
        a = params.depth_quantization * (params.depth_quantization + 1.0)
        b = 1.0 - a / params.depth_max
        values = _inverse(picture.pixels[:, :, 0], np.float32(a), np.float32(b), np.float32(params.depth_max))
    elif picture.encoding in MILLIMETRES:
        raw = picture.pixels[:, :, 0]
        values = np.where(raw > min(params.depth_max * 1000.0, 65535.0), np.uint16(0), raw)
    else:
        raise ImageError(
            f"a picture of encoding {picture.encoding} is no depth, expected {', '.join(METRES + MILLIMETRES)}"
        )
    if params.format == "rvl":
        data = _rvl(values)
    else:
        cv2 = importlib.import_module("cv2")
        done, coded = cv2.imencode(".png", values, [cv2.IMWRITE_PNG_COMPRESSION, params.png_level])
        if not done:
            raise ImageError(f"a picture of {picture.width}x{picture.height} {picture.encoding} gives no png")
        data = coded.tobytes()
    return f"{picture.encoding}; compressedDepth {params.format}", HEADER.pack(_INVERSE_DEPTH, a, b) + data


def decompress_depth(text: str, data: bytes) -> Picture:
    """The depth picture from compressed bytes.

    Args:
        text: the message's format; without "png" or "rvl" it is a PNG from an older sender.
        data: compressed bytes.

    Raises:
        ImageError: the bytes are no such picture; says why.
    """
    encoding, _, how = (part.strip() for part in text.partition(";"))
    name = how.removeprefix("compressedDepth").strip() or "png"
    ours = not how or how.startswith("compressedDepth")
    if encoding not in METRES + MILLIMETRES or name not in ("png", "rvl") or not ours:
        raise ImageError(f"the format '{text}' is not known here, expected one like '32FC1; compressedDepth png'")
    if len(data) <= HEADER.size:
        raise ImageError(f"{len(data)} bytes of the format '{text}' hold no picture")
    _, a, b = HEADER.unpack_from(data)
    body = bytes(data[HEADER.size :])
    values = _from_rvl(body, text) if name == "rvl" else _from_png(body, text)
    if encoding in MILLIMETRES:
        return Picture(values[:, :, None], encoding)
    with np.errstate(divide="ignore", invalid="ignore"):
        depth = np.float32(a) / (values.astype(np.float32) - np.float32(b))
    return Picture(np.where(values == 0, np.float32(np.nan), depth).astype(np.float32)[:, :, None], encoding)


def _inverse(depth: NDArray[Any], a: np.float32, b: np.float32, depth_max: np.float32) -> NDArray[Any]:
    with np.errstate(divide="ignore", invalid="ignore"):
        scaled = np.minimum(a / depth + b, np.float32(65535.0))
        known = (depth > 0.0) & (depth < depth_max)
        return np.where(known, scaled, np.float32(0.0)).astype(np.uint16)


def _rvl(values: NDArray[Any]) -> bytes:
    room = np.empty(3 * values.size + 16, dtype=np.uint8)
    used = rvl_kernels.encode(np.ascontiguousarray(values).reshape(-1), room)
    return _SIZE.pack(values.shape[1], values.shape[0]) + room[:used].tobytes()


def _from_rvl(body: bytes, text: str) -> NDArray[Any]:
    width, height = _SIZE.unpack_from(body) if len(body) >= _SIZE.size else (0, 0)
    if not 0 < width * height <= MOST_PIXELS:
        raise ImageError(f"{len(body)} bytes of the format '{text}' claim a picture of {width}x{height}")
    values = np.empty(height * width, dtype=np.uint16)
    if rvl_kernels.decode(np.frombuffer(body, dtype=np.uint8, offset=_SIZE.size).copy(), values) != values.size:
        raise ImageError(f"{len(body)} bytes of the format '{text}' do not hold the {width}x{height} values they claim")
    return values.reshape(height, width)


def _from_png(body: bytes, text: str) -> NDArray[Any]:
    cv2 = importlib.import_module("cv2")
    values = cv2.imdecode(np.frombuffer(body, dtype=np.uint8), cv2.IMREAD_UNCHANGED)
    if values is None or values.ndim != 2 or values.dtype != np.uint16:
        raise ImageError(f"{len(body)} bytes of the format '{text}' are no png of 16-bit values")
    return np.asarray(values)
