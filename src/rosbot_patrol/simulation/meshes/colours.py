"""Mean colours of textures: this camera shows plain colours instead of a world's textures."""

from __future__ import annotations

import functools
import logging
from collections.abc import Iterable
from pathlib import Path

log = logging.getLogger(__name__)

Rgba = tuple[float, float, float, float]


def picture_near(name: str, base: Path) -> Path | None:
    """Find a texture's file: beside the file that names it, or in the texture folders of Gazebo's models."""
    plain = Path(name.removeprefix("file://"))
    places = [
        base / plain,
        *(folder / plain.name for folder in (base, base / "textures", base.parent / "textures")),
        base.parent / "materials" / "textures" / plain.name,
    ]
    return next((place for place in places if place.is_file()), None)


@functools.lru_cache(maxsize=256)
def mean_colour(path: Path) -> Rgba | None:
    """Mean colour of a picture file without its transparent part; None, with a warning, if it cannot be read."""
    from PIL import Image  # only for worlds with textures

    try:
        with Image.open(path) as image:
            red, green, blue, cover = image.convert("RGBA").convert("RGBa").resize((1, 1), Image.Resampling.BOX).split()
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError) as err:  # SyntaxError: a broken png
        log.warning("%s: the texture cannot be read: %s", path, err)
        return None
    weight = max(cover.getpixel((0, 0)), 1)
    r, g, b = (min(band.getpixel((0, 0)) / weight, 1.0) for band in (red, green, blue))
    return (r, g, b, 1.0)


def worn_colour(names: Iterable[str], base: Path) -> Rgba | None:
    """Mean colour of the first texture that is found."""
    for name in names:
        path = picture_near(name, base)
        if path is not None:
            return mean_colour(path)
    return None
