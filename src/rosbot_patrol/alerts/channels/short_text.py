"""A notice in a title and some lines, for the lock screen of a phone: what and where first."""

from __future__ import annotations

from rosbot_patrol.alerts.outbox.notice import Notice
from rosbot_patrol.alerts.safe_text import one_line

_TITLE, _BODY = 120, 1500  # largest number of letters
_SAID = ("Why", "Caller", "Seen")  # facts that are told, in this order


def title_of(notice: Notice) -> str:
    """One line."""
    return one_line(notice.subject)[:_TITLE]


def body_of(notice: Notice) -> str:
    """Some lines, without places in the map, clocks and ids."""
    if notice.kind != "incident":
        return notice.text[:_BODY]
    facts = dict(notice.facts)
    lines = [f"{one_line(facts[name])[:1].upper()}{one_line(facts[name])[1:]}" for name in _SAID if facts.get(name)]
    return "\n".join(filter(None, ["\n".join(lines)[:_BODY], notice.link]))
