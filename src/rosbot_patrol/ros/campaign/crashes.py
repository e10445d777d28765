"""Crash campaign: successive lives of a house on one state folder, and the balance at the end."""

from __future__ import annotations

import json
import logging
import sys
import time
from collections.abc import Iterator
from pathlib import Path

from rosbot_patrol.alerts.records.incident import Incident
from rosbot_patrol.alerts.records.store import IncidentStore, has_incidents
from rosbot_patrol.alerts.records.verify import verify
from rosbot_patrol.campaign.crash_ledger import Books, Journal, KeptRecord, balance, is_killed, next_patrol
from rosbot_patrol.campaign.crash_plan import plan_crashes
from rosbot_patrol.campaign.plan import CONFIRMED
from rosbot_patrol.campaign.progress import progress_line
from rosbot_patrol.campaign.record import CampaignFolder, Settings
from rosbot_patrol.files import write_atomic
from rosbot_patrol.ros.campaign.crash import JOURNAL, waiting
from rosbot_patrol.ros.campaign.mail_sink import kept_mails
from rosbot_patrol.ros.campaign.runner import Job, Runner, own_space

LIFE = 1200.0  # longest life [s]
_FRUITLESS = 3  # successive lives without a kill before giving up

log = logging.getLogger(__name__)


class CrashCampaign:
    """A crash campaign in a folder.

    Args:
        folder: folder of the campaign.
        seed: seed of the campaign.
        kills: number of kills.
        wrap: command that wraps each life.
    """

    def __init__(self, folder: Path, seed: int, kills: int, wrap: list[str]) -> None:
        self.folder = CampaignFolder(folder.resolve(), Settings(seed=seed, houses=(), kind="crash")).folder
        self._seed, self._kills, self._wrap = seed, kills, wrap
        self._patrols = len(plan_crashes(seed, kills))
        self._journal = Journal(self.folder / JOURNAL)
        self._began, self._begun_with = time.monotonic(), self._killed()
        self._fruitless = 0

    def run(self) -> int:
        """Continue to the end; returns the exit status."""
        prefix = own_space()
        runner = Runner(1, prefix, self._wrap, self._done)
        self._tell()
        try:
            runner.run(self._lives(bool(prefix)))
        except KeyboardInterrupt:
            runner.stop()
            print(f"\nstopped; run the same again to go on in {self.folder}")
            return 130
        books = self.books()
        text = books.text()
        write_atomic(self.folder / "books.txt", f"{text}\n".encode())
        write_atomic(self.folder / "books.json", summary_json(books).encode())
        print(f"\n{text}")
        return 0 if books.is_clean else 1

    def books(self) -> Books:
        """Balance so far."""
        state = self.folder / "state"
        mails = kept_mails((self.folder / "mail" / "new", self.folder / "smtp"))
        return balance(
            self._journal.read(), kept_records(state), mails, verified=_verified(state), waiting=waiting(state)
        )

    def _lives(self, space: bool) -> Iterator[Job]:
        """Run lives until every patrol has been requested, and one more if the last one was killed."""
        while True:
            lines = self._journal.read()
            if next_patrol(lines) >= self._patrols and not is_killed(lines):
                return
            if self._fruitless >= _FRUITLESS:
                log.error("%d lives came to nothing, see %s", _FRUITLESS, self.folder / "roslaunch.log")
                return
            command = [sys.executable, sys.argv[0], str(self.folder), "--life", "--seed", str(self._seed)]
            command += ["--crash", str(self._kills)] + ["--space"] * space
            yield Job(f"life {sum(line['kind'] == 'life' for line in lines)}", command, self.folder / "lives.log", LIFE)

    def _killed(self) -> int:
        return sum(line["kind"] in ("kill", "missing") for line in self._journal.read())

    def _done(self, job: Job, problem: str) -> None:
        before = getattr(self, "_last", self._begun_with)
        self._last = self._killed()
        self._fruitless = self._fruitless + 1 if self._last == before else 0
        if problem:
            print(f"{job.name}: {problem}")
        self._tell()

    def _tell(self) -> None:
        done = self._killed()
        lost = sum(line["kind"] == "given_up" for line in self._journal.read())
        elapsed = time.monotonic() - self._began
        print(progress_line(done, self._kills, done - self._begun_with, elapsed, failed=lost), flush=True)


def kept_records(state_dir: Path) -> list[KeptRecord]:
    """The guard's records of its missions. Raises StoreError."""
    incidents: list[Incident | None] = []
    if has_incidents(state_dir):
        with IncidentStore(state_dir, read_only=True) as store:
            ids = [row["id"] for row in store.connection.execute("SELECT id FROM incidents ORDER BY seq")]
            incidents = [store.get(name) for name in ids]
    return [
        KeptRecord(
            id=found.id,
            room=found.room_id,
            verdict=found.verdict,
            wall=found.wall,
            is_confirmed=found.verdict == CONFIRMED,
        )
        for found in incidents
        if found is not None
    ]


def _verified(state_dir: Path) -> str | None:
    """Result of the check of the incidents, "" if all is well; None if there is nothing to check."""
    if not has_incidents(state_dir):
        return None
    with IncidentStore(state_dir, read_only=True) as store:
        found = verify(store)
    return "" if found.fits else "; ".join(found.problems)


def summary_json(books: Books) -> str:
    """Balance for a program."""
    return json.dumps(
        {
            "kills": dict(books.kills),
            "calls": books.calls,
            "answered": dict(books.answered),
            "lost": list(books.lost),
            "watched": books.watched,
            "overlooked": list(books.overlooked),
            "confirmed": books.confirmed,
            "mails": {str(count): number for count, number in books.mails.items()},
            "repeated": books.repeated,
            "waiting": books.waiting,
            "verified": books.verified,
        },
        indent=1,
    )
