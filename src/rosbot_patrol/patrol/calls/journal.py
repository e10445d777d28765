"""Journal of sensors' calls: each is on the disk before it counts as taken, so that a kill loses none.

A line is written within the callback of the call. Lines are dropped after the patrol's own memory, which says up to
which line it has taken them, is on the disk. The mark beside the file holds number, size and checksum of the lines, so
that a file that was emptied, truncated or changed is detected. It is written after each line and before lines are
dropped: a kill between the two leaves more lines than the mark says, never fewer.
"""

from __future__ import annotations

import json
import logging
import os
import zlib
from dataclasses import asdict, dataclass
from pathlib import Path

from rosbot_patrol.errors import StateError
from rosbot_patrol.files import append_line, read_json, write_whole

log = logging.getLogger(__name__)


@dataclass(frozen=True, kw_only=True)
class _Mark:
    """Contents of the journal: number of the last line, size and CRC-32 of all lines."""

    last: int = 0
    size: int = 0
    crc: int = 0


class Journal:
    """Numbered lines of room and time. A disk that fails does not prevent the start: `add` reports it.

    Args:
        path: of the file; its folder is created.
        taken: number of the last line in the memory.

    Attributes:
        left: (number, room, seconds since 1970) of the lines not in the memory.
        damage: one sentence on lost calls, "" if there are none.
    """

    def __init__(self, path: Path, taken: int) -> None:
        self._path, self._mark_path = path, path.with_name(f"{path.stem}.mark")
        self.left: list[tuple[int, int, float]] = []
        self.damage = ""
        self._taken, self._is_read = taken, False
        self._is_cut = False  # the last line is incomplete: new text is not a part of it
        self._mark = _Mark(last=taken)
        try:
            self._recall()
        except OSError as err:
            self.damage = f"{path} cannot be read ({err}): calls of motion sensors from before the start may be lost"

    def add(self, room_id: int, wall: float) -> int:
        """Write a line to the disk; returns its number. Raises OSError: the call is not on the disk."""
        if not self._is_read:
            self._recall()
        number = self._mark.last + 1
        line = b"\n" * self._is_cut + json.dumps([number, room_id, wall]).encode() + b"\n"
        self._path.parent.mkdir(parents=True, exist_ok=True)
        append_line(self._path, line)
        self._is_cut = False
        self._mark = _Mark(last=number, size=self._mark.size + len(line), crc=zlib.crc32(line, self._mark.crc))
        self._try_mark()
        return number

    def drop(self, taken: int) -> None:
        """Drop the lines if the memory on the disk includes all of them. Raises OSError."""
        if taken >= self._mark.last and self._mark.size:
            mark = _Mark(last=self._mark.last)
            self._write_mark(mark)
            os.truncate(self._path, 0)
            self._mark = mark

    def _write_mark(self, mark: _Mark) -> None:
        write_whole(self._mark_path, json.dumps(asdict(mark)).encode())

    def _try_mark(self) -> None:
        try:
            self._write_mark(self._mark)
        except OSError as err:
            log.error("%s cannot be written: %s; nobody would notice damage to the calls", self._mark_path, err)

    # -- at the start

    def _recall(self) -> None:
        taken = self._taken
        data = self._path.read_bytes() if self._path.exists() else b""
        lines = self._parse(data)
        self.left = [line for line in lines if line[0] > taken]
        mark = self._read_mark()
        numbers = {number for number, *_ in lines}
        last = max([taken, mark.last if mark else 0, *numbers])
        if mark is not None and (len(data) < mark.size or zlib.crc32(data[: mark.size]) != mark.crc):
            self._find_damage(taken, mark, numbers)
        self._mark, self._is_read = _Mark(last=last, size=len(data), crc=zlib.crc32(data)), True
        self._is_cut = bool(data) and not data.endswith(b"\n")
        if mark is not None or data:
            self._try_mark()

    def _find_damage(self, taken: int, mark: _Mark, numbers: set[int]) -> None:
        missing = len([number for number in range(taken + 1, mark.last + 1) if number not in numbers])
        count = f"{missing} call{'s' * (missing != 1)} of motion sensors"
        if missing:
            self.damage = f"{self._path} was damaged: {count} that nobody looked after yet are lost"
        elif mark.last > taken:
            self.damage = f"{self._path} was damaged: calls of motion sensors in it may be of other rooms or times"
        else:
            log.warning("%s was damaged; the calls in it were taken already", self._path)

    def _read_mark(self) -> _Mark | None:
        try:
            tree = read_json(self._mark_path)
            if tree is None:  # from an earlier version, or at the first start
                return None
            return _Mark(last=int(tree["last"]), size=int(tree["size"]), crc=int(tree["crc"]))
        except (StateError, ValueError, KeyError, TypeError, OverflowError) as err:
            log.error("%s cannot be used (%r): nobody can tell whether all calls are there", self._mark_path, err)
            return None

    def _parse(self, data: bytes) -> list[tuple[int, int, float]]:
        found = []
        for line in data.splitlines():
            try:
                number, room_id, wall = json.loads(line)
                found.append((int(number), int(room_id), float(wall)))
            except (ValueError, TypeError, OverflowError):  # truncated by a kill: its callback had not ended
                if line.strip():
                    log.warning("%s: a line makes no sense and is left out: %r", self._path, line[:60])
        return found
