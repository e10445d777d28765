"""A file that holds room on the disk, to be given up when the disk is full."""

from __future__ import annotations

import logging
import os
import time
from pathlib import Path

from rosbot_patrol.files import sync_folder

log = logging.getLogger(__name__)


class DiskReserve:
    """Room on the disk.

    Args:
        path: of the file, in a folder that exists when the reserve is used.
        size: of the whole reserve [bytes].
    """

    def __init__(self, path: Path, size: int) -> None:
        self.path, self._size = path, size

    @property
    def held(self) -> int:
        """Room that is held now [bytes]. Raises OSError."""
        try:
            return self.path.stat().st_size if self.path.is_file() else 0
        except FileNotFoundError:
            return 0

    def fill(self, *, only_with: int = 0) -> None:
        """Hold the whole reserve again.

        Args:
            only_with: free room below which nothing is done [bytes].

        Raises:
            OSError: the disk does not take it; what was held before is held still.
        """
        held = self.held
        system = os.statvfs(self.path.parent)
        if held >= self._size or system.f_bavail * system.f_frsize < only_with:
            return
        if self.path.is_dir():  # after a repair of the disk
            aside = self.path.with_name(f"{self.path.name}-{time.time_ns()}")
            log.warning("%s is a folder where a file is expected: it is now called %s", self.path, aside.name)
            self.path.rename(aside)
        handle = os.open(self.path, os.O_RDWR | os.O_CREAT, 0o600)
        try:
            os.posix_fallocate(handle, 0, self._size)
        except OSError:
            os.ftruncate(handle, held)
            if not held:
                self.path.unlink()
            raise
        finally:
            os.close(handle)
        sync_folder(self.path.parent)

    def give(self, size: int) -> int:
        """Give up some of the room; returns how much there was [bytes]. Raises OSError."""
        held = self.held
        given = min(held, size)
        if given:
            os.truncate(self.path, held - given)
        return given
