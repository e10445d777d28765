"""Charts of a campaign as inline SVG: shares with their intervals, and spreads of measured values."""

from __future__ import annotations

import math
import statistics
from collections.abc import Sequence
from html import escape

from rosbot_patrol.campaign.table import Share

_LEFT, _WIDTH, _ROW = 280.0, 420.0, 30.0  # of a chart: space for the names, length of an axis, height of a line [px]
_RIGHT = 190.0


def share_chart(shares: Sequence[Share], *, good: float | None = 1.0) -> str:
    """Draw a line for each share: the interval as a bar, the share as a dot.

    Args:
        shares: those without trials are omitted; "" if none is left.
        good: target of the share; another value is drawn as a fault. None: no target.
    """
    shown = [share for share in shares if share.trials]
    if not shown:
        return ""
    height = _ROW * len(shown) + 30.0
    parts = [_axis([0.0, 0.25, 0.5, 0.75, 1.0], 1.0, height, [f"{v:.0%}" for v in (0, 0.25, 0.5, 0.75, 1)])]
    for i, share in enumerate(shown):
        y = _ROW * i + 18.0
        low, high = share.interval
        value = share.hits / share.trials
        kind = "plain" if good is None else "well" if value == good else "wrong"
        parts.append(_name(y, share.name))
        parts.append(
            f'<rect class="bar {kind}" x="{_x(low, 1.0):.1f}" y="{y - 5:.1f}" '
            f'width="{max(_x(high, 1.0) - _x(low, 1.0), 1.0):.1f}" height="10" rx="5"/>'
            f'<circle class="dot {kind}" cx="{_x(value, 1.0):.1f}" cy="{y:.1f}" r="5"/>'
            f'<text class="value" x="{_LEFT + _WIDTH + 12:.1f}" y="{y + 4:.1f}">{share.hits} of {share.trials}</text>'
        )
    return _svg(height, parts, "shares with 95 % intervals")


def spread_chart(rows: Sequence[tuple[str, Sequence[float], float | None]], unit: str) -> str:
    """Draw a line for each measure: values as dots, the median as a stroke, the bound as a dashed line.

    Args:
        rows: name, values, and the bound that they should keep or None; rows without values are left
            out, and without any there is no chart.
        unit: of all of them.
    """
    shown = [row for row in rows if row[1]]
    if not shown:
        return ""
    most = max(max(values) for _, values, _ in shown)
    most = _round_up(max([most, *(bound for *_, bound in shown if bound is not None)]))
    height = _ROW * len(shown) + 30.0
    ticks = [most * k / 4 for k in range(5)]
    parts = [_axis(ticks, most, height, [f"{tick:g}" for tick in ticks])]
    for i, (name, values, bound) in enumerate(shown):
        y = _ROW * i + 18.0
        parts.append(_name(y, name))
        for k, value in enumerate(values):
            off = ((k * 7) % 11 - 5) * 0.9  # offset, so that equal values stay visible
            kind = "wrong" if bound is not None and value > bound else "well"
            parts.append(f'<circle class="mark {kind}" cx="{_x(value, most):.1f}" cy="{y + off:.1f}" r="3"/>')
        middle = statistics.median(values)
        parts.append(_stroke("median", _x(middle, most), y))
        if bound is not None:
            parts.append(_stroke("bound", _x(bound, most), y))
        text = f"{middle:.2f}, at most {max(values):.2f} {unit}"
        parts.append(f'<text class="value" x="{_LEFT + _WIDTH + 12:.1f}" y="{y + 4:.1f}">{text}</text>')
    return _svg(height, parts, f"measures [{unit}]")


def _x(value: float, most: float) -> float:
    return _LEFT + _WIDTH * value / most


def _stroke(kind: str, x: float, y: float) -> str:
    return f'<line class="{kind}" x1="{x:.1f}" x2="{x:.1f}" y1="{y - 11:.1f}" y2="{y + 11:.1f}"/>'


def _name(y: float, name: str) -> str:
    return f'<text class="name" x="{_LEFT - 14:.1f}" y="{y + 4:.1f}">{escape(name)}</text>'


def _axis(values: Sequence[float], most: float, height: float, names: Sequence[str]) -> str:
    parts = []
    for value, name in zip(values, names, strict=True):
        x = _x(value, most)
        parts.append(f'<line class="grid" x1="{x:.1f}" x2="{x:.1f}" y1="0" y2="{height - 22:.1f}"/>')
        parts.append(f'<text class="tick" x="{x:.1f}" y="{height - 6:.1f}">{name}</text>')
    return "".join(parts)


def _svg(height: float, parts: Sequence[str], title: str) -> str:
    wide = _LEFT + _WIDTH + _RIGHT
    return (
        f'<svg viewBox="0 0 {wide:.0f} {height:.0f}" width="{wide:.0f}" height="{height:.0f}" role="img" '
        f'aria-label="{escape(title)}">{"".join(parts)}</svg>'
    )


def _round_up(value: float) -> float:
    if value <= 0.0:
        return 1.0
    step = 10.0 ** math.floor(math.log10(value)) / 2.0
    return math.ceil(value / step) * step
