"""The folder of notices: any process puts them there, and one delivers them.

    outbox/000000000012-ID.notice   waits (alerts/outbox/notice.py), written whole and synced before `put` returns
    outbox/taken.jsonl              which channel took what (alerts/outbox/receipts.py)
    outbox/sent/                    the last notices that every channel took
    outbox/reserve                  room for some notices on a full disk
    outbox/lock                     held by the process that delivers (alerts/dispatch/dispatcher.py)

Numbers give the order. Two processes that put at the same moment may take the same number; then the ids decide.
"""

from __future__ import annotations

import errno
import logging
import os
import re
import time
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

from rosbot_patrol.alerts.disk_reserve import DiskReserve
from rosbot_patrol.alerts.outbox.notice import LaterFormat, Notice
from rosbot_patrol.files import DISK_FULL, write_atomic

log = logging.getLogger(__name__)

_NAME = re.compile(r"(?P<order>\d{12})-(?P<id>[A-Za-z0-9._+-]+)\.notice")
_BROKEN = re.compile(r"\d{12}-(?P<id>[A-Za-z0-9._+-]+)\.(?:notice|(?P<set_aside>broken))")
_SCRATCH = re.compile(r"\..*\.(?P<pid>\d+)\.tmp")
_BAD_FILE = (errno.EIO, errno.EISDIR, errno.EACCES, errno.EPERM, errno.EBADMSG, errno.ELOOP)  # faults of one file
RESERVE = 2 << 20  # [bytes]
_PROBE = 4096  # [bytes]; not 0, as a full disk still takes an empty file


@dataclass(frozen=True, kw_only=True)
class Waiting:
    """A notice that waits, without its text and picture.

    Attributes:
        name: of its file; names sort by order.
        id, kind, wall: of the notice.
        is_urgent: it leaves as a message of its own.
        channels: names of the channels that are asked; empty: all that take its kind.
    """

    name: str
    id: str
    kind: str
    wall: float
    is_urgent: bool = False
    channels: tuple[str, ...] = field(default=())


def waiting_of(name: str, notice: Notice) -> Waiting:
    """What a queue has to know of the notice in the file of this name."""
    return Waiting(
        name=name,
        id=notice.id,
        kind=notice.kind,
        wall=notice.wall,
        is_urgent=notice.is_urgent,
        channels=notice.channels,
    )


