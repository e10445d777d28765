"""The console's icon, drawn here: a shield with an eye."""

from __future__ import annotations

import io
from functools import lru_cache

from PIL import Image, ImageDraw

SHIELD = (
    '<svg viewBox="0 0 100 100" xmlns="http://www.w3.org/2000/svg">'
    '<rect width="100" height="100" rx="18" fill="#1565c0"/>'
    '<path d="M50 16 80 26 78 55 68 73 50 86 32 73 22 55 20 26Z" fill="#fff"/>'
    '<path d="M28 48 40 37 60 37 72 48 60 59 40 59Z" fill="#1565c0"/><circle cx="50" cy="48" r="8" fill="#fff"/></svg>'
)  # the same, for a browser's tab
_BLUE, _WHITE = (21, 101, 192), (255, 255, 255)
_FINE = 4  # times larger while it is drawn, so that edges become smooth


@lru_cache
def icon(size: int) -> bytes:
    """The icon as a PNG, `size` pixels wide and high."""
    edge = size * _FINE
    image = Image.new("RGB", (edge, edge), _BLUE)
    draw = ImageDraw.Draw(image)

    def at(*places: tuple[float, float]) -> list[tuple[float, float]]:
        return [(x * edge, y * edge) for x, y in places]

    shield = at(
        (0.5, 0.16), (0.8, 0.26), (0.78, 0.55), (0.68, 0.73), (0.5, 0.86), (0.32, 0.73), (0.22, 0.55), (0.2, 0.26)
    )
    draw.polygon(shield, fill=_WHITE)
    draw.polygon(at((0.28, 0.48), (0.4, 0.37), (0.6, 0.37), (0.72, 0.48), (0.6, 0.59), (0.4, 0.59)), fill=_BLUE)
    draw.ellipse(at((0.42, 0.4), (0.58, 0.56)), fill=_WHITE)
    draw.ellipse(at((0.46, 0.44), (0.54, 0.52)), fill=_BLUE)
    written = io.BytesIO()
    image.resize((size, size), Image.Resampling.LANCZOS).save(written, "PNG")
    return written.getvalue()
