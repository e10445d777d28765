"""incidents: lists, searches, shows, reports, exports, checks and removes the patrol's records.

rosrun rosbot_patrol incidents list [--room N] [--verdict V] [--since WHEN] [--text WORDS]

Options may stand before or after the command.
Needs no roscore. All but `prune` only read, also while the patrol writes.
Exit status: 0 if all is well, 1 if a check fails or something is not there, 2 if the call makes no sense.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

from rosgraph.names import get_ros_namespace

from rosbot_patrol.alerts.records.disk_errors import errors_of
from rosbot_patrol.alerts.records.incident import NO_ROOM, VERDICTS, Incident, Place, clock_text, incident_to_plain
from rosbot_patrol.alerts.records.query import Found, Query, find_incidents
from rosbot_patrol.alerts.records.retention import RetentionParams, prune
from rosbot_patrol.alerts.records.store import IncidentStore
from rosbot_patrol.alerts.records.verify import verify
from rosbot_patrol.alerts.report.export import export_incident
from rosbot_patrol.alerts.report.page import make_report
from rosbot_patrol.counts import count_of
from rosbot_patrol.errors import StoreError
from rosbot_patrol.files import write_atomic
from rosbot_patrol.ros.runtime.private_files import use_private_umask
from rosbot_patrol.ros.runtime.state_folder import state_folder

_UNITS = {"m": 60.0, "h": 3600.0, "d": 86_400.0, "w": 604_800.0}
_ALL = 1_000_000_000
_COMMANDS = ("list", "search", "show", "report", "export", "verify", "prune")
_FLAGS = ("--json", "--all", "--no-files", "-h", "--help")  # options without a value


def main(arguments: Sequence[str] | None = None) -> None:
    """Run one command."""
    if arguments is None:
        arguments = [word for word in sys.argv[1:] if not word.startswith("__")]
    given = _parser().parse_args(_command_first(list(arguments)))
    use_private_umask()
    state_dir = state_folder(given.state_dir, get_ros_namespace())
    try:
        IncidentStore(state_dir, read_only=True).close_index()  # no command makes a new one
        with IncidentStore(state_dir, wall=time.time(), read_only=given.command != "prune") as store:
            status = given.run(store, given)
    except StoreError as err:
        print(f"incidents: {err}", file=sys.stderr)
        status = 1
    except BrokenPipeError:
        sys.stderr.close()  # `| head` has seen enough
        status = 0
    sys.exit(status)


def _command_first(words: list[str]) -> list[str]:
    """Move the command to the front, because argparse accepts a command's options only after it."""
    for i, word in enumerate(words):
        before = words[i - 1] if i else ""
        is_value = before.startswith("-") and before not in _FLAGS and "=" not in before
        if word in _COMMANDS and not is_value:
            return [word, *words[:i], *words[i + 1 :]]
    return words