class Outbox:
    """The folder of waiting notices.

    Args:
        folder: made by the first `put`, or by `make`.
        keep: number of delivered notices that stay in `sent`.
    """

    def __init__(self, folder: Path, *, keep: int = 200) -> None:
        self.folder, self.sent = folder, folder / "sent"
        self._keep = keep
        self._reserve = DiskReserve(folder / "reserve", RESERVE)
        self._known: dict[str, Waiting] = {}
        self._left_alone: set[str] = set()
        self._stuck: list[str] = []  # those of them with a notice that has to be made again
        self._mended: set[str] = set()
        self._order = 0

    def make(self) -> None:
        """Make the folder if it is missing. Raises OSError."""
        self.sent.mkdir(parents=True, exist_ok=True)

    def has(self, notice_id: str) -> bool:
        """Whether a notice of this id waits or was delivered."""
        return any(found["id"] == notice_id for found in self._all_names())

    def waits(self, notice_id: str) -> bool | None:
        """True if a notice waits, whole or damaged; False if delivered; None if unknown. Raises OSError."""
        if any(broken_id == notice_id for _, broken_id in self.broken()):
            return True
        for folder, answer in ((self.folder, True), (self.sent, False)):
            names = (_NAME.fullmatch(entry.name) for entry in _scan(folder))
            if any(found["id"] == notice_id for found in names if found and found[0] not in self._stuck):
                return answer
        return None

    def find(self, notice_id: str) -> Notice | None:
        """The notice of this id, waiting or delivered; None if there is none.

        Raises:
            OSError: its file cannot be read.
            ValueError: its file is no notice.
        """
        for found in self._all_names():
            if found["id"] == notice_id:
                for folder in (self.folder, self.sent):  # it may have moved meanwhile
                    try:
                        return Notice.from_bytes((folder / found[0]).read_bytes())
                    except FileNotFoundError:
                        continue
        return None

    def put(self, notice: Notice) -> bool:
        """Keep a notice until it is delivered.

        Returns:
            False if one of its id is known already.

        Raises:
            OSError: the disk does not take it; nothing is kept.
        """
        self.make()
        names = self._all_names()
        if any(found["id"] == notice.id for found in names if found[0] not in self._stuck):
            return False
        self._order = max([self._order, *(int(found["order"]) for found in names)]) + 1
        path = self.folder / f"{self._order:012d}-{notice.id}.notice"
        data = notice.to_bytes()
        try:
            self._write(path, data)
        except OSError as err:
            if not path.exists():
                raise
            log.error("%s may not outlive a power cut: %s", path, err)  # but the file is there, so it will be delivered
        return True

    def probe(self) -> None:
        """Write something and remove it again. Raises OSError: the disk does not take it."""
        self.make()
        path = self.folder / "probe"
        write_atomic(path, bytes(_PROBE))
        path.unlink(missing_ok=True)

    def waiting(self) -> list[Waiting]:
        """The notices that wait, oldest first. A file that is no notice is set aside. Raises OSError."""
        names = sorted(e.name for e in _scan(self.folder) if e.name.endswith(".notice"))
        self._known = {name: self._known[name] for name in names if name in self._known}
        for name in names:
            if name not in self._known and name not in self._left_alone:
                self._look_at(name)
        return [self._known[name] for name in names if name in self._known]

    def read(self, entry: Waiting) -> Notice:
        """A notice. Raises OSError if its file cannot be read, ValueError if it is none."""
        return Notice.from_bytes((self.folder / entry.name).read_bytes())

    def doubt(self, entries: Iterable[Waiting]) -> None:
        """Look at these files anew in the next `waiting`, as one of them could not be read."""
        for entry in entries:
            self._known.pop(entry.name, None)

    def finish(self, entry: Waiting) -> None:
        """Move a notice that every channel took to `sent`. Raises OSError."""
        self.make()
        try:
            (self.folder / entry.name).replace(self.sent / entry.name)
        except FileNotFoundError:
            log.warning("%s is gone from the outbox", entry.name)
        self._known.pop(entry.name, None)

    def set_aside(self, name: str) -> Path:
        """Rename a file that is no notice; returns its new path. Raises OSError."""
        aside = (self.folder / name).with_suffix(".broken")
        (self.folder / name).replace(aside)
        return aside

    def broken(self) -> list[tuple[str, str]]:
        """File name and notice id of each damaged notice that was not replaced yet. Raises OSError."""
        names = dict.fromkeys(self._stuck + sorted(e.name for e in _scan(self.folder)))
        found = ((name, _BROKEN.fullmatch(name)) for name in names if name not in self._mended)
        return [(name, match["id"]) for name, match in found if match and (match["set_aside"] or name in self._stuck)]

    def mended(self, name: str) -> None:
        """Note that a file of `broken` was replaced. Raises OSError."""
        self._mended.add(name)
        if name not in self._stuck:
            (self.folder / name).replace(self.folder / f"{name}-told")

    def tidy(self) -> None:
        """Remove old notices and scratch files, keep up the reserve; for the process that delivers. Raises OSError."""
        self.make()
        for name in sorted(e.name for e in _scan(self.sent))[: -self._keep]:
            (self.sent / name).unlink(missing_ok=True)
        for scratch in (*self.folder.glob(".*.tmp"), *self.sent.glob(".*.tmp")):
            if _is_left_over(scratch):
                scratch.unlink(missing_ok=True)
        self._reserve.fill(only_with=8 * RESERVE)

    # -- inside

    def _all_names(self) -> list[re.Match[str]]:
        # The waiting ones first, so that a notice that moves to `sent` meanwhile is seen at least once.
        waiting = [entry.name for entry in _scan(self.folder)]
        names = waiting + [entry.name for entry in _scan(self.sent)]
        return [found for name in names if (found := _NAME.fullmatch(name))]

    def _look_at(self, name: str) -> None:
        try:
            notice = Notice.from_bytes((self.folder / name).read_bytes())
            found = _NAME.fullmatch(name)
            if found and found["id"] != notice.id:
                raise ValueError(f"is no notice of this name: it says that it is {notice.id}")
        except FileNotFoundError:
            return
        except LaterFormat as err:
            log.error("%s %s: it is left alone", self.folder / name, err)
            self._leave(name)
        except (OSError, ValueError) as err:
            if isinstance(err, OSError) and err.errno not in _BAD_FILE:
                raise
            self._put_aside(name, err)
        else:
            self._known[name] = waiting_of(name, notice)

    def _put_aside(self, name: str, problem: Exception) -> None:
        try:
            log.error("%s %s: set aside as %s", self.folder / name, problem, self.set_aside(name))
        except OSError as err:
            log.error("%s %s, and cannot be set aside: %s", self.folder / name, problem, err)
            self._leave(name)

    def _leave(self, name: str) -> None:
        self._left_alone.add(name)
        self._stuck.append(name)

    def _write(self, path: Path, data: bytes) -> None:
        try:
            write_atomic(path, data)
        except OSError as err:
            if err.errno not in DISK_FULL or not self._make_room(len(data)):
                raise
            log.error("the disk is full: the notice took some of the room that is kept free for it")
            write_atomic(path, data)

    def _make_room(self, size: int) -> bool:
        """Free space on a full disk: old delivered notices, then the reserve. Returns whether there was some."""
        freed = 0
        for name in sorted(e.name for e in _scan(self.sent))[:-20]:
            freed += (self.sent / name).stat().st_size
            (self.sent / name).unlink(missing_ok=True)
        if freed < 2 * size:
            freed += self._reserve.give(size + 65536)
        return freed > 0


def _scan(folder: Path) -> list[os.DirEntry[str]]:
    """The entries of a folder; none if it was not made yet."""
    try:
        return list(os.scandir(folder))
    except FileNotFoundError:
        return []


def _is_left_over(scratch: Path) -> bool:
    """Whether a crash left a scratch file: it is older than a minute and its process has gone."""
    found = _SCRATCH.fullmatch(scratch.name)
    try:
        age = time.clock_gettime(time.CLOCK_REALTIME) - scratch.stat().st_mtime
        if found is None or age < 60.0:
            return False
        os.kill(int(found["pid"]), 0)
    except (ProcessLookupError, OverflowError):
        return True
    except (FileNotFoundError, PermissionError):
        return False
    return False
