"""The page holds all it needs, and nothing that a title could smuggle in."""

from __future__ import annotations

from html.parser import HTMLParser

from rosbot_patrol.campaign.charts import share_chart, spread_chart
from rosbot_patrol.campaign.page import page
from rosbot_patrol.campaign.record import Result
from rosbot_patrol.campaign.table import Share

FOUND = Result(
    number=0, seed=1, kind="standing", house="flat", room=1, title="somebody", expected="confirmed",
    verdict="confirmed", was_there=True, mails=1, home=True, place_error=0.12, share_told=0.9, share_true=0.92,
    times={"goal": 0.1, "notice": 9.0}, localisation=(0.02, 0.05), home_error=0.1,
)  # fmt: skip
MISSED = Result(
    number=1, seed=1, kind="hidden", house="flat", room=1, title="<script>alert(1)</script>", expected="confirmed",
    verdict="clear", was_there=True, home=True,
)  # fmt: skip


class Reader(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.seen: list[tuple[str, dict[str, str | None]]] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.seen.append((tag, dict(attrs)))
        if tag not in ("meta", "rect", "circle", "line", "br"):
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.seen.append((tag, dict(attrs)))

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


def test_the_page_is_whole_and_needs_no_other_file() -> None:
    text = page([FOUND, MISSED], lambda r: f"campaign --only {r.number}")
    reader = Reader()
    reader.feed(text)
    assert not reader.open
    assert not [attrs for _, attrs in reader.seen if {"src", "href"} & set(attrs)]
    assert "script" not in [tag for tag, _ in reader.seen]
    assert "campaign --only 1" in text
    assert "campaign --only 0" not in text
    assert text.count("<tr") == 3


def test_a_page_of_no_patrols_is_a_page() -> None:
    assert "A campaign of 0 patrols" in page([], lambda r: "")


def test_a_share_is_drawn_where_it_lies() -> None:
    drawn = share_chart([Share("half", 1, 2), Share("none asked", 0, 0)])
    assert 'class="dot wrong" cx="490.0"' in drawn
    assert "none asked" not in drawn
    assert 'class="dot well" cx="280.0"' in share_chart([Share("none", 0, 5)], good=0.0)


def test_what_breaks_its_bound_is_marked() -> None:
    drawn = spread_chart([("error", [0.1, 0.2, 0.5], 0.3), ("empty", [], None)], "m")
    assert drawn.count('class="mark wrong"') == 1
    assert drawn.count('class="mark well"') == 2
    assert "0.20, at most 0.50 m" in drawn
    assert "empty" not in drawn
