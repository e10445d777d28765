"""Ledger of a crash campaign: calls and kills, written to the disk before they happen, and the balance at the end.

Every call must get its verdict and every confirmed incident its one mail. Calls come one at a time, so that the records
between two calls belong to the first. The balance uses the patrol's stored records, not its messages.
"""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rosbot_patrol.campaign.crash_plan import ENDS_LIFE
from rosbot_patrol.campaign.intervals import wilson
from rosbot_patrol.campaign.plan import CLEAR
from rosbot_patrol.counts import count_of
from rosbot_patrol.files import append_line

CLOCK_SLACK = 1.0  # maximum difference between the clocks of two programs [s]


class Journal:
    """Lines of JSON, each on the disk before `add` returns. Only one program writes at a time.

    Args:
        path: of the file; a line left incomplete by a crash is skipped.
    """

    def __init__(self, path: Path) -> None:
        self.path = path

    def add(self, kind: str, **facts: Any) -> None:
        """Write a line. Raises OSError."""
        self.path.parent.mkdir(parents=True, exist_ok=True)
        append_line(self.path, json.dumps({"kind": kind, **facts}, ensure_ascii=False).encode() + b"\n")

    def read(self) -> list[dict[str, Any]]:
        """All lines so far."""
        try:
            text = self.path.read_text(encoding="utf-8")
        except FileNotFoundError:
            return []
        found = []
        for line in text.splitlines():
            try:
                found.append(dict(json.loads(line)))
            except ValueError:
                continue
        return found


@dataclass(frozen=True, kw_only=True)
class KeptRecord:
    """Fields of an incident's record that are used here; `wall` is the start of its mission, seconds since 1970."""

    id: str
    room: int
    verdict: str
    wall: float
    is_confirmed: bool


@dataclass(frozen=True, kw_only=True)
class KeptMail:
    """A mail as it arrived: its Message-ID and the incident that it names."""

    message_id: str
    incident: str


@dataclass(frozen=True)
class Books:
    """Result of a crash campaign.

    Attributes:
        kills: number by victim.
        moments: number of kills by moment.
        calls: number of triggers; answered: those with a verdict, by verdict.
        lost: sentences on those without a verdict.
        watched: calls whose mission ended in a launch with somebody in that room.
        overlooked: sentences on those of them that ended in `clear`.
        confirmed: number of incidents; mails: incidents by their number of mails.
        strangers: sentences on mails without an incident, incidents without a mail or with several.
        repeated: mails that arrived more than once with the same Message-ID.
        verified: result of the database check, "" if all is well, None if it was not run.
        waiting: notices left in the outbox at the end.
    """

    kills: Mapping[str, int]
    moments: Mapping[str, int]
    calls: int
    answered: Mapping[str, int]
    lost: Sequence[str]
    watched: int
    overlooked: Sequence[str]
    confirmed: int
    mails: Mapping[int, int]
    strangers: Sequence[str]
    repeated: int
    verified: str | None
    waiting: int

    @property
    def is_clean(self) -> bool:
        """Whether nothing was lost, overlooked, duplicated or damaged."""
        found = self.lost or self.overlooked or self.strangers or self.repeated
        return not (found or self.verified or self.waiting)

    def text(self) -> str:
        """Report for people."""
        kills = sum(self.kills.values())
        answered = sum(self.answered.values())
        low, high = wilson(answered, self.calls)
        one = self.mails.get(1, 0)
        mail_low, mail_high = wilson(one, self.confirmed)
        verdicts = ", ".join(f"{name} {count}" for name, count in sorted(self.answered.items()))
        lines = [
            f"{count_of(kills, 'kill')}: {', '.join(f'{name} {count}' for name, count in sorted(self.kills.items()))}",
            f"at these moments: {', '.join(f'{name} {count}' for name, count in sorted(self.moments.items()))}",
            f"calls with a verdict: {answered} of {self.calls} ({low:.1%} to {high:.1%}); {verdicts}",
            f"somebody in the room, and yet clear: {len(self.overlooked)} of {self.watched}",
            f"confirmed incidents with one mail: {one} of {self.confirmed} ({mail_low:.1%} to {mail_high:.1%})",
            f"mails that came twice under one Message-ID: {self.repeated}",
            f"notices left in the outbox: {self.waiting}",
            "database: " + ("not checked" if self.verified is None else self.verified or "verifies"),
        ]
        return "\n".join([*lines, *self.lost, *self.overlooked, *self.strangers])


