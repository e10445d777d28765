"""Calls of motion sensors: each is on disk before its callback ends; the next step processes it.

A call that was processed before a restart and comes again, such as from a latched topic, is ignored.
"""

from __future__ import annotations

import logging
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

from rosbot_patrol.patrol.calls.journal import Journal
from rosbot_patrol.patrol.calls.repeats import Repeats
from rosbot_patrol.patrol.house.rooms import Rooms
from rosbot_patrol.patrol.mission.resume import PatrolStore
from rosbot_patrol.patrol.records.inputs import Guarded
from rosbot_patrol.ros.runtime.latest import drain
from rosbot_patrol.ros.runtime.node import now

log = logging.getLogger(__name__)

_MOST = 1000  # most waiting calls
_DISK = -1  # the disk has its own diagnostic, apart from the rooms


@dataclass(frozen=True)
class _Call:
    room: int
    sender: str  # sender of a latched topic, else ""
    number: int  # number in the journal, 0 if it need not be there


class CallDesk:
    """Accept calls in callbacks, write them to the journal, and pass them to the step.

    Args:
        rooms: rooms of the points file.
        store: store of the patrol's memory.
        journal: journal of the calls.
        latched_window: time after the start in which a latched call may be an old one [s].
        wake: requests a step at once.

    Attributes:
        taken: number of the journal's last line that a step has processed.
        guarded: the armed rooms, set by each step.
    """

    def __init__(
        self, rooms: Rooms, store: PatrolStore, journal: Journal, *, latched_window: float, wake: Callable[[], None]
    ) -> None:
        self._rooms, self._store, self._journal, self._wake = rooms, store, journal, wake
        self._latched_window = latched_window
        self._lock = threading.Lock()  # protects the calls; the step needs it, so nobody holds it during disk access
        self._writing = threading.Lock()  # protects the journal
        self._calls: deque[_Call] = deque()
        self._on_disk: frozenset[int] = frozenset()
        self._served: frozenset[int] = frozenset()
        self._started = time.monotonic()
        self._first_heard: set[str] = set()
        self._refused = Repeats()
        self._has_latched = False
        self.guarded = Guarded()
        self.taken = max((number for number, *_ in journal.left), default=store.taken)

    # -- callbacks

    def is_first(self, sender: str) -> bool:
        """Whether a sender's call is its first since the start, and soon after it."""
        is_first = sender not in self._first_heard
        self._first_heard.add(sender)
        return is_first and time.monotonic() - self._started < self._latched_window

    def was_taken_before(self, sender: str, room: int) -> bool:
        """Whether a latched call was processed before the restart."""
        is_handled = self._store.is_handled(sender, room)
        if is_handled:
            log.info("the latched trigger for room %d from %s was taken before the restart", room, sender)
        return is_handled

    def call(self, room: int, latched_sender: str) -> None:
        """Accept a call; if it must be on disk, it is there when this returns.

        Args:
            room: room of the sensor.
            latched_sender: name of the node that latched the call, "" if it is not latched.
        """
        with self._writing:
            with self._lock:
                is_covered = self._is_covered(room)
            number = 0 if is_covered else self._write_down(room)
            with self._lock:
                self._calls.append(_Call(room, latched_sender, number))
                while len(self._calls) > _MOST:
                    self._calls.popleft()
        self._wake()

    def _is_covered(self, room: int) -> bool:
        """Whether a call need not be written: the state on disk covers it, or nothing will answer it."""
        is_waiting = any(call.room == room and call.number for call in self._calls)
        is_served = room in self._on_disk and room in self._served
        return is_waiting or is_served or not self.guarded.counts(room) or self._rooms.find(room) is None

    def _write_down(self, room: int) -> int:
        try:
            return self._journal.add(room, time.time())
        except OSError as err:
            if self._refused.is_news(_DISK, now()):
                log.error("a call of room %d cannot be written down: %s; it is taken all the same", room, err)
            return 0

    # -- a step

    def take(self) -> tuple[int, ...]:
        """Take the rooms called since the last step."""
        with self._lock:
            calls = drain(self._calls)
            self.taken = max((call.number for call in calls), default=0) or self.taken
        for call in calls:
            if call.sender:
                self._store.note_latched(call.sender, call.room)
                self._has_latched = True
        return tuple(call.room for call in calls)

    def has_latched(self) -> bool:
        """Whether the store has received a latched trigger since the last call of this."""
        was, self._has_latched = self._has_latched, False
        return was

    def note_served(self, served: frozenset[int]) -> None:
        """Set the rooms that wait or are being searched now."""
        self._served = served

    def note_saved(self, served: frozenset[int], taken: int) -> None:
        """Set the same for the memory on disk, which includes the journal up to `taken`."""
        self._on_disk = served
        with self._writing:
            self._journal.drop(taken)
