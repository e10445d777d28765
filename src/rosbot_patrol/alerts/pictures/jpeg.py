"""A camera's picture as JPEG, with boxes drawn on it (Pillow: OpenCV would cost 98 MB)."""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import dataclass

from PIL import Image, ImageDraw

from rosbot_patrol.counts import count_of
from rosbot_patrol.errors import AlertError

_RED = (230, 30, 30)
# encoding -> Pillow's raw mode, mode, bytes a pixel
_ENCODINGS = {
    "rgb8": ("RGB", "RGB", 3),
    "bgr8": ("BGR", "RGB", 3),
    "8UC3": ("BGR", "RGB", 3),
    "rgba8": ("RGBA", "RGBA", 4),
    "bgra8": ("BGRA", "RGBA", 4),
    "8UC4": ("BGRA", "RGBA", 4),
    "mono8": ("L", "L", 1),
    "8UC1": ("L", "L", 1),
}


@dataclass(frozen=True, kw_only=True)
class RawPicture:
    """Pixels as a camera sends them (sensor_msgs/Image).

    Attributes:
        stamp: when it was taken [s].
        encoding: rgb8, bgr8, rgba8, bgra8 or mono8.
        step: bytes a row.
    """

    stamp: float
    width: int
    height: int
    encoding: str
    step: int
    data: bytes


@dataclass(frozen=True, kw_only=True)
class EncodedPicture:
    """JPEG or PNG as a camera sends it (sensor_msgs/CompressedImage), and when it was taken [s]."""

    stamp: float
    data: bytes


Picture = RawPicture | EncodedPicture


@dataclass(frozen=True, kw_only=True)
class LabelledBox:
    """A box to draw: label and corners [px]."""

    text: str
    xmin: int
    ymin: int
    xmax: int
    ymax: int


def to_jpeg(picture: Picture, boxes: Sequence[LabelledBox] = (), *, quality: int = 88) -> bytes:
    """The picture as JPEG with its boxes; a JPEG without boxes stays as it is.

    Raises:
        AlertError: an encoding that is not known, or too few bytes.
    """
    if isinstance(picture, EncodedPicture) and not boxes and picture.data.startswith(b"\xff\xd8"):
        return picture.data
    image = _decode_encoded(picture) if isinstance(picture, EncodedPicture) else _decode(picture)
    draw = ImageDraw.Draw(image)
    for box in boxes:
        _draw_box(draw, box)
    out = io.BytesIO()
    image.save(out, "JPEG", quality=quality)
    return out.getvalue()


def _decode_encoded(picture: EncodedPicture) -> Image.Image:
    try:
        return Image.open(io.BytesIO(picture.data)).convert("RGB")
    except (OSError, SyntaxError, Image.DecompressionBombError) as err:
        size = count_of(len(picture.data), "byte")
        raise AlertError(f"a compressed picture of {size} cannot be read: {err}") from err


def _decode(picture: RawPicture) -> Image.Image:
    known = _ENCODINGS.get(picture.encoding)
    if known is None:
        raise AlertError(f"a picture in the encoding '{picture.encoding}' cannot be attached")
    raw_mode, mode, pixel = known
    rows = picture.height * picture.step
    if min(picture.width, picture.height) < 1 or picture.step < picture.width * pixel or len(picture.data) < rows:
        raise AlertError(
            f"a picture of {picture.width} x {picture.height} {picture.encoding} came with "
            f"{count_of(len(picture.data), 'byte')}"
        )
    size = (picture.width, picture.height)
    image = Image.frombytes(mode, size, picture.data, "raw", raw_mode, picture.step)
    return image.convert("RGB")


def _draw_box(draw: ImageDraw.ImageDraw, box: LabelledBox) -> None:
    left, right = sorted((box.xmin, box.xmax))
    top, bottom = sorted((box.ymin, box.ymax))
    draw.rectangle((left, top, right, bottom), outline=_RED, width=3)
    text = box.text.encode("latin-1", "replace").decode("latin-1")  # all that the built-in font has
    width = draw.textbbox((0, 0), text)[2]
    place = (max(min(left + 3, draw.im.size[0] - width - 3), 1), max(top - 13, 1))  # whole, also at the picture's edge
    x0, y0, x1, y1 = draw.textbbox(place, text)
    draw.rectangle((x0 - 2, y0 - 1, x1 + 2, y1 + 1), fill=_RED)
    draw.text(place, text, fill=(255, 255, 255))
