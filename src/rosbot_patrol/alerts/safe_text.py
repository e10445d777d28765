"""Text that may stand in a header, a file name or one line of a log, whatever it was made of."""

from __future__ import annotations

import re


def token(text: str) -> str:
    """The text with an underscore for each character that a header or a file name may not hold; never empty."""
    return re.sub(r"[^A-Za-z0-9.+-]", "_", text).strip(".") or "none"


def one_line(text: str) -> str:
    """The text without line breaks and control characters."""
    return " ".join("".join(c if c.isprintable() else " " for c in text).split())
