"""A lock that one process of a machine holds, and that the system takes back however the process ends."""

from __future__ import annotations

import errno
import fcntl
import os
from pathlib import Path


class FileLock:
    """A lock on a file.

    Args:
        path: of the file; is made where missing and never removed.
        who: what to write into it while it is held.
    """

    def __init__(self, path: Path, who: str = "") -> None:
        self.path, self._who = path, who
        self._handle: int | None = None

    @property
    def is_held(self) -> bool:
        """Whether this object holds it."""
        return self._handle is not None

    def take(self) -> bool:
        """Take it where nobody has it; returns whether it is held now. Raises OSError where files cannot be locked."""
        if self._handle is not None:
            return True
        handle = os.open(self.path, os.O_RDWR | os.O_CREAT, 0o644)
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as err:
            os.close(handle)
            if err.errno in (errno.EWOULDBLOCK, errno.EACCES):
                return False
            raise
        self._handle = handle
        self._sign(handle)
        return True

    def release(self) -> None:
        """Give it back."""
        if self._handle is not None:
            os.close(self._handle)
            self._handle = None

    def holder(self) -> str:
        """Who wrote into it last, "" where nobody did."""
        try:
            return self.path.read_text(encoding="utf-8", errors="replace").strip()
        except OSError:
            return ""

    def _sign(self, handle: int) -> None:
        try:  # for people only: a full disk does not matter
            os.ftruncate(handle, 0)
            os.pwrite(handle, f"{self._who} (process {os.getpid()})\n".encode(), 0)
        except OSError:
            return
