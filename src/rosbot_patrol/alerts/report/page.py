"""An incident as one HTML file that needs nothing else: for a phone, a desk, paper.

Everything that came from outside is escaped, pictures are inside as base64, and there is no script.

The report of an incident that is in the store.
"""

from __future__ import annotations

import base64
import io
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from html import escape
from pathlib import Path

from PIL import Image

from rosbot_patrol.alerts.records.chain import Link
from rosbot_patrol.alerts.records.files import REPORT, NewFile
from rosbot_patrol.alerts.records.incident import Event, Incident, Place, StoredFile, clock_text
from rosbot_patrol.alerts.records.store import IncidentStore
from rosbot_patrol.alerts.report.style import STYLE
from rosbot_patrol.counts import count_of
from rosbot_patrol.errors import StoreError

_THUMB = (208, 156)  # [px]
_MAX_LARGE = 4  # pictures in full size
_POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'"
_ORIGINS = {"trigger": "a motion sensor called", "silent_sensor": "a motion sensor has gone silent"}


@dataclass(frozen=True, kw_only=True)
class Evidence:
    """What a report is made of besides the record.

    Attributes:
        read: gives a file's bytes by its name, None if it cannot be read.
        link: of the chain, None while the record is open.
        amendments: later additions.
    """

    read: Callable[[str], bytes | None]
    link: Link | None = None
    amendments: Sequence[Event] = field(default_factory=tuple)


def render_report(incident: Incident, evidence: Evidence) -> str:
    """The report as HTML."""
    title = f"{incident.verdict or 'running'}: {incident.where}"
    parts = [
        _head(incident),
        _facts(incident),
        _large(incident, evidence),
        _map(incident, evidence),
        _strip(incident, evidence),
        _events(incident, evidence.amendments),
        _hashes(incident, evidence.link),
    ]
    return f"""<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">
<meta http-equiv="Content-Security-Policy" content="{_POLICY}">
<title>{_text(title)}</title><style>{STYLE}</style></head><body>
{"".join(part + chr(10) for part in parts if part)}</body></html>
"""


def _text(value: object) -> str:
    """A value as HTML, without control characters."""
    return escape("".join(c if c.isprintable() else " " if c.isspace() else "\ufffd" for c in str(value)))


def _clock(wall: float) -> str:
    return _text(clock_text(wall).split(" ")[1])


def _head(incident: Incident) -> str:
    kind = incident.verdict if incident.verdict in ("confirmed", "clear", "unreachable", "unverified") else "running"
    return f"""<header class="{kind}"><p class="verdict {kind}">{_text(incident.verdict or "still running")}</p>
<h1>{_text(incident.where[:1].upper() + incident.where[1:])}</h1><p>{_text(incident.reason or incident.sentence)}</p>
<p class="faint">{_text(clock_text(incident.confirmed or incident.wall))}</p></header>"""


def _facts(incident: Incident) -> str:
    origin = _ORIGINS.get(incident.origin, incident.origin)
    calls = f", {incident.triggers} times" if incident.triggers > 1 else ""
    rows = [("Called by", f"{origin}{calls}"), ("Began", clock_text(incident.wall))]
    if incident.place is not Place.CALLED:
        rows.insert(1, ("Sent to", incident.room[0].upper() + incident.room[1:]))
    if incident.object_class:
        rows.append(
            (
                "Seen",
                f"{incident.object_class}, probability {incident.probability:.2f} over "
                f"{count_of(incident.pictures, 'picture')}",
            )
        )
    if incident.confirmed is not None:
        rows.append(
            (
                "First seen",
                f"{clock_text(incident.confirmed)}, {incident.confirmed - incident.wall:.1f} s after the mission began",
            )
        )
    if incident.person is not None:
        room = f", in {incident.person_title}" if incident.person_room else ""
        rows.append(("Person at", f"x {incident.person[0]:.2f} m, y {incident.person[1]:.2f} m in the map{room}"))
    if incident.pose is not None:
        rows.append(("Robot at", "x {:.2f} m, y {:.2f} m, heading {:.2f} rad".format(*incident.pose)))
    if incident.share_seen is not None:
        rows.append(("Floor seen", f"{100 * incident.share_seen:.0f} % of the room's"))
    table = "".join(f"<tr><th>{_text(name)}</th><td>{_text(value)}</td></tr>" for name, value in rows)
    return f"<table>{table}</table>{_phases(incident)}"


def _phases(incident: Incident) -> str:
    spans = [(phase, seconds) for phase, seconds in incident.durations() if seconds > 0.0]
    if not spans:
        return ""
    known = ("waiting", "starting", "driving", "looking", "returning", "stopped")
    bars = "".join(
        f'<span class="{phase if phase in known else "other"}" style="flex:{max(seconds, 0.5):.1f} 1 0"'
        f' title="{_text(phase)} {seconds:.1f} s">{_text(phase)} {seconds:.0f} s</span>'
        for phase, seconds in spans
    )
    return f'<div class="phases">{bars}</div>'


