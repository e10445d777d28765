"""Drawing of boxes into a picture, with Pillow: OpenCV would enlarge the node by 100 MB."""

from __future__ import annotations

import functools
import logging
from collections.abc import Iterable
from typing import Any

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from rosbot_patrol.detection.detector import Detection
from rosbot_patrol.images.encodings import Picture

log = logging.getLogger(__name__)

# blue, green, red; distinct for colour-blind people, too (Okabe and Ito)
COLOURS = ((0, 94, 213), (178, 114, 0), (66, 228, 240), (115, 158, 0), (167, 121, 204), (0, 159, 230), (233, 180, 86))

_PAD = 2  # padding around a label's letters [px]


def draw_boxes(picture: Picture, found: Iterable[Detection]) -> Picture:
    """Copy of the picture in bgr8, with box, class and probability of each detection."""
    canvas = Image.fromarray(picture.to("bgr8").pixels)
    draw = ImageDraw.Draw(canvas)
    for one in found:
        colour = COLOURS[one.class_id % len(COLOURS)]
        thick = max(1, round(canvas.height / 240))
        draw.rectangle((one.xmin, one.ymin, one.xmax, one.ymax), outline=colour, width=thick)
        _label(draw, canvas.size, f"{one.name} {one.probability:.0%}", (one.xmin, one.ymin), colour)
    return Picture(np.array(canvas), "bgr8")


def _label(
    draw: ImageDraw.ImageDraw, size: tuple[int, int], text: str, corner: tuple[int, int], colour: tuple[int, int, int]
) -> None:
    font = _font(max(11, round(size[1] / 36)))
    if not isinstance(font, ImageFont.FreeTypeFont):  # Pillow's own font has only the letters of Latin 1
        text = text.encode("latin-1", "replace").decode("latin-1")
    _, top, width, height = font.getbbox(text)
    width, height = width + 2 * _PAD, height - top + 2 * _PAD
    left = min(max(corner[0], 0), max(size[0] - width, 0))
    bottom = max(corner[1], height)
    draw.rectangle((left, bottom - height, left + width - 1, bottom - 1), fill=colour)
    ink = (0, 0, 0) if sum(colour) > 380 else (255, 255, 255)
    draw.text((left + _PAD, bottom - height + _PAD - top), text, fill=ink, font=font)


@functools.lru_cache(maxsize=4)
def _font(height: int) -> Any:
    try:
        return ImageFont.truetype("DejaVuSans.ttf", height)
    except OSError as err:
        log.warning("labels are drawn in small letters, DejaVuSans.ttf: %s (package fonts-dejavu-core)", err)
        return ImageFont.load_default()
