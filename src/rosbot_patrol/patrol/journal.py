"""Calls of sensors, on disk before they count as taken: one line each, so that a kill right after loses none.

A line is written within the callback that took the call. Once the patrol's own memory, which says up to which line it
has taken them, is on disk, they are dropped.
"""

from __future__ import annotations

import json
import logging
import os
from pathlib import Path

log = logging.getLogger(__name__)


class Journal:
    """Numbered lines of room and time.

    Args:
        path: of the file; its folder is made.
        taken: number of the last line that the memory knows.

    Attributes:
        left: (number, room, seconds since 1970) of the lines that it does not know.
    """

    def __init__(self, path: Path, taken: int) -> None:
        self._path = path
        path.parent.mkdir(parents=True, exist_ok=True)
        lines = self._read()
        self.left = [line for line in lines if line[0] > taken]
        self._last = max([taken, *(number for number, *_ in lines)])
        self._file = path.open("ab")
        if self._file.tell() and not path.read_bytes().endswith(b"\n"):
            self._file.write(b"\n")  # what comes is no part of a line that was cut short

    def add(self, room_id: int, wall: float) -> int:
        """Write a line down to the disk; its number. Raises OSError: the call is not on disk."""
        self._last += 1
        self._file.write(json.dumps([self._last, room_id, wall]).encode() + b"\n")
        self._file.flush()
        os.fdatasync(self._file.fileno())
        return self._last

    def drop(self, taken: int) -> None:
        """Forget the lines where the memory on disk knows all of them."""
        if taken >= self._last and self._file.tell():
            self._file.truncate(0)
            self._file.seek(0)

    def close(self) -> None:
        """Let go of the file."""
        self._file.close()

    def _read(self) -> list[tuple[int, int, float]]:
        found = []
        for line in self._path.read_bytes().splitlines() if self._path.exists() else []:
            try:
                number, room_id, wall = json.loads(line)
                found.append((int(number), int(room_id), float(wall)))
            except (ValueError, TypeError):  # cut short by a kill: its callback had not ended
                log.warning("%s: a line makes no sense and is left out: %r", self._path, line[:60])
        return found
