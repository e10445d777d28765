"""Notices that wait for an entry delay: on disk, but outside the outbox, so that nobody delivers them."""

from __future__ import annotations

from pathlib import Path

from rosbot_patrol.alerts.outbox.notice import Notice
from rosbot_patrol.files import write_atomic


class DelayedNotices:
    """A folder of delayed notices. Those of this run stay in memory, too, in case the disk takes nothing.

    Args:
        folder: made with the first notice.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._notices: dict[str, Notice] = {}
        self._unwritten: dict[str, Notice] = {}

    @property
    def is_written(self) -> bool:
        """Whether all of them are on the disk."""
        return not self._unwritten

    def has(self, notice_id: str) -> bool:
        """Whether a notice waits here. Raises OSError."""
        return notice_id in self._notices or self._path(notice_id).exists()

    def put(self, notice: Notice) -> None:
        """Keep a notice. Raises OSError: it is in memory only, until `save`."""
        self._notices[notice.id] = self._unwritten[notice.id] = notice
        self.save()

    def save(self) -> None:
        """Write the notices that are in memory only. Raises OSError."""
        for notice_id, notice in list(self._unwritten.items()):
            write_atomic(self._path(notice_id), notice.to_bytes())
            self._unwritten.pop(notice_id, None)

    def get(self, notice_id: str) -> Notice | None:
        """A notice that waits, None if there is none. Raises OSError, or ValueError if its file is no notice."""
        if notice_id in self._notices:
            return self._notices[notice_id]
        return Notice.from_bytes(self._path(notice_id).read_bytes()) if self.has(notice_id) else None

    def remove(self, notice_id: str) -> None:
        """Forget a notice. Raises OSError: its file is still there."""
        self._notices.pop(notice_id, None)
        self._unwritten.pop(notice_id, None)
        self._path(notice_id).unlink(missing_ok=True)

    def _path(self, notice_id: str) -> Path:
        return self.folder / f"{notice_id}.notice"
