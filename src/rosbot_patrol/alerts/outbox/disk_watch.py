"""Watch on the disk of the state folder: does it take what is written, and what has the owner to know about it?"""

from __future__ import annotations

import time
from pathlib import Path

from rosbot_patrol.alerts.outbox.notice import Notice

PATIENCE = 10.0  # [s] without a success until the owner is told; a disk that is full for a moment is no news


class DiskWatch:
    """Hears of failures and successes, and gives one notice when the disk is gone and one when it is back.

    Args:
        folder: the state folder.
        patience: time without a success until the disk counts as gone [s].
    """

    def __init__(self, folder: Path, *, patience: float = PATIENCE) -> None:
        self._folder, self._patience = folder, patience
        self._failed_at: float | None = None
        self._wall = 0.0
        self._error: OSError | None = None
        self._is_reported = False

    @property
    def error(self) -> OSError | None:
        """The disk's last error, None while it takes everything."""
        return self._error

    def failed(self, error: OSError, now: float, wall: float) -> None:
        """Note that something could not be written at `now` [s], `wall` seconds since 1970."""
        if self._failed_at is None:
            self._failed_at, self._wall = now, wall
        self._error = error

    def worked(self) -> None:
        """Note that something was written."""
        self._failed_at = self._error = None

    def notice(self, now: float, wall: float) -> Notice | None:
        """The notice that is due now, None if there is nothing new."""
        if self._error is not None and self._failed_at is not None:
            if self._is_reported or now - self._failed_at < self._patience:
                return None
            self._is_reported = True
            return self._gone(self._error, wall)
        if not self._is_reported:
            return None
        self._is_reported = False
        return self._back(wall)

    def _gone(self, error: OSError, wall: float) -> Notice:
        text = (
            f"The robot cannot write to its disk since {_clock(self._wall)}: {error.strerror or error}.\n\n"
            "It goes on guarding, and what it has to tell reaches you all the same. But notices that nobody could"
            " deliver yet, and the records of its missions, are lost if the robot is switched off before the disk"
            f" works again.\n\nLook at the folder {self._folder}: is the disk full, mounted read-only, or gone?"
        )
        subject = "rosbot patrol: the robot's disk takes nothing"
        return Notice(id=f"disk-gone-{wall:.3f}", wall=wall, kind="fault", subject=subject, text=text)

    def _back(self, wall: float) -> Notice:
        text = (
            f"The robot's disk takes again what is written. It did not from {_clock(self._wall)} to {_clock(wall)}.\n\n"
            "What was kept in memory meanwhile is on the disk now."
        )
        subject = "rosbot patrol: the robot's disk works again"
        return Notice(id=f"disk-back-{wall:.3f}", wall=wall, kind="fault", subject=subject, text=text)


def _clock(wall: float) -> str:
    return time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(wall))
