"""One holder at a time: what gives signs of life keeps the lock, what hangs loses it."""

from __future__ import annotations

import errno
import os
import time
from pathlib import Path

import pytest

from rosbot_patrol.alerts.dispatch import file_lock
from rosbot_patrol.alerts.dispatch.file_lock import FileLock


class Clock:
    """Seconds that the test moves."""

    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "lock"


def wait_beside(waiter: FileLock, clock: Clock, seconds: float) -> bool:
    """Ask for the lock five times a second until it is held, or the time is over."""
    for _ in range(round(seconds * 5)):
        if waiter.take():
            return True
        clock.now += 0.2
    return False


def test_one_holds_it_and_the_next_gets_it_back(path: Path) -> None:
    first, second = FileLock(path, "patrol"), FileLock(path, "watch")
    assert first.take()
    assert first.take()
    assert not second.take()
    assert second.holder() == f"patrol (process {os.getpid()})"
    first.release()
    assert not first.is_held
    assert second.take()
    assert second.seized_from == ""


def test_who_gives_no_sign_of_life_loses_it_and_finds_out(path: Path) -> None:
    clock = Clock()
    hung, waiter = FileLock(path, "patrol", clock=clock), FileLock(path, "watch", clock=clock)
    assert hung.take()
    assert not wait_beside(waiter, clock, 19.0)
    assert wait_beside(waiter, clock, 3.0)
    assert waiter.seized_from == f"patrol (process {os.getpid()})"
    assert not hung.is_held
    assert not hung.take()
    assert waiter.is_held


def test_signs_of_life_from_a_thread_keep_it(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(file_lock, "BEAT", 0.02)
    busy, waiter = FileLock(path, "notify", stale_after=0.5), FileLock(path, "patrol", stale_after=0.5)
    assert busy.take()
    with busy.beating():
        before, until = os.stat(path).st_mtime_ns, time.monotonic() + 1.0
        while time.monotonic() < until:
            assert not waiter.take()
            time.sleep(0.01)
        assert os.stat(path).st_mtime_ns > before
    assert busy.is_held
    silent = os.stat(path).st_mtime_ns
    time.sleep(0.1)
    assert os.stat(path).st_mtime_ns == silent  # the thread has ended


def test_a_waiter_that_slept_itself_does_not_count_that_as_silence(path: Path) -> None:
    clock = Clock()
    holder, waiter = FileLock(path, clock=clock), FileLock(path, clock=clock)
    assert holder.take()
    for _ in range(10):
        assert not waiter.take()
        clock.now += 60.0


def test_of_two_that_wait_one_gets_it(path: Path) -> None:
    clock = Clock()
    hung, one, other = (FileLock(path, name, clock=clock) for name in ("patrol", "one", "other"))
    assert hung.take()
    for _ in range(150):
        held = [lock for lock in (one, other) if lock.take()]
        clock.now += 0.2
        assert len(held) <= 1
    assert held == [one]


def test_a_file_that_is_removed_ends_it(path: Path) -> None:
    lock = FileLock(path)
    assert lock.take()
    path.unlink()
    assert not lock.is_held
    assert lock.holder() == ""
    assert lock.take()
    assert path.exists()


def test_one_that_comes_as_the_file_is_replaced_waits(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It locks the old file, which is no longer at the path."""
    real = file_lock._try_lock

    def replaced(handle: int) -> bool:
        path.with_name("new").write_text("")
        path.with_name("new").replace(path)
        return real(handle)

    lock = FileLock(path)
    with monkeypatch.context() as patched:
        patched.setattr(file_lock, "_try_lock", replaced)
        assert not lock.take()
    assert not lock.is_held
    assert lock.take()


def test_a_file_system_without_locks_is_an_error(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def none(handle: int, how: int) -> None:
        raise OSError(errno.ENOLCK, "No locks available")

    monkeypatch.setattr(file_lock.fcntl, "flock", none)
    with pytest.raises(OSError, match="No locks"):
        FileLock(path).take()
