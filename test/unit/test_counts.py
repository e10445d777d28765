"""Counted things in sentences."""

from __future__ import annotations

import pytest

from rosbot_patrol.counts import count_of


@pytest.mark.parametrize(
    ("count", "text"),
    [(0, "0 records"), (1, "1 record"), (2, "2 records"), (-1, "-1 records"), (12345, "12345 records")],
)
def test_a_noun_is_plural_but_after_one(count: int, text: str) -> None:
    assert count_of(count, "record") == text


def test_nouns_and_verbs_that_need_more_than_an_s() -> None:
    assert count_of(1, "body", "bodies") == "1 body"
    assert count_of(2, "body", "bodies") == "2 bodies"
    assert count_of(0, "notice waits", "notices wait", none="no") == "no notices wait"
