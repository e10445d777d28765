"""Notices that the disk does not take: an outbox in memory, lost with the process."""

from __future__ import annotations

import threading
from collections.abc import Iterable
from pathlib import Path

from rosbot_patrol.alerts.outbox.notice import Notice
from rosbot_patrol.alerts.outbox.outbox import Waiting, waiting_of


class MemoryOutbox:
    """As `Outbox`, without files. A notice that every channel took stays until `forget`, so that it can be written."""

    folder = Path("memory")

    def __init__(self) -> None:
        self._guard = threading.Lock()
        self._notices: dict[str, Notice] = {}
        self._finished: set[str] = set()

    def __len__(self) -> int:
        return len(self._notices)

    def make(self) -> None:
        """Do nothing: there is no folder."""

    def find(self, notice_id: str) -> Notice | None:
        """The notice of this id, waiting or delivered; None if there is none."""
        return self._notices.get(notice_id)

    def all(self) -> list[Notice]:
        """Every notice, waiting or delivered, oldest first."""
        with self._guard:
            return list(self._notices.values())

    def put(self, notice: Notice) -> bool:
        """Keep a notice; returns False if one of its id is known already."""
        with self._guard:
            is_new = notice.id not in self._notices
            self._notices.setdefault(notice.id, notice)
            return is_new

    def waiting(self) -> list[Waiting]:
        """The notices that wait, oldest first."""
        return [waiting_of(n.id, n) for n in self.all() if n.id not in self._finished]

    def read(self, entry: Waiting) -> Notice:
        """A notice. Raises ValueError if it is gone."""
        notice = self._notices.get(entry.id)
        if notice is None:
            raise ValueError(f"{entry.id} is no longer in memory")
        return notice

    def doubt(self, entries: Iterable[Waiting]) -> None:
        """Do nothing: nothing is read ahead."""

    def finish(self, entry: Waiting) -> None:
        """Note that every channel took a notice."""
        self._finished.add(entry.id)

    def forget(self, notice_id: str) -> None:
        """Drop a notice that is on the disk now."""
        with self._guard:
            self._notices.pop(notice_id, None)
            self._finished.discard(notice_id)

    def tidy(self) -> None:
        """Do nothing: nothing is left over."""
