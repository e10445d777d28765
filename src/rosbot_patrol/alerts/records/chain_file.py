"""The chain on the disk: `chain.jsonl`, one link a line, only ever appended to.

A line holds everything of its link but the body of a record or an amendment, which lie in the incident's folder. Each
line is on the disk when its call returns. A crash can leave half a line at the end: it counts for nothing, and the
next link takes its place.
"""

from __future__ import annotations

import fcntl
import json
import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from rosbot_patrol.alerts.records import chain
from rosbot_patrol.alerts.records.disk_errors import errors_of
from rosbot_patrol.errors import StoreError
from rosbot_patrol.files import append_line, sync_folder

LOCK_TIMEOUT = 5.0  # longest wait for another writer [s]

_TAIL = 65_536  # bytes at the end of the file that are searched first for the last link
_PAUSE = 0.02  # between attempts to get the lock [s]
_BODIES = (chain.BEGUN, chain.REMOVAL)  # kinds of links with their small body in the line
_TEXTS = ("kind", "incident", "digest", "previous", "hash")


@dataclass(frozen=True, kw_only=True)
class Line:
    """A complete line of the chain.

    Attributes:
        start, stop: first byte, and the byte behind the line.
        link: None if the line makes no sense.
    """

    start: int
    stop: int
    link: chain.Link | None


class ChainFile:
    """The file of the chain.

    Args:
        path: of the file, in a folder that exists when something is written.
        sleep: between attempts to get the lock [s].
    """

    def __init__(self, path: Path, *, sleep: Callable[[float], None] = time.sleep) -> None:
        self.path, self._sleep = path, sleep

    def lines(self, start: int = 0) -> Iterator[Line]:
        """The complete lines from a byte on. Raises StoreError."""
        with errors_of(self.path), self.path.open("rb") as file:
            file.seek(start)
            for data in file:
                if not data.endswith(b"\n"):
                    return
                yield Line(start=start, stop=start + len(data), link=parse(data))
                start += len(data)

    def line(self, start: int, stop: int) -> Line:
        """One line, where `lines` found it. Raises StoreError."""
        with errors_of(self.path), self.path.open("rb") as file:
            file.seek(start)
            return Line(start=start, stop=stop, link=parse(file.read(stop - start)))

    def head(self) -> tuple[int, str]:
        """Number and hash of the last link; (0, START) before the first. Raises StoreError.

        A damaged line before it does not matter here: `verify` names it.
        """
        wanted = _TAIL
        while True:
            with errors_of(self.path):
                size = self.size
                start = max(size - wanted, 0)
                data = _read(self.path, start, size)
            complete = data.split(b"\n")[:-1]
            for line in reversed(complete if start == 0 else complete[1:]):
                link = parse(line)
                if link is not None:
                    return link.n, link.hash
            if start == 0:
                return 0, chain.START
            wanted *= 16

    @property
    def size(self) -> int:
        """Size of the file [bytes], 0 without one. Raises OSError."""
        try:
            return self.path.stat().st_size
        except FileNotFoundError:
            return 0

    @contextmanager
    def locked(self, *, is_made: bool = False) -> Iterator[None]:
        """Keep other writers out, also those of other programs.

        Args:
            is_made: make the file if there is none.

        Raises:
            StoreError: another writer holds the lock for longer than LOCK_TIMEOUT, or there is no such file.
        """
        with errors_of(self.path):
            handle = os.open(self.path, os.O_RDWR | (os.O_CREAT if is_made else 0), 0o600)
        try:
            self._lock(handle)
            yield
        finally:
            os.close(handle)

    def _lock(self, handle: int) -> None:
        deadline = time.monotonic() + LOCK_TIMEOUT
        while True:
            try:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                if time.monotonic() > deadline:
                    raise StoreError(self.path, "is locked by another program") from None
                self._sleep(_PAUSE)
            else:
                return

    def append(self, kind: str, incident_id: str, wall: float, body: str) -> chain.Link:
        """Add a link. The caller holds the lock. Raises StoreError; the file is as it was then."""
        self.cut_tail()
        link = chain.make_link(self.head(), kind, incident_id, float(wall), body)
        with errors_of(self.path):
            append_line(self.path, format_line(link))
        return link

    def cut_tail(self) -> int:
        """Drop what follows the last complete line; returns its size [bytes]. The caller holds the lock.

        Raises:
            StoreError: the disk does not take it.
        """
        with errors_of(self.path):
            size = self.size
            wanted = _TAIL
            while True:
                start = max(size - wanted, 0)
                end = _read(self.path, start, size).rfind(b"\n")
                if end >= 0 or start == 0:
                    break
                wanted *= 16
            whole = start + end + 1
            if whole < size:
                os.truncate(self.path, whole)
                sync_folder(self.path.parent)
            return size - whole


def format_line(link: chain.Link) -> bytes:
    """The line of a link. Bodies of records and amendments are left out."""
    values = {name: value for name, value in vars(link).items() if name != "body" or link.kind in _BODIES}
    return chain.canonical(values).encode("utf-8") + b"\n"


def parse(data: bytes) -> chain.Link | None:
    """The link of a line; None if it makes no sense."""
    try:
        values = json.loads(data)
        link = chain.Link(**{"body": None, **values})
    except (ValueError, TypeError, RecursionError):
        return None
    texts = [getattr(link, name) for name in _TEXTS] + ([] if link.body is None else [link.body])
    is_sound = isinstance(link.n, int) and isinstance(link.wall, int | float) and all(isinstance(t, str) for t in texts)
    return link if is_sound else None


def _read(path: Path, start: int, stop: int) -> bytes:
    if start == stop:
        return b""
    with path.open("rb") as file:
        file.seek(start)
        return file.read(stop - start)
