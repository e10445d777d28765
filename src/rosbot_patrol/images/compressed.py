"""Compression of pictures to JPEG and PNG, and the message text with their original encoding.

Matches compressed_image_transport (noetic-devel): formats such as "rgb8; jpeg compressed bgr8", colours stored as blue,
green, red, and the source's encoding restored on the way back.

Differs: 16-bit pictures become JPEGs with values scaled to 8 bits, where upstream clips them at 255. `mode` gray gives
mono8 for JPEG, too. A depth picture as JPEG is refused. Colours of 16 bits and yuv422 travel as 8 bits per colour.

An ordinary JPEG is written and read by libjpeg-turbo itself (simplejpeg), in any order of colours. OpenCV, which costs
a node 100 MB, is loaded only for the rest.
"""

from __future__ import annotations

import importlib
from dataclasses import dataclass
from typing import Any

import numpy as np
import simplejpeg
from numpy.typing import NDArray

from rosbot_patrol.counts import count_of
from rosbot_patrol.errors import ImageError
from rosbot_patrol.images.encodings import ENCODINGS, Picture
from rosbot_patrol.params import param

COLOURS = ("rgb8", "bgr8", "rgba8", "bgra8", "8UC3", "8UC4")
MOST_PIXELS = 1 << 26
_ORDERS = {"rgb8": "RGB", "rgba8": "RGBA", "bgra8": "BGRA"}
_BY_CHANNELS = {1: "GRAY", 3: "BGR", 4: "BGRA"}


@dataclass(frozen=True, kw_only=True)
class CompressedParams:
    """Parameters of a compressed publisher; names and defaults as compressed_image_transport's."""

    format: str = param("jpeg", choices=("jpeg", "png"), doc="compression of the images")
    jpeg_quality: int = param(80, lo=1, hi=100, doc="quality of JPEG")
    jpeg_progressive: bool = param(False, doc="write progressive JPEGs")
    jpeg_optimize: bool = param(False, doc="optimise the Huffman tables")
    jpeg_restart_interval: int = param(0, lo=0, hi=65535, doc="restart interval of JPEG; 0: none")
    png_level: int = param(9, lo=1, hi=9, doc="compression effort of PNG")

    @property
    def plain(self) -> bool:
        """Whether it is an ordinary JPEG, without the special kinds that only `cv2.imencode` writes."""
        special = self.jpeg_progressive or self.jpeg_optimize or self.jpeg_restart_interval > 0
        return self.format == "jpeg" and not special

    def options(self) -> list[int]:
        """The parameters for `cv2.imencode`."""
        cv2 = _opencv()
        if self.format == "png":
            return [cv2.IMWRITE_PNG_COMPRESSION, self.png_level]
        return [
            *(cv2.IMWRITE_JPEG_QUALITY, self.jpeg_quality),
            *(cv2.IMWRITE_JPEG_PROGRESSIVE, int(self.jpeg_progressive)),
            *(cv2.IMWRITE_JPEG_OPTIMIZE, int(self.jpeg_optimize)),
            *(cv2.IMWRITE_JPEG_RST_INTERVAL, self.jpeg_restart_interval),
        ]


def compress(picture: Picture, params: CompressedParams) -> tuple[str, bytes]:
    """Format text and bytes of a picture.

    Raises:
        ImageError: this encoding cannot be compressed that way.
    """
    if _has_no_place(picture, params.format):
        picture = picture.eight_bits()
    colour = picture.encoding in COLOURS
    if picture.pixels.dtype != np.uint8 and params.format == "jpeg":
        pixels = picture.eight_bits().pixels
    elif picture.pixels.dtype == np.float32:
        raise ImageError(f"a picture of encoding {picture.encoding} cannot be a {params.format}")
    else:
        pixels = picture.pixels
    text = f"{picture.encoding}; {params.format} compressed {'bgr8' if colour else ''}"
    data = _plain_jpeg(pixels, picture.encoding, params) if params.plain else _encode(pixels, picture.encoding, params)
    if data is None:
        raise ImageError(f"a picture of {picture.width}x{picture.height} {picture.encoding} gives no {params.format}")
    return text, data


def _plain_jpeg(pixels: NDArray[Any], encoding: str, params: CompressedParams) -> bytes | None:
    """Like `_encode`, a quarter faster, because the colours need no reordering."""
    order = _ORDERS.get(encoding, _BY_CHANNELS[pixels.shape[2]])
    try:
        data: bytes = simplejpeg.encode_jpeg(np.ascontiguousarray(pixels), params.jpeg_quality, order, "420")
    except ValueError:  # such as more columns than a JPEG can have
        return None
    return data


