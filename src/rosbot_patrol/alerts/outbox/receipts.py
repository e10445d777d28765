"""Receipts: a file to which each delivery adds one line, synced before the next delivery begins.

A recipient that refused a notice for good, while another of the same channel took it, gets a line too. So it is not
asked again, not even after a restart.

Only the process that delivers writes the file; others read what is new. A line that a crash cut short counts for
nothing.
"""

from __future__ import annotations

import json
import logging
import os
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from pathlib import Path

from rosbot_patrol.files import append_line, write_atomic

log = logging.getLogger(__name__)


@dataclass(frozen=True, kw_only=True)
class Receipt:
    """One delivery, or a refusal that is final.

    Attributes:
        channel: that took or refused the notices.
        transport: of the channel: smtp, maildir, ...
        ids: of the notices, several for a digest.
        wall: time, seconds since 1970.
        where: their place, for people.
        refused: why they were refused for good, "" if they were taken.
    """

    channel: str
    transport: str
    ids: tuple[str, ...]
    wall: float
    where: str
    refused: str = ""


class Receipts:
    """The file of deliveries.

    Args:
        path: of the file, which need not exist; None: receipts stay in `added`.

    Attributes:
        taken: names of the channels that took a notice, by its id.
        refused: names of the channels that refused it for good, by its id.
        refusals: why a channel refused its last notice, by the channel's name.
        last: time of a channel's last delivery, by its name, seconds since 1970.
    """

    def __init__(self, path: Path | None) -> None:
        self.path = path
        self.added: list[Receipt] = []
        self.taken: dict[str, set[str]] = {}
        self.refused: dict[str, set[str]] = {}
        self.refusals: dict[str, str] = {}
        self.last: dict[str, float] = {}
        self._inode, self._offset = -1, 0

    def done(self, notice_id: str) -> set[str]:
        """The channels that have nothing more to do with a notice."""
        return self.taken.get(notice_id, set()) | self.refused.get(notice_id, set())

    def read_new(self) -> list[Receipt]:
        """Receipts that were added since the last call; in the first call all. Raises OSError."""
        if self.path is None:
            return []
        try:
            file = self.path.open("rb")
        except FileNotFoundError:
            return []
        with file:
            found = os.fstat(file.fileno())
            if found.st_ino != self._inode or found.st_size < self._offset:  # the first call, or it was shortened
                self._inode, self._offset = found.st_ino, 0
            file.seek(self._offset)
            data = file.read()
        whole = data[: data.rfind(b"\n") + 1]
        self._offset += len(whole)
        receipts = [r for r in map(_parse, whole.splitlines()) if r is not None]
        return [r for r in receipts if self.note(r)]

    def add(self, receipt: Receipt) -> None:
        """Write a receipt. Raises OSError: the disk does not take it."""
        self.note(receipt)
        if self.path is None:
            self.added.append(receipt)
            return
        tree = {name: value for name, value in asdict(receipt).items() if name != "refused" or value}
        line = json.dumps(tree).encode("ascii") + b"\n"
        append_line(self.path, b"\n" + line if _is_cut(self.path) else line)  # a cut line stays, and counts for nothing

    def compact(self, keep: Iterable[str], *, lines: int = 500) -> None:
        """Shorten the file to the last `lines` and those of the notices `keep`. Raises OSError."""
        wanted = set(keep)
        if self.path is None:
            return
        try:
            found = self.path.read_bytes().splitlines()
        except FileNotFoundError:
            return
        early = found[:-lines]
        kept = [line for line in early if (r := _parse(line)) is not None and wanted & set(r.ids)]
        if len(kept) < len(early):
            write_atomic(self.path, b"".join(line + b"\n" for line in kept + found[-lines:]))

    def note(self, receipt: Receipt) -> bool:
        """Remember a receipt without writing it; returns whether it is news."""
        fresh = any(receipt.channel not in self.done(name) for name in receipt.ids)
        for name in receipt.ids:
            (self.refused if receipt.refused else self.taken).setdefault(name, set()).add(receipt.channel)
        if receipt.refused:
            self.refusals[receipt.channel] = receipt.refused
        else:
            self.refusals.pop(receipt.channel, None)
            self.last[receipt.channel] = max(receipt.wall, self.last.get(receipt.channel, 0.0))
        return fresh


def _is_cut(path: Path) -> bool:
    """Whether the last line of a file has no end. Raises OSError."""
    try:
        with path.open("rb") as file:
            size = file.seek(0, os.SEEK_END)
            return size > 0 and os.pread(file.fileno(), 1, size - 1) != b"\n"
    except FileNotFoundError:
        return False


def _parse(line: bytes) -> Receipt | None:
    try:
        tree = json.loads(line)
        return Receipt(
            channel=str(tree["channel"]),
            transport=str(tree["transport"]),
            ids=tuple(map(str, tree["ids"])),
            wall=float(tree["wall"]),
            where=str(tree["where"]),
            refused=str(tree.get("refused", "")),
        )
    except (ValueError, KeyError, TypeError):
        if line.strip():
            log.warning("a line of the receipts makes no sense and counts for nothing: %r", line[:80])
        return None
