"""Two campaigns compared: shares and measures with intervals of their differences, and patrols that went otherwise.

Intervals of differences of shares are Newcombe's (1998, method 10, of Wilson's intervals). Where both campaigns have
played the same patrols, an exact sign test (McNemar) says whether those that went otherwise did so by chance.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from string import Template

from rosbot_patrol.campaign.charts import share_chart
from rosbot_patrol.campaign.intervals import difference, sign_test
from rosbot_patrol.campaign.page import STYLE
from rosbot_patrol.campaign.record import Result
from rosbot_patrol.campaign.table import UNKNOWN, Share, measures, shares, text_table
from rosbot_patrol.counts import count_of

HEADINGS = ("share", "first", "second", "difference", "95 %", "")
MEASURES = ("measure", "first", "second", "difference", "patrols in both", "by chance")

_LESS_IS_BETTER = ("false alarms",)
_CHANCE = 0.05  # differences that chance alone makes as often are none


@dataclass(frozen=True)
class Row:
    """A share of both campaigns; `verdict` says in a word what can be told of the difference."""

    first: Share
    second: Share
    verdict: str

    @property
    def cells(self) -> tuple[str, ...]:
        """Under HEADINGS."""
        if not self.first.trials or not self.second.trials:
            return self.first.name, _of(self.first), _of(self.second), UNKNOWN, UNKNOWN, ""
        value, low, high = _differs(self.first, self.second)
        interval = f"{low:+.1%} to {high:+.1%}"
        return self.first.name, _of(self.first), _of(self.second), f"{value:+.1%}", interval, self.verdict


def compare_shares(first: Sequence[Result], second: Sequence[Result]) -> list[Row]:
    """The main shares of both."""
    by_name = {share.name: share for share in shares(second)}
    rows = []
    for share in shares(first):
        other = by_name.get(share.name, Share(share.name, 0, 0))
        rows.append(Row(share, other, _verdict(share, other)))
    return rows


def _differs(first: Share, second: Share) -> tuple[float, float, float]:
    return difference((first.hits, first.trials), (second.hits, second.trials))


def _verdict(first: Share, second: Share) -> str:
    if not first.trials or not second.trials:
        return ""
    _, low, high = _differs(first, second)
    if low <= 0.0 <= high:
        return "no difference can be told"
    is_more = low > 0.0
    is_good = is_more != any(word in first.name for word in _LESS_IS_BETTER)
    return "better" if is_good else "worse"


def _of(share: Share) -> str:
    return f"{share.hits} of {share.trials}" if share.trials else UNKNOWN


def pairs(first: Sequence[Result], second: Sequence[Result]) -> list[tuple[Result, Result]]:
    """Patrols that both have played: same number, seed, house, room and people."""

    def key(result: Result) -> tuple[object, ...]:
        return result.number, result.seed, result.house, result.room, result.kind, result.title

    known = {key(result): result for result in second}
    return [(result, known[key(result)]) for result in first if key(result) in known]


def changes(both: Sequence[tuple[Result, Result]]) -> tuple[list[tuple[Result, Result]], list[tuple[Result, Result]]]:
    """Pairs that have become right, and those that have become wrong."""
    better = [(a, b) for a, b in both if a.failures and not b.failures]
    worse = [(a, b) for a, b in both if not a.failures and b.failures]
    return better, worse


def compare_measures(
    first: Sequence[Result], second: Sequence[Result], both: Sequence[tuple[Result, Result]]
) -> list[tuple[str, ...]]:
    """Medians of both, and a sign test over the pairs; cells under MEASURES."""
    rows: list[tuple[str, ...]] = []
    seconds = {name: median for name, _, median, *_ in measures(second)}
    for name, unit, median, _, _ in measures(first):
        if name not in seconds:
            continue
        less = more = 0
        for a, b in both:
            before, after = (_measured(name, result) for result in (a, b))
            if before is not None and after is not None:
                less, more = less + (after < before), more + (after > before)
        chance = sign_test(less, more)
        told = UNKNOWN if not less + more else f"{chance:.2f}" if chance >= _CHANCE else f"{chance:.1g}, no chance"
        change = f"{seconds[name] - median:+.2f} {unit}".strip()
        rows.append((name, f"{median:.2f}", f"{seconds[name]:.2f}", change, f"{less} less, {more} more", told))
    return rows


def _measured(name: str, result: Result) -> float | None:
    found = [median for other, _, median, *_ in measures([result]) if other == name]
    return found[0] if found and math.isfinite(found[0]) else None


def comparison_text(first: Sequence[Result], second: Sequence[Result]) -> str:
    """The comparison in plain text."""
    both = pairs(first, second)
    parts = [
        text_table(HEADINGS, [row.cells for row in compare_shares(first, second)]),
        text_table(MEASURES, compare_measures(first, second, both)),
        _story(both),
    ]
    return "\n\n".join(parts)


def _story(both: Sequence[tuple[Result, Result]]) -> str:
    if not both:
        return "They have no patrol in common, so only the shares can be compared."
    better, worse = changes(both)
    lines = [
        f"{count_of(len(both), 'patrol')} in both: {len(better)} right only in the second, {len(worse)} right only in"
        f" the first; by chance alone as much or more in {sign_test(len(better), len(worse)):.0%} of all cases."
    ]
    lines += [f"+ {a.number}: {'; '.join(a.failures)} ({a.title})" for a, _ in better]
    lines += [f"- {b.number}: {'; '.join(b.failures)} ({b.title})" for _, b in worse]
    return "\n".join(lines)


_PAGE = Template("""<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>Two campaigns</title>
<meta name="viewport" content="width=device-width, initial-scale=1">
<style>$style</style></head><body>
<h1>Two campaigns</h1>
<p class="soft">$subtitle</p>
<h2>Shares</h2>$charts<div class="wide">$shares</div>
<h2>Measures, medians</h2><div class="wide">$measures</div>
<h2>Patrols that went otherwise</h2><pre>$story</pre>
<p class="soft">Bars are the intervals that hold the true share with 95 % (Wilson 1927); of a difference, Newcombe's
(1998). "By chance" is a sign test over the patrols that both have played.</p>
</body></html>
""")


def comparison_page(first: Sequence[Result], second: Sequence[Result], *, subtitle: str) -> str:
    """The comparison as one self-contained HTML page."""
    both, rows = pairs(first, second), compare_shares(first, second)
    charts = "".join(
        share_chart(
            [Share(f"{row.first.name}, first", row.first.hits, row.first.trials), _second(row)],
            good=0.0 if any(word in row.first.name for word in _LESS_IS_BETTER) else 1.0,
        )
        for row in rows
    )
    return _PAGE.substitute(
        style=STYLE,
        subtitle=escape(subtitle),
        charts=charts,
        shares=_table(HEADINGS, [row.cells for row in rows]),
        measures=_table(MEASURES, compare_measures(first, second, both)),
        story=escape(_story(both)),
    )


def _second(row: Row) -> Share:
    return Share("second", row.second.hits, row.second.trials)


def _table(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    head = "".join(f"<th>{escape(name)}</th>" for name in headings)
    body = "".join("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in rows)
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"
