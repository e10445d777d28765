"""Counted things in sentences: "1 record", "2 records"."""

from __future__ import annotations


def count_of(count: int, one: str, many: str = "", *, none: str = "0") -> str:
    """A number and its noun, singular after 1.

    Args:
        count: how many.
        one: the noun after 1; several words may follow it ("notice waits").
        many: the noun after any other number; by default `one` with an s.
        none: what stands for 0.
    """
    return f"{count or none} {one if count == 1 else many or one + 's'}"