def _encode(pixels: NDArray[Any], encoding: str, params: CompressedParams) -> bytes | None:
    cv2 = _opencv()
    codes = {"rgb8": cv2.COLOR_RGB2BGR, "rgba8": cv2.COLOR_RGBA2BGR, "bgra8": cv2.COLOR_BGRA2BGR}
    code = codes.get(encoding, cv2.COLOR_BGRA2BGR if pixels.shape[2] == 4 else None)
    try:
        pixels = pixels if code is None else cv2.cvtColor(pixels, code)
        done, data = cv2.imencode("." + params.format, pixels, params.options())
    except cv2.error:  # as above
        return None
    return data.tobytes() if done else None


def decompress(text: str, data: bytes, *, mode: str = "unchanged") -> Picture:
    """The picture in compressed bytes.

    Args:
        text: the message's format.
        data: jpeg or png.
        mode: unchanged, color or gray.

    Raises:
        ImageError: the bytes are no picture, or the format names an unknown encoding.
    """
    encoding = text.partition(";")[0].strip() if ";" in text else ""
    if encoding and encoding not in ENCODINGS:
        raise ImageError(f"the encoding '{encoding}' (of the format '{text}') is not known here")
    pixels = _read_plain_jpeg(data, encoding) if mode == "unchanged" else None
    if pixels is not None:
        as_it_was = encoding in _ORDERS and pixels.shape[2] > 1
        return Picture(pixels, encoding) if as_it_was else _restore(pixels, encoding, mode)
    cv2 = _opencv()
    flag = {"gray": cv2.IMREAD_GRAYSCALE, "color": cv2.IMREAD_COLOR}.get(mode, cv2.IMREAD_UNCHANGED)
    try:
        pixels = cv2.imdecode(np.frombuffer(data, dtype=np.uint8), flag) if data else None
    except cv2.error as err:  # such as a header that announces a billion pixels
        raise ImageError(f"{count_of(len(data), 'byte')} of the format '{text}' cannot be decoded: {err}") from err
    if pixels is None:
        one, many = f"byte of the format '{text}' is", f"bytes of the format '{text}' are"
        raise ImageError(f"{count_of(len(data), one, many)} no picture that can be read")
    return _restore(pixels.reshape(*pixels.shape[:2], -1), encoding, mode)


def _read_plain_jpeg(data: bytes, encoding: str) -> NDArray[Any] | None:
    """Shape (height, width, channels), its colours in the order of that encoding, else blue first; None where it is no
    jpeg as most are, is broken or very large, which is left to OpenCV.
    """
    if not data.startswith(b"\xff\xd8"):
        return None
    try:
        height, width, colours, _ = simplejpeg.decode_jpeg_header(data)
        if height * width > MOST_PIXELS or colours not in ("YCbCr", "RGB", "Gray"):
            return None
        order = "GRAY" if colours == "Gray" else _ORDERS.get(encoding, "BGR")
        pixels: NDArray[Any] = simplejpeg.decode_jpeg(data, order)
    except ValueError:
        return None
    return pixels


def _opencv() -> Any:
    return importlib.import_module("cv2")


def _has_no_place(picture: Picture, name: str) -> bool:
    """Whether a file of that format cannot store its values, or a reader would misinterpret them."""
    known = ENCODINGS[picture.encoding]
    deep = picture.pixels.dtype == np.uint16
    return known.channels == 2 or (deep and (known.channels > 1 or (known.raw and name == "jpeg")))


def _restore(pixels: NDArray[Any], encoding: str, mode: str) -> Picture:
    channels = pixels.shape[2]
    if channels == 1:
        if pixels.dtype == np.uint8 and encoding == "mono16":  # a jpeg of it
            return Picture(pixels.astype(np.uint16) * 257, encoding)
        known = ENCODINGS.get(encoding)
        if known is not None and known.channels == 1 and np.dtype(known.dtype) == pixels.dtype:
            return Picture(pixels, encoding)
        return Picture(pixels, "mono8" if pixels.dtype == np.uint8 else "mono16")
    if pixels.dtype != np.uint8:
        raise ImageError(f"a colour picture of {pixels.dtype.itemsize * 8} bits a value is not supported")
    if channels == 3 and encoding not in _ORDERS:
        return Picture(pixels, "bgr8")
    cv2 = _opencv()
    codes = {
        (3, "rgb8"): cv2.COLOR_BGR2RGB,
        (3, "rgba8"): cv2.COLOR_BGR2RGBA,
        (3, "bgra8"): cv2.COLOR_BGR2BGRA,
        (4, "rgb8"): cv2.COLOR_BGRA2RGB,
        (4, "bgr8"): cv2.COLOR_BGRA2BGR,
        (4, "rgba8"): cv2.COLOR_BGRA2RGBA,
    }
    code = codes.get((channels, encoding))
    if code is not None:
        return Picture(cv2.cvtColor(pixels, code), encoding)
    return Picture(pixels, "bgr8" if channels == 3 else "bgra8")
