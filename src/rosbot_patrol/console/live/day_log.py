"""The log of the last day: what changed, as entries that a page tells in its visitor's language. Kept on the disk."""

from __future__ import annotations

import json
import logging
import threading
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

from rosbot_patrol.console.live.house_state import HouseState
from rosbot_patrol.files import write_atomic

log = logging.getLogger(__name__)

DAY = 86400.0  # [s]
_MOST = 2000  # entries
_SHORT = 60.0  # [s] after which the file is written anew, without what is older than a day


@dataclass(frozen=True, kw_only=True)
class Entry:
    """Something that changed.

    Attributes:
        wall: when, seconds since 1970.
        kind: guard, mission, verdict, mode, stop, problem, well, charging.
        what: of the kind: a phase, a verdict, a mode, a problem's name, "on" or "off".
        room: name of the room that it is about, "" for none.
        text: in the robot's words, "" for none.
    """

    wall: float
    kind: str
    what: str
    room: str = ""
    text: str = ""


class DayLog:
    """Takes each state of the house, and notes what is new in it. Thread-safe.

    Args:
        path: of its file.
        wall: seconds since 1970.
    """

    def __init__(self, path: Path, wall: Callable[[], float]) -> None:
        self._path, self._wall = path, wall
        self._lock = threading.Lock()
        self._before = HouseState()
        self._entries: deque[Entry] = deque(_read(path), maxlen=_MOST)
        self._written, self._written_at = len(self._entries), wall()

    @property
    def newest_first(self) -> list[Entry]:
        """The entries of the last day."""
        since = self._wall() - DAY
        with self._lock:
            return [entry for entry in reversed(self._entries) if entry.wall >= since]

    def follow(self, state: HouseState) -> None:
        """Note what is new in a state."""
        with self._lock:
            before, self._before = self._before, state
            if before == state:
                return
            new = list(_news(before, state, self._wall()))
            self._entries.extend(new)
        if new:
            self._append(new)

    def _append(self, new: list[Entry]) -> None:
        lines = "".join(f"{json.dumps(asdict(entry))}\n" for entry in new)
        try:
            if self._wall() - self._written_at > _SHORT and self._written > _MOST:
                kept = self.newest_first[::-1]
                write_atomic(self._path, "".join(f"{json.dumps(asdict(entry))}\n" for entry in kept).encode())
                self._written, self._written_at = len(kept), self._wall()
            else:
                self._path.parent.mkdir(parents=True, exist_ok=True)
                with self._path.open("a", encoding="utf-8") as file:
                    file.write(lines)
                self._written += len(new)
        except OSError as err:
            log.error("the log of the day is in memory only: %s", err)


def _news(before: HouseState, state: HouseState, wall: float) -> Iterator[Entry]:
    if before.is_heard != state.is_heard:
        yield Entry(wall=wall, kind="guard", what="on" if state.is_heard else "off")
    if before.is_stopped != state.is_stopped:
        yield Entry(wall=wall, kind="stop", what="on" if state.is_stopped else "off")
    if state.arming is not None and (before.arming is None or before.arming.mode != state.arming.mode):
        yield Entry(wall=wall, kind="mode", what=state.arming.mode)
    batteries = state.battery, before.battery
    if batteries[0] is not None and batteries[1] is not None and batteries[0].is_charging != batteries[1].is_charging:
        yield Entry(wall=wall, kind="charging", what="on" if batteries[0].is_charging else "off")
    yield from _missions(before, state, wall)
    for name in state.problems.keys() - before.problems.keys():
        yield Entry(wall=wall, kind="problem", what=name, text=state.problems[name].text)
    for name in before.problems.keys() - state.problems.keys():
        yield Entry(wall=wall, kind="well", what=name)


def _missions(before: HouseState, state: HouseState, wall: float) -> Iterator[Entry]:
    guard, last = state.guard, before.guard
    if guard is None:
        return
    was = last.doing if last is not None else ""
    if guard.doing == "driving" and (was != "driving" or last is None or last.room_id != guard.room_id):
        yield Entry(wall=wall, kind="mission", what=guard.origin, room=guard.room_name)
    if last is None:
        return
    if guard.verdict == "confirmed" and last.verdict != "confirmed":
        yield Entry(wall=wall, kind="verdict", what="confirmed", room=guard.room_name)
    is_over = was in ("driving", "looking", "returning") and guard.doing in ("idle", "starting")
    if is_over and guard.last_verdict != "confirmed":
        yield Entry(wall=wall, kind="verdict", what=guard.last_verdict, room=last.room_name, text=guard.why)


def _read(path: Path) -> Iterator[Entry]:
    try:
        lines = path.read_text("utf-8").splitlines()
    except (OSError, UnicodeDecodeError):
        return
    for line in lines[-_MOST:]:
        try:
            yield Entry(**json.loads(line))
        except (ValueError, TypeError):  # the last line of a program that was killed
            continue
