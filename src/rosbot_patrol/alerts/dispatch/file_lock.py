"""A lock that one process of a machine holds until it ends, however it ends, or hangs.

The system takes back the lock of a process that ends, but not of one that is stopped or stuck. So the holder gives
signs of life: it renews the file's time. If they stay away, a process that waits puts a new file in the place of the
old one. If the old holder goes on, it finds that its locked file is no longer the one at the path.
"""

from __future__ import annotations

import contextlib
import errno
import fcntl
import os
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

STALE = 20.0  # [s] without a sign of life; a slow disk may hold one up for seconds
BEAT = 1.0  # [s] between signs of life


class FileLock:
    """A lock on a file.

    Args:
        path: file of the lock; made if missing, never removed. `PATH.seize` beside it guards a change of hands.
        who: text for the file while the lock is held.
        stale_after: time without a sign of life after which the holder loses the lock [s].
        clock: monotonic time [s].

    Attributes:
        seized_from: the holder that lost the lock to this object, "" if it was free.
    """

    def __init__(
        self, path: Path, who: str = "", *, stale_after: float = STALE, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self.path, self._who = path, who
        self._stale_after, self._clock = stale_after, clock
        self._handle: int | None = None
        self._guard = threading.Lock()  # of the handle, between signs of life and its end
        self._beaten = float("-inf")
        self._seen: tuple[int, int] | None = None  # of another's file: inode, and time of its last sign of life
        self._quiet, self._looked = 0.0, 0.0
        self.seized_from = ""

    @property
    def is_held(self) -> bool:
        """Whether this object holds the lock, and did not lose it while its process hung."""
        return self._handle is not None and self._is_at_path(self._handle)

    @property
    def is_lost(self) -> bool:
        """Whether it was taken from this object."""
        return self._handle is not None and not self._is_at_path(self._handle)

    def take(self) -> bool:
        """Take the lock if nobody has it.

        Call it again and again. If this object holds the lock, it gives a sign of life. Otherwise it looks for those of
        the holder.

        Returns:
            Whether this object holds it now.

        Raises:
            OSError: files cannot be locked there.
        """
        if self.is_held:
            self.beat()
            return True
        self.release()
        handle, can_beat = _open(self.path)
        if not _try_lock(handle):
            os.close(handle)
            return can_beat and self._is_stale() and self._seize()
        if not self._is_at_path(handle):  # another process has just put a new file in its place
            os.close(handle)
            return False
        self._begin(handle)
        return True

    def beat(self) -> None:
        """Give a sign of life, once a second at most."""
        with self._guard:
            if self._handle is None or 0.0 <= self._clock() - self._beaten < BEAT:
                return
            self._beaten = self._clock()
            with contextlib.suppress(OSError):  # if the time cannot be written, nobody else can take the lock either
                os.utime(self._handle)

    @contextlib.contextmanager
    def beating(self) -> Iterator[None]:
        """Give signs of life from a thread meanwhile, for a program that is busy with one thing for long."""
        over = threading.Event()

        def work() -> None:
            while not over.wait(BEAT):
                self.beat()

        thread = threading.Thread(target=work, name="lock", daemon=True)
        thread.start()
        try:
            yield
        finally:
            over.set()
            thread.join()

    def release(self) -> None:
        """Give the lock back."""
        with self._guard:
            if self._handle is not None:
                os.close(self._handle)
                self._handle = None

    def holder(self) -> str:
        """The last holder's text, "" if there is none."""
        try:
            return self.path.read_text(encoding="utf-8", errors="replace").strip()
        except OSError:
            return ""

    def _is_at_path(self, handle: int) -> bool:
        try:
            return os.fstat(handle).st_ino == os.stat(self.path).st_ino
        except OSError:
            return False

    def _is_stale(self) -> bool:
        """Whether the holder has given no sign of life for too long, by this process's own clock."""
        now, mark = self._clock(), self._mark()
        if mark is None or mark != self._seen:
            self._seen, self._quiet = mark, 0.0
        else:
            self._quiet += min(max(now - self._looked, 0.0), BEAT)  # gaps in our own calls are not counted as silence
        self._looked = now
        return self._quiet >= self._stale_after

    def _mark(self) -> tuple[int, int] | None:
        try:
            found = os.stat(self.path)
        except FileNotFoundError:
            return None
        return found.st_ino, found.st_mtime_ns

    def _seize(self) -> bool:
        """Put a new file, locked by this process, in the place of the hanging holder's."""
        guard = os.open(self.path.with_name(f"{self.path.name}.seize"), os.O_RDWR | os.O_CREAT, 0o644)
        try:
            if not _try_lock(guard) or self._mark() != self._seen:
                return False
            was = self.holder()
            fresh = self.path.with_name(f".{self.path.name}.{os.getpid()}.tmp")
            handle = os.open(fresh, os.O_RDWR | os.O_CREAT | os.O_TRUNC, 0o644)
            try:
                if not _try_lock(handle):
                    raise OSError(errno.EBUSY, "another thread of this process seizes the lock", str(fresh))
                fresh.replace(self.path)
            except OSError:
                os.close(handle)
                raise
        finally:
            os.close(guard)
        self._begin(handle, was or "another program")
        return True

    def _begin(self, handle: int, seized_from: str = "") -> None:
        self._handle, self.seized_from = handle, seized_from
        self._beaten, self._seen = float("-inf"), None
        self._sign(handle)
        self.beat()

    def _sign(self, handle: int) -> None:
        try:  # the text is for people only: a full disk does not matter
            os.ftruncate(handle, 0)
            os.pwrite(handle, f"{self._who} (process {os.getpid()})\n".encode(), 0)
        except OSError:
            return


class NoLock:
    """Lock for data that no other process can reach: always held."""

    path, seized_from = Path("memory"), ""
    is_held, is_lost = True, False

    def take(self) -> bool:
        """It is held."""
        return True

    def beat(self) -> None:
        """Nobody waits for a sign of life."""

    def beating(self) -> contextlib.AbstractContextManager[None]:
        """As `beat`."""
        return contextlib.nullcontext()

    def release(self) -> None:
        """It stays held."""

    def holder(self) -> str:
        """Nobody wrote into it."""
        return ""


def _open(path: Path) -> tuple[int, bool]:
    """Open the lock's file; for reading only if the disk takes nothing, which is enough for a lock.

    Returns:
        The handle, and whether a holder can give signs of life.
    """
    try:
        return os.open(path, os.O_RDWR | os.O_CREAT, 0o644), True
    except OSError as err:
        if err.errno not in (errno.EROFS, errno.EACCES):
            raise
        with contextlib.suppress(FileNotFoundError):
            return os.open(path, os.O_RDONLY), False
        raise


def _try_lock(handle: int) -> bool:
    """Lock an open file; returns whether nobody else had it. Raises OSError if files cannot be locked there."""
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as err:
        if err.errno in (errno.EWOULDBLOCK, errno.EACCES):
            return False
        raise
    return True