def _parser() -> argparse.ArgumentParser:
    shared = argparse.ArgumentParser(add_help=False)
    shared.add_argument(
        "--state-dir",
        type=Path,
        default=argparse.SUPPRESS,
        metavar="FOLDER",
        help="the patrol's (default: ~/.ros/rosbot_patrol)",
    )
    parser = argparse.ArgumentParser(prog="incidents", description="What the patrol has on record.", parents=[shared])
    parser.set_defaults(state_dir=None)
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for name, run, text in (("list", _list, "the newest incidents"), ("search", _list, "incidents with these words")):
        command = commands.add_parser(name, help=text, parents=[shared])
        if name == "search":
            command.add_argument("text", nargs="+", help="words, or how they begin")
        else:
            command.add_argument("--text", nargs="+", default=[], metavar="WORD", help="words, or how they begin")
        command.add_argument("--room", type=int, metavar="N", help="its id: somebody was there, or it called")
        command.add_argument("--verdict", choices=(*VERDICTS, "open"))
        command.add_argument("--since", type=_when, metavar="WHEN", help="2026-11-21, '2026-11-21 18:30', 12h, 7d")
        command.add_argument("--until", type=_when, metavar="WHEN")
        command.add_argument("--limit", type=_count, default=50, metavar="N", help="at most (default: %(default)s)")
        command.add_argument("--json", action="store_true", help="one JSON object a line")
        command.set_defaults(run=run)
    command = commands.add_parser("show", help="one incident", parents=[shared])
    command.add_argument("id")
    command.add_argument("--json", action="store_true")
    command.set_defaults(run=_show)
    command = commands.add_parser("report", help="write an incident's report as one HTML file", parents=[shared])
    command.add_argument("id", nargs="?")
    command.add_argument("--all", action="store_true", help="of every incident")
    command.add_argument("--out", type=Path, default=Path(), metavar="FOLDER", help="where to (default: here)")
    command.set_defaults(run=_report)
    command = commands.add_parser("export", help="write record, pictures and report into a zip file", parents=[shared])
    command.add_argument("id")
    command.add_argument("file", type=Path)
    command.set_defaults(run=_export)
    command = commands.add_parser("verify", help="check that nothing was changed or removed", parents=[shared])
    command.add_argument("--no-files", action="store_true", help="leave the pictures out")
    command.add_argument("--expect", default="", metavar="HASH", help="of a report; it has to be in the chain")
    command.set_defaults(run=_verify)
    command = commands.add_parser("prune", help="remove what is older or more than may be kept", parents=[shared])
    for field in ("keep_clear_days", "keep_days", "keep_mb", "keep_free_mb"):
        default = getattr(RetentionParams(), field)
        option = "--" + field.replace("_", "-")
        command.add_argument(option, type=float, default=default, metavar="N", help="(default: %(default)s)")
    command.set_defaults(run=_prune)
    return parser


def _when(text: str) -> float:
    """Parse a date, or an age, to seconds since 1970."""
    if text[-1:] in _UNITS and text[:-1].replace(".", "", 1).isdigit():
        return time.time() - float(text[:-1]) * _UNITS[text[-1]]
    try:
        return datetime.fromisoformat(text).timestamp()
    except ValueError:
        expected = "expected 2026-11-21, '2026-11-21 18:30', 12h or 7d"
        raise argparse.ArgumentTypeError(f"'{text}' is no time: {expected}") from None


def _count(text: str) -> int:
    if not text.isdigit() or not int(text):
        raise argparse.ArgumentTypeError(f"'{text}' is no number of incidents")
    return int(text)


def _list(store: IncidentStore, given: argparse.Namespace) -> int:
    verdict = "" if given.verdict == "open" else given.verdict
    query = Query(
        room=given.room,
        verdict=verdict,
        since=given.since,
        until=given.until,
        text=" ".join(given.text),
        limit=given.limit + 1,
    )
    found = find_incidents(store.connection, store.path, query)
    shown = [(row, _where(store, row)) for row in found[: given.limit]]
    if given.json:
        for row, person in shown:
            print(json.dumps(vars(row) | vars(person), ensure_ascii=False))
        return 0
    print(_table(shown) if shown else "no incidents")
    if len(found) > given.limit:
        print(f"(more than {given.limit}; --limit shows more)")
    return 0


@dataclass(frozen=True, kw_only=True)
class _Person:
    """Place of a person; see Incident."""

    person_room_id: int | None = None
    person_room: str = ""
    place: str = Place.CALLED.value


def _where(store: IncidentStore, row: Found) -> _Person:
    """Place of the person in a list's row, from the record."""
    try:
        kept = store.get(row.id) if row.object_class else None
    except StoreError:  # `verify` names it
        kept = None
    if kept is None:
        return _Person()
    return _Person(person_room_id=kept.person_room_id, person_room=kept.person_room, place=kept.place.value)


def _table(rows: Iterable[tuple[Found, _Person]]) -> str:
    head = ("id", "began", "room", "verdict", "seen", "reason")
    cells = [head, *(_cells(row, person) for row, person in rows)]
    widths = [max(len(row[i]) for row in cells) for i in range(len(head) - 1)]
    lines = ("  ".join([*(c.ljust(w) for c, w in zip(row, widths, strict=False)), row[-1]]) for row in cells)
    return "\n".join(line.rstrip() for line in lines)


