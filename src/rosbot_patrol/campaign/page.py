"""Results of a campaign as one self-contained HTML page."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from html import escape
from string import Template

from rosbot_patrol.campaign.charts import share_chart, spread_chart
from rosbot_patrol.campaign.record import Result
from rosbot_patrol.campaign.table import HEADINGS, Share, by_kind, row, shares
from rosbot_patrol.counts import count_of

PLACE_AIM, SHARE_AIM = 0.3, 0.05  # targets of the position [m] and of the share
_WHEN = {
    "goal": "trigger to goal",
    "seen_to_notice": "in view to notice",
    "notice": "trigger to notice",
    "arrived": "trigger to arrival",
    "looked": "trigger to the look's end",
    "home": "trigger to home",
}

STYLE = """
:root { color-scheme: light dark; --ink: #1d2430; --soft: #5d6675; --line: #d9dde4; --paper: #fff; --card: #f5f6f8;
  --well: #23715b; --wrong: #b3372b; }
@media (prefers-color-scheme: dark) { :root { --ink: #e6e9ee; --soft: #9aa4b2; --line: #343b46; --paper: #14181e;
  --card: #1c222b; --well: #58b898; --wrong: #e8776c; } }
body { font: 15px/1.5 system-ui, sans-serif; color: var(--ink); background: var(--paper); margin: 0 auto;
  max-width: 1320px; padding: 28px 24px 60px; }
h1 { font-size: 26px; margin: 0 0 4px; } h2 { font-size: 18px; margin: 36px 0 10px; }
p { margin: 4px 0; } .soft { color: var(--soft); }
.tiles { display: flex; flex-wrap: wrap; gap: 12px; margin-top: 18px; }
.tile { background: var(--card); border-radius: 8px; padding: 12px 18px; min-width: 150px; }
.tile b { display: block; font-size: 24px; font-variant-numeric: tabular-nums; } .tile.wrong b { color: var(--wrong); }
.tile.well b { color: var(--well); }
.wide { overflow-x: auto; }
table { border-collapse: collapse; font-size: 13px; font-variant-numeric: tabular-nums; width: 100%; }
th, td { text-align: left; padding: 4px 8px; border-bottom: 1px solid var(--line); white-space: nowrap; }
th { color: var(--soft); font-weight: 600; } tr.wrong td { color: var(--wrong); }
pre { background: var(--card); border-radius: 8px; padding: 12px 16px; overflow-x: auto; font-size: 13px; }
svg { max-width: 100%; height: auto; }
svg text { font: 13px system-ui, sans-serif; fill: var(--ink); } svg .name { text-anchor: end; }
svg .tick { text-anchor: middle; fill: var(--soft); font-size: 12px; } svg .grid { stroke: var(--line); }
svg .bar { opacity: 0.3; } svg .well { fill: var(--well); } svg .wrong { fill: var(--wrong); }
svg .plain { fill: var(--soft); } svg .mark { opacity: 0.55; } svg .value { fill: var(--soft); }
svg .median { stroke: var(--ink); stroke-width: 2; }
svg .bound { stroke: var(--wrong); stroke-width: 1.5; stroke-dasharray: 3 3; }
"""

_PAGE = Template("""<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>$title</title>
<meta name="viewport" content="width=device-width, initial-scale=1">
<style>$style</style></head><body>
<h1>$title</h1>
<p class="soft">$subtitle</p>
<div class="tiles">$tiles</div>
<h2>All together</h2>$all
<h2>Found, by kind of patrol</h2>$kinds
<h2>How well [m]</h2>$places
<h2>How soon, in simulated seconds</h2>$times
<h2>What it costs to look</h2>$costs
<h2>Not as they should be</h2>$failures
<h2>Every patrol</h2><div class="wide"><table><thead><tr>$headings</tr></thead><tbody>$rows</tbody></table></div>
<p class="soft">Bars are the intervals that hold the true share with 95 % (Wilson 1927), dots the shares; each small
dot is a patrol, the stroke the median, the dashed stroke the aim. "-": not known.</p>
</body></html>
""")


def page(results: Sequence[Result], command: Callable[[Result], str], *, subtitle: str = "") -> str:
    """Make the page.

    Args:
        results: of the campaign.
        command: command that repeats a patrol.
        subtitle: a line under the title, such as the commit and the machine.
    """
    counted = shares(results)
    failed = [result for result in results if result.failures]
    return _PAGE.substitute(
        style=STYLE,
        title=f"A campaign of {count_of(len(results), 'patrol')}",
        subtitle=escape(subtitle),
        tiles="".join(_tiles(results, counted)),
        all=share_chart([counted[0], *counted[2:]]) + share_chart([counted[1]], good=0.0),
        kinds=_kinds(results),
        places=_places(results),
        times=_times(results),
        costs=_costs(results),
        failures=_failures(failed, command),
        headings="".join(f"<th>{escape(name)}</th>" for name in HEADINGS),
        rows="".join(_row(result) for result in results),
    )


def _tiles(results: Sequence[Result], counted: Sequence[Share]) -> list[str]:
    found, alarms = counted[0], counted[1]
    touches = sum(len(result.touches or set(result.contacts)) for result in results)
    verdicts, home = counted[3:5]
    return [
        _tile(f"{found.trials - found.hits}", "missed", well=found.hits == found.trials),
        _tile(f"{alarms.hits}", "false alarms", well=not alarms.hits),
        _tile(f"{touches}", "touches", well=not touches),
        _tile(f"{home.hits} of {home.trials}", "home again", well=home.hits == home.trials),
        _tile(f"{verdicts.hits} of {verdicts.trials}", "verdicts", well=verdicts.hits == verdicts.trials),
    ]


def _tile(value: str, name: str, *, well: bool) -> str:
    return f'<div class="tile {"well" if well else "wrong"}"><b>{value}</b>{name}</div>'


def _kinds(results: Sequence[Result]) -> str:
    by = by_kind(results)
    found = [Share(kind, detected.hits, detected.trials) for kind, (detected, _) in by]
    quiet = [Share(f"{kind}: false alarms", alarms.hits, alarms.trials) for kind, (_, alarms) in by if alarms.trials]
    return share_chart(found) + share_chart(quiet, good=0.0)


def _places(results: Sequence[Result]) -> str:
    rows: list[tuple[str, list[float], float | None]] = [
        ("place of the person, error", _known(results, lambda r: r.place_error), PLACE_AIM),
        ("localisation, mean error", _known(results, lambda r: r.localisation[0] if r.localisation else None), None),
        ("localisation, largest error", _known(results, lambda r: r.localisation[1] if r.localisation else None), None),
        ("home, off the start", _known(results, lambda r: r.home_error if r.home is not None else None), None),
    ]
    shares_off = _known(results, _share_off)
    beside = spread_chart([("share of the floor: told less true", shares_off, SHARE_AIM)], "") if shares_off else ""
    return spread_chart(rows, "m") + beside


def _share_off(result: Result) -> float | None:
    if result.share_told is None or result.share_true is None:
        return None
    return abs(result.share_told - result.share_true)


def _times(results: Sequence[Result]) -> str:
    quick, slow = ([(_WHEN[name], _seconds(results, name), None) for name in names] for names in (_QUICK, _SLOW))
    return spread_chart(quick, "s") + spread_chart(slow, "s")


def _seconds(results: Sequence[Result], name: str) -> list[float]:
    """Times of that name, of the patrols that have one [s]."""
    return _known(results, lambda result: result.times.get(name))


def _costs(results: Sequence[Result]) -> str:
    """Way and time to the look, what the first viewpoint showed, how many there were, and what stayed unseen."""
    looked = [result for result in results if result.viewpoints]
    seconds_a_metre = [
        result.times["arrived"] / result.way for result in results if result.way and "arrived" in result.times
    ]
    ways: list[tuple[str, list[float], float | None]] = [
        ("way to the room [m]", _known(results, lambda r: r.way), None),
        ("seconds a metre of it, to the look", seconds_a_metre, None),
        ("viewpoints", [float(result.viewpoints) for result in looked], None),
    ]
    parts: list[tuple[str, list[float], float | None]] = [
        ("floor seen from the first viewpoint", _known(looked, lambda r: r.share_first), None),
        ("floor seen at the end", _known(looked, lambda r: r.share_true), None),
        ("never seen: no place shows it", [r.unseen["hidden"] for r in looked if r.unseen], None),
        ("never seen: passed over", [r.unseen["passed over"] for r in looked if r.unseen], None),
    ]
    return spread_chart(ways, "") + spread_chart(parts, "") or "<p>No patrol has looked at a room.</p>"


_QUICK, _SLOW = ("goal", "seen_to_notice"), ("notice", "arrived", "looked", "home")


def _known(results: Sequence[Result], ask: Callable[[Result], float | None]) -> list[float]:
    return [value for result in results if (value := ask(result)) is not None]


def _failures(failed: Sequence[Result], command: Callable[[Result], str]) -> str:
    if not failed:
        return "<p>Nothing: everything was as it should be.</p>"
    lines = [
        f"{result.number}: {'; '.join(result.failures)}\n    {result.title}\n    {command(result)}" for result in failed
    ]
    return f"<pre>{escape(chr(10).join(lines))}</pre>"


def _row(result: Result) -> str:
    kind = ' class="wrong"' if result.failures else ""
    return f"<tr{kind}>" + "".join(f"<td>{escape(cell)}</td>" for cell in row(result)) + "</tr>"
