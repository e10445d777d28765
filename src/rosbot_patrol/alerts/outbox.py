"""Mails that wait for their transport: on disk until it took them.

Each is one whole file, written before anything is sent. Order is kept: where the transport is down, all wait for the
oldest; a mail that the server refuses for good lets the others pass and is tried again later. What was delivered moves
to the folder `sent`, so that an incident that comes up again after a crash is known. After a crash between sending and
moving a mail goes again, with the same Message-ID (the Maildir transport notices and keeps one).
"""

from __future__ import annotations

import glob
import logging
import re
from dataclasses import dataclass
from email import message_from_bytes
from email.message import EmailMessage
from email.policy import SMTP
from pathlib import Path

from rosbot_patrol.files import sync_folder, write_atomic

log = logging.getLogger(__name__)

_NAME = re.compile(r"(?P<order>\d{12})-(?P<id>[A-Za-z0-9._+-]+)\.eml")


@dataclass(kw_only=True)
class Entry:
    """One mail that waits.

    Attributes:
        id: of the incident.
        path: its file.
        attempts: since the program started.
        due: not to be tried before [s].
    """

    id: str
    path: Path
    attempts: int = 0
    due: float = float("-inf")

    def mail(self) -> EmailMessage:
        """The mail. Raises OSError where the file cannot be read, ValueError where it is no mail."""
        mail = message_from_bytes(self.path.read_bytes(), policy=SMTP)
        if not isinstance(mail, EmailMessage) or not mail["Message-ID"] or not mail["From"]:
            raise ValueError("is no mail")
        return mail


class Outbox:
    """The folder of waiting mails.

    Args:
        folder: is made where missing; what lies there already waits, too.
        interval: least time between two mails [s]: delays, never drops.
        first_delay: wait after the first failure [s]; doubles with each to at most max_delay.
        keep: so many delivered mails stay in `sent`.
    """

    def __init__(
        self,
        folder: Path,
        *,
        interval: float = 10.0,
        first_delay: float = 5.0,
        max_delay: float = 900.0,
        keep: int = 200,
    ) -> None:
        self.folder = folder
        self._interval = interval
        self._first_delay, self._max_delay, self._keep = first_delay, max_delay, keep
        self._sent = folder / "sent"
        self._failures = 0
        self._blocked_until = float("-inf")
        self._last_delivery = float("-inf")
        self._sent.mkdir(parents=True, exist_ok=True)
        self._entries = self._scan()
        names = [path.name for path in (*folder.glob("*.eml"), *self._sent.glob("*.eml"))]
        orders = [int(match["order"]) for name in names if (match := _NAME.fullmatch(name))]
        self._order = max(orders, default=0)

    def __len__(self) -> int:
        return len(self._entries)

    def has(self, incident_id: str) -> bool:
        """Whether a mail of this incident waits or was delivered."""
        waits = any(entry.id == incident_id for entry in self._entries)
        return waits or any(True for _ in self._sent.glob(f"*-{glob.escape(incident_id)}.eml"))

    def put(self, incident_id: str, mail: EmailMessage) -> None:
        """Keep a mail until it is delivered; nothing where the incident's is known already. Raises OSError."""
        if self.has(incident_id):
            return
        path = self.folder / f"{self._order + 1:012d}-{incident_id}.eml"
        if not _NAME.fullmatch(path.name):
            raise ValueError(f"'{incident_id}' is no id for a file")
        write_atomic(path, mail.as_bytes(policy=SMTP))
        self._order += 1
        self._entries.append(Entry(id=incident_id, path=path))

    def due(self, now: float) -> Entry | None:
        """The mail to be sent now, None where none is due."""
        if now < self._blocked_until or now - self._last_delivery < self._interval:
            return None
        return next((entry for entry in self._entries if entry.due <= now), None)

    def wait(self, now: float) -> float | None:
        """How long until something is due [s], None where nothing waits."""
        if not self._entries:
            return None
        due = max(min(e.due for e in self._entries), self._blocked_until, self._last_delivery + self._interval)
        return max(due - now, 0.0)

    def delivered(self, entry: Entry, now: float) -> None:
        """Move a mail to `sent`. Raises OSError where the disk does not take it (it goes again after a restart)."""
        self._entries.remove(entry)
        self._last_delivery = now
        self._failures, self._blocked_until = 0, float("-inf")
        entry.path.replace(self._sent / entry.path.name)
        sync_folder(self._sent)
        sync_folder(self.folder)
        for old in sorted(self._sent.glob("*.eml"))[: -self._keep]:
            old.unlink(missing_ok=True)

    def forget(self, entry: Entry) -> None:
        """Take an entry whose file is gone off the list."""
        self._entries.remove(entry)

    def failed(self, entry: Entry, now: float, *, permanent: bool = False) -> float:
        """Put a mail off; returns how long [s].

        Args:
            entry: that was tried.
            now: time [s].
            permanent: the fault is this mail's, the others may pass.
        """
        entry.attempts += 1
        if permanent:
            delay = self._delay(entry.attempts)
            entry.due = now + delay
            return delay
        self._failures += 1
        delay = self._delay(self._failures)
        self._blocked_until = now + delay
        return delay

    def set_aside(self, entry: Entry) -> Path:
        """Take a file that is no mail out of the way; it stays on disk under another name. Raises OSError."""
        self._entries.remove(entry)
        aside = entry.path.with_suffix(".broken")
        entry.path.replace(aside)
        return aside

    def _delay(self, attempts: int) -> float:
        return float(min(self._first_delay * 2.0 ** min(attempts - 1, 30), self._max_delay))

    def _scan(self) -> list[Entry]:
        for scratch in self.folder.glob(".*.tmp"):  # what a crash left half written was never promised to anyone
            scratch.unlink(missing_ok=True)
        entries = []
        for path in sorted(self.folder.glob("*.eml")):
            match = _NAME.fullmatch(path.name)
            if match:
                entries.append(Entry(id=match["id"], path=path))
            else:
                log.warning("%s does not look like a waiting mail and is left alone", path)
        return entries