def _cells(row: Found, person: _Person) -> tuple[str, ...]:
    share = "" if row.share is None else f"{100 * row.share:.0f} %"
    room = f"{row.room_id} {row.room_name}"
    if person.place != Place.CALLED.value:
        number = f"{person.person_room_id} " if person.person_room_id not in (None, NO_ROOM) else ""
        room = f"{number}{person.person_room}, called by {room}" if person.person_room else f"none, called by {room}"
    verdict = row.verdict or "open"
    cells = (row.id, clock_text(row.wall), room, verdict, share, row.reason)
    return tuple("".join(c if c.isprintable() else " " for c in cell) for cell in cells)  # no foreign escape codes


def _get(store: IncidentStore, incident_id: str) -> Incident:
    incident = store.get(incident_id)
    if incident is None:
        raise StoreError(
            store.folder.root, f"there is no incident '{incident_id}'; 'incidents list' shows those there are"
        )
    return incident


def _show(store: IncidentStore, given: argparse.Namespace) -> int:
    incident = _get(store, given.id)
    link = store.link(incident.id)
    if given.json:
        plain = incident_to_plain(incident) | {"hash": link.hash if link else None}
        plain["amendments"] = [{"wall": e.wall, "text": e.text} for e in store.amendments(incident.id)]
        print(json.dumps(plain, ensure_ascii=False, indent=1))
        return 0
    lines = [incident.sentence, f"began {clock_text(incident.wall)}, verdict {incident.verdict or 'open'}"]
    lines += [f"  {phase} {seconds:.1f} s" for phase, seconds in incident.durations()]
    if incident.share_seen is not None:
        lines.append(f"{100 * incident.share_seen:.0f} % of the room's floor was seen")
    if incident.person is not None:
        inside = f", in {incident.person_title}" if incident.person_room else ""
        lines.append("the person stood at x {:.2f} m, y {:.2f} m".format(*incident.person) + inside)
    for event in (*incident.events, *store.amendments(incident.id)):
        lines.append(f"  {clock_text(event.wall)[11:19]}  {event.kind:8} {event.text}")
    lines += [f"  {store.folder.path(incident.id, file.name)}  {file.caption}" for file in incident.files]
    lines.append(f"link {link.n}, SHA-256 {link.hash}" if link else "still open, not in the chain yet")
    print("\n".join("".join(c if c.isprintable() else " " for c in line) for line in lines))
    return 0


def _report(store: IncidentStore, given: argparse.Namespace) -> int:
    if bool(given.id) == given.all:
        print("incidents report: expected the id of an incident, or --all", file=sys.stderr)
        return 2
    every = [] if given.id else find_incidents(store.connection, store.path, Query(limit=_ALL))
    found = [given.id] if given.id else [row.id for row in every]
    for incident_id in found:
        path = given.out / f"{_get(store, incident_id).id}.html"
        with errors_of(path):
            write_atomic(path, make_report(store, _get(store, incident_id)).encode("utf-8"))
        print(path)
    return 0


def _export(store: IncidentStore, given: argparse.Namespace) -> int:
    with errors_of(given.file), given.file.open("wb") as target:
        export_incident(store, _get(store, given.id), target)
    print(given.file)
    return 0


def _verify(store: IncidentStore, given: argparse.Namespace) -> int:
    done = verify(store, files=not given.no_files, expect=given.expect)
    for problem in done.problems:
        print(problem)
    records, files = count_of(done.records, "record"), count_of(done.files, "file")
    counts = f"{records}, {files}, {done.removed} removed by retention, {done.open} open"
    print(f"{'all fits' if done.fits else 'DOES NOT FIT'}: {counts}; the chain ends with {done.head}")
    return 0 if done.fits else 1


def _prune(store: IncidentStore, given: argparse.Namespace) -> int:
    params = RetentionParams(
        keep_clear_days=given.keep_clear_days,
        keep_days=given.keep_days,
        keep_mb=given.keep_mb,
        keep_free_mb=given.keep_free_mb,
    )
    while True:
        done = prune(store, params, wall=time.time())
        if not done.ids:
            return 0
        print(done.sentence)