def _large(incident: Incident, evidence: Evidence) -> str:
    order = {"detection": 0, "best": 1, "look": 2}
    files = sorted((f for f in incident.files if f.role in order), key=lambda f: order[f.role])
    if any(f.role != "look" for f in files):
        files = [f for f in files if f.role != "look"]
    figures = []
    for file in files[:_MAX_LARGE]:
        data = evidence.read(file.name)
        if data is not None and _is_picture(data):
            figures.append(_figure(_uri(data), file.caption or file.name))
        else:
            figures.append(f"<p>{_text(file.name)} cannot be shown: it is missing or no picture.</p>")
    return f'<h2>Pictures</h2><div class="best">{"".join(figures)}</div>' if figures else ""


def _map(incident: Incident, evidence: Evidence) -> str:
    for file in incident.files:
        data = evidence.read(file.name) if file.role == "map" else None
        if data is not None and _is_picture(data):
            return f"<h2>Map</h2>{_figure(_uri(data), file.caption)}"
    return ""


def _strip(incident: Incident, evidence: Evidence) -> str:
    shown = [f for f in incident.files if f.role in ("before", "after", "look")]
    shown.sort(key=lambda f: f.stamp or 0.0)
    if not shown:
        return ""
    zero = next((f.stamp for f in incident.files if f.role == "detection" and f.stamp is not None), None)
    figures = "".join(_thumb(file, evidence, zero) for file in shown)
    title = "Before and after" if any(f.role != "look" for f in shown) else "The look around"
    return f'<h2>{title}</h2><div class="strip">{figures}</div>'


def _thumb(file: StoredFile, evidence: Evidence, zero: float | None) -> str:
    data = evidence.read(file.name)
    small = _small(data) if data is not None else None
    if small is None:
        return f"<figure><figcaption>{_text(file.name)} cannot be shown</figcaption></figure>"
    when = f"{file.stamp - zero:+.1f} s" if zero is not None and file.stamp is not None else file.caption
    after = ' class="after"' if file.role == "after" else ""
    return f'<figure{after}><img alt="" src="{_uri(small)}"><figcaption>{_text(when)}</figcaption></figure>'


def _events(incident: Incident, amendments: Iterable[Event]) -> str:
    events = sorted(incident.events, key=lambda e: e.wall)
    rows = "".join(
        f'<tr><td class="time">{_clock(e.wall)}</td><td>{_text(e.kind)}</td><td>{_text(e.text)}</td></tr>'
        for e in (*events, *amendments)
    )
    return f"<h2>What happened</h2><table>{rows}</table>" if rows else ""


def _hashes(incident: Incident, link: Link | None) -> str:
    if link is None:
        chained = "The record is still open: it is not in the chain yet."
    else:
        own, previous = _text(link.hash), _text(link.previous)
        chained = f"Record {link.n} of the chain, SHA-256 <code>{own}</code>, after <code>{previous}</code>."
    rows = ((_text(f.name), f.size, _text(f.sha256)) for f in incident.files)
    files = "".join(f"<tr><td>{name}</td><td>{size}</td><td><code>{sha}</code></td></tr>" for name, size, sha in rows)
    count = count_of(len(incident.files), "file")
    table = f"<details><summary>{count}</summary><table>{files}</table></details>" if files else ""
    check = "<code>rosrun rosbot_patrol incidents verify</code> checks all of it."
    return f"""<h2>Proof</h2><p class="faint">{chained}</p>{table}
<footer><p>Incident {_text(incident.id)}. {check}</p></footer>"""


def _figure(uri: str, caption: str) -> str:
    return f'<figure><img alt="{_text(caption)}" src="{uri}"><figcaption>{_text(caption)}</figcaption></figure>'


def _uri(data: bytes) -> str:
    kind = "png" if data.startswith(b"\x89PNG") else "jpeg"
    return f"data:image/{kind};base64,{base64.b64encode(data).decode('ascii')}"


def _is_picture(data: bytes) -> bool:
    return data.startswith((b"\xff\xd8", b"\x89PNG"))


def _small(data: bytes) -> bytes | None:
    try:
        image = Image.open(io.BytesIO(data))
        image.draft("RGB", _THUMB)
        image = image.convert("RGB")
        image.thumbnail(_THUMB)
    except (OSError, SyntaxError, ValueError, Image.DecompressionBombError):
        return None
    out = io.BytesIO()
    image.save(out, "JPEG", quality=70)
    return out.getvalue()


def make_report(store: IncidentStore, incident: Incident) -> str:
    """An incident's report as HTML. Raises StoreError."""

    def read(name: str) -> bytes | None:
        try:
            return store.folder.read(incident.id, name)
        except StoreError:
            return None  # the report says so

    evidence = Evidence(read=read, link=store.link(incident.id), amendments=store.amendments(incident.id))
    return render_report(incident, evidence)


def write_report(store: IncidentStore, incident: Incident) -> Path:
    """Write an incident's report into its folder; returns its path. Raises StoreError."""
    html = make_report(store, incident)
    store.folder.write(incident.id, [NewFile(name=REPORT, role="other", data=html.encode("utf-8"))])
    return store.folder.path(incident.id, REPORT)