def balance(
    journal: Iterable[Mapping[str, Any]],
    records: Sequence[KeptRecord],
    mails: Sequence[KeptMail],
    *,
    verified: str | None,
    waiting: int,
) -> Books:
    """Compare calls, records and mails.

    Args:
        journal: lines of the campaign.
        records: of the guard.
        mails: that arrived, each as often as it did.
        verified: result of the database check.
        waiting: notices in the outbox.
    """
    lines = list(journal)
    kills = [line for line in lines if line["kind"] == "kill"]
    watched = {line["call"] for line in lines if line["kind"] == "verdict" and line.get("there")}
    answers = _answers(lines, kills, records)
    confirmed = [record for record in records if record.is_confirmed]
    ids_of = _message_ids(mails)
    return Books(
        kills=Counter(str(kill["victim"]) for kill in kills),
        moments=Counter(str(kill["moment"]) for kill in kills),
        calls=len(answers),
        answered=Counter(answer.verdict for answer in answers if answer.verdict),
        lost=[f"{answer.text} no verdict" for answer in answers if not answer.verdict],
        watched=len(watched),
        overlooked=[
            f"{answer.text} clear, and somebody stood there"
            for answer in answers
            if answer.verdict == CLEAR and answer.call in watched
        ],
        confirmed=len(confirmed),
        mails=Counter(len(ids_of.get(record.id, ())) for record in confirmed),
        strangers=[*_wrong_counts(confirmed, ids_of), *_wrong_mails(records, ids_of)],
        repeated=len(mails) - len({mail.message_id for mail in mails}),
        verified=verified,
        waiting=waiting,
    )


@dataclass(frozen=True)
class _Answer:
    """Number of a call, the call in words with what was killed during it, and its verdict ("": none)."""

    call: int
    text: str
    verdict: str


def _answers(
    lines: Iterable[Mapping[str, Any]], kills: Sequence[Mapping[str, Any]], records: Sequence[KeptRecord]
) -> list[_Answer]:
    calls = [line for line in lines if line["kind"] == "call"]
    return [
        _Answer(call["call"], _call_text(call, kills), _verdict_of(call, after, records))
        for call, after in zip(calls, [*calls[1:], None], strict=True)
    ]


def _call_text(call: Mapping[str, Any], kills: Iterable[Mapping[str, Any]]) -> str:
    """A call in words, with what was killed during it."""
    hit = [f"{k['victim']} {k['moment']}+{k['delay']:.2f} s" for k in kills if k["call"] == call["call"]]
    return f"call {call['call']} of room {call['room']}, killed: {', '.join(hit) or 'none'}:"


def _message_ids(mails: Iterable[KeptMail]) -> dict[str, set[str]]:
    """Message-IDs of the mails about each incident."""
    ids_of: dict[str, set[str]] = {}
    for mail in mails:
        ids_of.setdefault(mail.incident, set()).add(mail.message_id)
    return ids_of


def _wrong_counts(confirmed: Iterable[KeptRecord], ids_of: Mapping[str, set[str]]) -> list[str]:
    """Sentences on confirmed incidents that have no mail, or several."""
    counts = [(record.id, len(ids_of.get(record.id, ()))) for record in confirmed]
    return [f"incident {name} has {count_of(count, 'mail')}" for name, count in counts if count != 1]


def _wrong_mails(records: Iterable[KeptRecord], ids_of: Mapping[str, set[str]]) -> list[str]:
    """Sentences on mails about incidents that are not on record as confirmed."""
    by_id = {record.id: record for record in records}
    sentences = []
    for name in sorted(ids_of):
        record = by_id.get(name)
        if record is None or not record.is_confirmed:
            kept = "is not kept" if record is None else f"is on record as {record.verdict or 'open'}"
            sentences.append(f"a mail tells of the incident {name}, which {kept}")
    return sentences


def _verdict_of(call: Mapping[str, Any], after: Mapping[str, Any] | None, records: Sequence[KeptRecord]) -> str:
    """Verdict of the first mission to a call's room that began after the call and before the next one."""
    until = math.inf if after is None else after["wall"]
    own = [r for r in records if r.room == call["room"] and call["wall"] - CLOCK_SLACK <= r.wall < until and r.verdict]
    return min(own, key=lambda record: record.wall).verdict if own else ""


def next_patrol(journal: Iterable[Mapping[str, Any]]) -> int:
    """Number of the patrol to continue with."""
    begun = [int(line["patrol"]) for line in journal if line["kind"] == "call"]
    return max(begun, default=-1) + 1


def open_call(journal: Sequence[Mapping[str, Any]]) -> Mapping[str, Any] | None:
    """The last call, if its outcome has not been recorded."""
    calls = [line for line in journal if line["kind"] == "call"]
    done = {line["call"] for line in journal if line["kind"] in ("verdict", "given_up")}
    return calls[-1] if calls and calls[-1]["call"] not in done else None


def is_killed(journal: Sequence[Mapping[str, Any]]) -> bool:
    """Whether the last entry is a kill after which the house starts anew."""
    return bool(journal) and journal[-1]["kind"] == "kill" and journal[-1]["victim"] in ENDS_LIFE
