"""When a web server wants to be asked again: the `Retry-After` of its answer (RFC 9110, 10.2.3).

Differs from the RFC: fractions of a second count, as some services send them, and so do negative numbers (at once).
"""

from __future__ import annotations

import re
from datetime import UTC
from email.utils import parsedate_to_datetime

_SECONDS = re.compile(r"[+-]?(?:\d+(?:\.\d*)?|\.\d+)", re.ASCII)


def parse_retry_after(text: str, now: float) -> float | None:
    """Pause that is asked for [s], 0 for a date in the past; None if nothing is asked for.

    Args:
        text: the header's value: seconds, or one of the three dates of HTTP.
        now: seconds since 1970.

    Raises:
        ValueError: it is neither.
    """
    text = text.strip()
    if not text:
        return None
    if _SECONDS.fullmatch(text):
        return max(float(text), 0.0)
    return max(_date(text) - now, 0.0)


def _date(text: str) -> float:
    try:
        found = parsedate_to_datetime(text.replace(":60 ", ":59 "))  # a leap second
        if found.tzinfo is None:  # asctime's form, or -0000; HTTP's dates are in UTC
            found = found.replace(tzinfo=UTC)
        seconds = found.timestamp()
    except (ValueError, TypeError, IndexError, OverflowError) as err:
        raise ValueError(f"neither seconds nor a date: {text[:60]!r}") from err
    return seconds
