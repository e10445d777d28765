"""A lock that one process of a machine holds, and that it loses when it ends, however it ends, or when it hangs.

The system takes back the lock of a process that ends, not that of one that is stopped or stuck. So who holds it gives
signs of life, by the file's time, and who waits for it may put a new file in its place when they have stayed away. The
old holder, if it goes on, finds that the file it has locked is no longer the one at the path.
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
        path: of the file; is made where missing and never removed. `PATH.seize` beside it guards a change of hands.
        who: what to write into it while it is held.
        stale_after: a holder that gave no sign of life for so long has lost it [s].
        clock: any monotonic one [s].
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
        self.seized_from = ""  # who lost it to this object, "" where it was free

    @property
    def is_held(self) -> bool:
        """Whether this object holds it, and has not lost it while its process hung."""
        return self._handle is not None and self._is_at_path(self._handle)

    @property
    def is_lost(self) -> bool:
        """Whether it was taken from this object."""
        return self._handle is not None and not self._is_at_path(self._handle)

    def take(self) -> bool:
        """Take it where nobody has it; returns whether it is held now.

        Call it again and again: where it is held it gives a sign of life, else it looks for those of the holder.

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
        if not self._is_at_path(handle):  # another has put a new one in its place at this moment
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
            with contextlib.suppress(OSError):  # a disk that takes no time of a file takes no other's lock either
                os.utime(self._handle)

    @contextlib.contextmanager
    def beating(self) -> Iterator[None]:
        """Give signs of life from a thread, for a program that is busy with one thing for long."""
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
        """Give it back."""
        with self._guard:
            if self._handle is not None:
                os.close(self._handle)
                self._handle = None

    def holder(self) -> str:
        """Who wrote into it last, "" where nobody did."""
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
        """Whether its holder has given no sign of life for too long, as this process saw it with its own clock."""
        now, mark = self._clock(), self._mark()
        if mark is None or mark != self._seen:
            self._seen, self._quiet = mark, 0.0
        else:
            self._quiet += min(max(now - self._looked, 0.0), BEAT)  # what this process slept through counts for little
        self._looked = now
        return self._quiet >= self._stale_after

    def _mark(self) -> tuple[int, int] | None:
        try:
            found = os.stat(self.path)
        except FileNotFoundError:
            return None
        return found.st_ino, found.st_mtime_ns

    def _seize(self) -> bool:
        """Put a new file, locked by this process, in the place of the one whose holder hangs."""
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
        try:  # for people only: a full disk does not matter
            os.ftruncate(handle, 0)
            os.pwrite(handle, f"{self._who} (process {os.getpid()})\n".encode(), 0)
        except OSError:
            return


class NoLock:
    """The lock of what no other process can reach: always held."""

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
    """Open the lock's file, for reading only where the disk takes nothing: it can be locked all the same.

    Returns:
        The handle, and whether its holder could give signs of life.
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
    """Lock an open file where nobody has; raises OSError where files cannot be locked."""
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as err:
        if err.errno in (errno.EWOULDBLOCK, errno.EACCES):
            return False
        raise
    return True
