"""Results of a campaign as tables, in text and in markdown, and as figures with intervals."""

from __future__ import annotations

import math
import statistics
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

from rosbot_patrol.campaign.intervals import wilson
from rosbot_patrol.campaign.plan import CLEAR, CONFIRMED
from rosbot_patrol.campaign.record import Result

UNKNOWN = "-"
TIMES = ("goal", "arrived", "seen_to_notice", "notice", "mail", "looked", "home")


@dataclass(frozen=True)
class Share:
    """A number of hits among a number of trials."""

    name: str
    hits: int
    trials: int

    @property
    def interval(self) -> tuple[float, float]:
        """Interval that holds the true share with 95 %."""
        return wilson(self.hits, self.trials)

    def __str__(self) -> str:
        if not self.trials:
            return UNKNOWN
        low, high = self.interval
        return f"{self.hits} of {self.trials} ({low:.1%} to {high:.1%})"


def shares(results: Sequence[Result]) -> list[Share]:
    """The campaign's main shares."""
    there = [r for r in results if r.was_there and not r.mishap]
    broken = [r for r in results if r.mishap]
    also = [Share("as it should be though something broke", sum(not r.failures for r in broken), len(broken))]
    nobody = [r for r in results if not r.was_there and not r.problem]
    played = [r for r in results if not r.problem]
    placed = [r for r in results if r.verdict == CONFIRMED and r.place_error is not None]
    return [
        Share("detected, of those who were there", sum(bool(r.detected) for r in there), len(there)),
        Share("false alarms, where nobody was", sum(r.false_alarm for r in nobody), len(nobody)),
        Share("told within a metre of somebody", sum(not r.is_elsewhere for r in placed), len(placed)),
        Share("a verdict", sum(bool(r.verdict) for r in results), len(results)),
        Share("home again", sum(r.home is True for r in played), sum(r.home is not None for r in played)),
        Share("without touching anything", sum(not r.contacts for r in played), len(played)),
        Share(
            "one mail a person, where confirmed",
            sum(r.has_its_mails for r in played if r.verdict == CONFIRMED),
            sum(r.verdict == CONFIRMED for r in played),
        ),
        *(also if broken else []),
    ]


def by_kind(results: Sequence[Result]) -> list[tuple[str, list[Share]]]:
    """Detections and false alarms of each kind."""
    kinds = sorted({r.kind for r in results})
    return [(kind, shares([r for r in results if r.kind == kind])[:2]) for kind in kinds]


def measures(results: Sequence[Result]) -> list[tuple[str, str, float, float, int]]:
    """Measured values: name, unit, median, largest, count."""
    asked: list[tuple[str, str, Callable[[Result], float | None]]] = [
        ("place of the person, error", "m", lambda r: r.place_error),
        ("share of the floor, told less true", "", _share_error),
        ("localisation, mean error of a patrol", "m", lambda r: r.localisation[0] if r.localisation else None),
        ("localisation, largest error of a patrol", "m", lambda r: r.localisation[1] if r.localisation else None),
        ("home, off the start", "m", lambda r: r.home_error if r.home is not None else None),
    ]
    asked += [(f"time: {_TOLD[name]}", "s", _time_of(name)) for name in TIMES]
    found = []
    for name, unit, ask in asked:
        values = [abs(value) for r in results if (value := ask(r)) is not None]
        if values:
            found.append((name, unit, statistics.median(values), max(values), len(values)))
    return found


def _time_of(name: str) -> Callable[[Result], float | None]:
    return lambda result: result.times.get(name)


_TOLD = {
    "goal": "trigger to goal",
    "arrived": "trigger to arrival",
    "seen_to_notice": "in view to notice on disk",
    "notice": "trigger to notice on disk",
    "mail": "trigger to mail",
    "looked": "trigger to the end of the look around",
    "home": "trigger to home",
}


def _share_error(result: Result) -> float | None:
    if result.share_told is None or result.share_true is None:
        return None
    return result.share_told - result.share_true


HEADINGS = (
    "no.", "kind", "house", "room", "there", "in view [s]", "verdict", "place off [m]", "seen [%]", "true [%]",
    "goal [s]", "notice [s]", "home [s]", "loc. max [m]", "touched", "mails", "broke", "",
)  # fmt: skip


def row(result: Result) -> tuple[str, ...]:
    """Cells of a patrol under HEADINGS."""
    localisation = result.localisation[1] if result.localisation else None
    return (
        str(result.number),
        result.kind,
        result.house,
        str(result.room),
        "yes" if result.was_there else "no",
        f"{result.in_view:.1f}",
        result.verdict or UNKNOWN,
        _cell(result.place_error),
        _percent(result.share_told),
        _percent(result.share_true),
        _cell(result.times.get("goal")),
        _cell(result.times.get("notice"), 1),
        _cell(result.times.get("home"), 0),
        _cell(localisation),
        str(len(result.contacts)),
        str(result.mails),
        result.mishap,
        "; ".join(result.failures),
    )


def _cell(value: float | None, digits: int = 2) -> str:
    return UNKNOWN if value is None else f"{value:.{digits}f}"


def _percent(value: float | None) -> str:
    return UNKNOWN if value is None else f"{100.0 * value:.0f}"


def text_table(headings: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Text table with columns of the needed width."""
    lines = [tuple(headings), *(tuple(r) for r in rows)]
    widths = [max(len(line[i]) for line in lines) for i in range(len(headings))]
    return "\n".join(
        "  ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)).rstrip() for line in lines
    )


def markdown_table(headings: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Markdown table."""
    lines = [f"| {' | '.join(headings)} |", "|" + "---|" * len(headings)]
    lines += [f"| {' | '.join(cell.replace('|', '/') for cell in r)} |" for r in rows]
    return "\n".join(lines)


def summary(results: Sequence[Result]) -> str:
    """Counts and measures in plain text."""
    lines = [f"{share.name}: {share}" for share in shares(results)]
    lines += [
        f"{name}: median {median:.2f} {unit}, largest {largest:.2f} {unit} ({count})".replace(" ,", ",")
        for name, unit, median, largest, count in measures(results)
    ]
    return "\n".join(lines)


def figures(results: Sequence[Result]) -> dict[str, float]:
    """Figures of a campaign by name, for a benchmark."""
    detected, alarms, placed, _, home, _, _, *survived = shares(results)
    named = {
        "detection_rate": detected.hits / detected.trials if detected.trials else 0.0,
        "false_alarms": float(alarms.hits),
        "told_elsewhere": float(placed.trials - placed.hits),
        "contacts": float(sum(len(r.contacts) for r in results)),
        "home_rate": home.hits / home.trials if home.trials else 0.0,
        "patrols": float(len(results)),
    }
    errors = [r.place_error for r in results if r.place_error is not None]
    if errors:
        named["place_median"] = statistics.median(errors)
        named["place_95"] = sorted(errors)[math.ceil(0.95 * len(errors)) - 1]
    named["clear_with_somebody"] = float(sum(r.was_there and r.verdict == CLEAR for r in results))
    mailed = [r.has_its_mails for r in results if r.verdict == CONFIRMED and not r.problem]
    named["one_mail_rate"] = sum(mailed) / len(mailed) if mailed else 0.0
    for share in survived:
        named["survived_rate"] = share.hits / share.trials
    if times := [r.times["notice"] for r in results if "notice" in r.times]:
        named["trigger_to_notice_s"] = statistics.median(times)
    return named
