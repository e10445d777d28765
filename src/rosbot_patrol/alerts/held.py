"""Notices that wait for an entry delay: on disk, but not in the outbox, so that nobody delivers them."""

from __future__ import annotations

from pathlib import Path

from rosbot_patrol.alerts.notice import Notice
from rosbot_patrol.files import write_atomic


class HeldNotices:
    """A folder of them.

    Args:
        folder: made with the first.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def has(self, notice_id: str) -> bool:
        """Whether it waits here."""
        return self._path(notice_id).exists()

    def put(self, notice: Notice) -> None:
        """Keep one. Raises OSError: nothing is kept then."""
        write_atomic(self._path(notice.id), notice.to_bytes())

    def get(self, notice_id: str) -> Notice | None:
        """One that waits, None where there is none. Raises OSError, ValueError where it cannot be read."""
        return Notice.from_bytes(self._path(notice_id).read_bytes()) if self.has(notice_id) else None

    def remove(self, notice_id: str) -> None:
        """Forget it. Raises OSError."""
        self._path(notice_id).unlink(missing_ok=True)

    def _path(self, notice_id: str) -> Path:
        return self.folder / f"{notice_id}.notice"
