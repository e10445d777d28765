"""Conversion of a camera's raw data to colours: bayer mosaics and yuv422.

Matches cv_bridge's conversions of bayer_* (OpenCV's bilinear rule), yuv422 (u, y, v, y) and yuv422_yuy2 (y, u, y, v).
"""

from __future__ import annotations

import cv2

from rosbot_patrol.errors import ImageError
from rosbot_patrol.images.encodings import Picture

# OpenCV names a mosaic by the second and third pixel of its second row.
_CODES = {
    "rggb": cv2.COLOR_BayerBG2RGB,
    "bggr": cv2.COLOR_BayerRG2RGB,
    "gbrg": cv2.COLOR_BayerGR2RGB,
    "grbg": cv2.COLOR_BayerGB2RGB,
    "yuv422": cv2.COLOR_YUV2RGB_UYVY,
    "yuv422_yuy2": cv2.COLOR_YUV2RGB_YUY2,
}


def develop(picture: Picture) -> Picture:
    """The picture in rgb8, or rgb16 for a mosaic of 16 bits.

    Raises:
        ImageError: it is too small or too odd for its pattern.
    """
    width, height, name = picture.width, picture.height, picture.encoding
    if name.startswith("yuv") and width % 2:
        raise ImageError(f"a picture of {width}x{height} {name} has half a pair of pixels in each row")
    if name.startswith("bayer") and min(width, height) < 4:
        raise ImageError(f"a picture of {width}x{height} {name} is too small for its colours, expected 4x4 at least")
    code = _CODES[name.removeprefix("bayer_").rstrip("168") if name.startswith("bayer") else name]
    return Picture(cv2.cvtColor(picture.pixels, code), "rgb16" if picture.pixels.dtype.itemsize == 2 else "rgb8")
