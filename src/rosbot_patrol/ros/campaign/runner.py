"""Runner of programs that may fail: several at once, each isolated and within a time limit.

Houses that run side by side each get their own network and process space, if the system provides them.

In such a space every house uses the same ports, and everything started in it ends with it.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
import signal
import socket
import struct
import subprocess
import threading
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from dataclasses import dataclass
from pathlib import Path

GRACE = 30.0  # time beyond a program's own limit [s]

_LIMIT = ("timeout", "--foreground", "-s", "KILL")  # inside a wrapping lock, because the wait for the lock has no limit
_KILLED = (137, -signal.SIGKILL)


@dataclass(frozen=True)
class Job:
    """A program to run.

    Attributes:
        name: for people.
        command: with its arguments; log: file of its output.
        limit: time in which it should end by itself [s].
    """

    name: str
    command: Sequence[str]
    log: Path
    limit: float


class Runner:
    """Runs jobs.

    Args:
        jobs: number of jobs at once.
        prefix: command that isolates each job; if it is empty, they run one after another.
        wrap: command around each job, such as a lock.
        done: called when a job ends, with the job and its problem, "" if none.
    """

    def __init__(self, jobs: int, prefix: Sequence[str], wrap: Sequence[str], done: Callable[[Job, str], None]) -> None:
        self._count = jobs if prefix else 1
        self._prefix, self._wrap, self._done = list(prefix), list(wrap), done
        self._stopped = threading.Event()
        self._lock = threading.Lock()
        self._running: set[subprocess.Popen[bytes]] = set()

    def run(self, jobs: Iterable[Job]) -> None:
        """Run all; returns when the last has ended, or after `stop`.

        Raises the errors of `jobs` or `done`; no further job is started then.
        """
        waiting = iter(jobs)
        pool = ThreadPoolExecutor(self._count)
        futures = [pool.submit(self._work, waiting) for _ in range(self._count)]
        pool.shutdown(wait=False)
        while wait(futures, 0.2).not_done:  # in pieces, so that Ctrl-C is heard
            if any(future.done() and future.exception() for future in futures):
                self._stopped.set()  # running jobs may end
        for future in futures:
            future.result()

    def stop(self) -> None:
        """End the running jobs, and start no more."""
        self._stopped.set()
        with self._lock:
            for process in self._running:
                _end(process)

    def _work(self, waiting: Iterable[Job]) -> None:
        while not self._stopped.is_set():
            with self._lock:
                job = next(iter(waiting), None)
            if job is None:
                return
            problem = self._run(job)
            if not self._stopped.is_set():
                self._done(job, problem)

    def _run(self, job: Job) -> str:
        job.log.parent.mkdir(parents=True, exist_ok=True)
        try:
            with job.log.open("ab") as out:
                process = subprocess.Popen(
                    [*self._wrap, *_LIMIT, f"{job.limit + GRACE:.0f}", *self._prefix, *job.command],
                    stdin=subprocess.DEVNULL,
                    stdout=out,
                    stderr=subprocess.STDOUT,
                    start_new_session=True,
                )
        except OSError as err:
            return f"could not be started: {err}"
        with self._lock:
            self._running.add(process)
        status = process.wait()
        with self._lock:
            self._running.discard(process)
        if status in _KILLED:
            return f"did not end within {job.limit + GRACE:.0f} s"
        return "" if status == 0 else f"ended with status {status}, see {job.log}"


def _end(process: subprocess.Popen[bytes]) -> None:
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)  # killing the leader of a space ends everything in it
    with contextlib.suppress(subprocess.TimeoutExpired):
        process.wait(10.0)


_SPACE = ["unshare", "--net", "--pid", "--fork", "--kill-child", "--mount-proc"]
_SIOCSIFFLAGS, _UP_AND_RUNNING = 0x8914, 0x41


def own_space() -> list[str]:
    """Command that isolates the command after it; empty if the system refuses."""
    for prefix in (_SPACE, [_SPACE[0], "--user", "--map-root-user", *_SPACE[1:]]):
        try:
            if subprocess.run([*prefix, "true"], capture_output=True, timeout=20.0).returncode == 0:
                return prefix
        except (OSError, subprocess.TimeoutExpired):
            return []
    return []


def raise_loopback() -> None:
    """Make localhost work in an isolated space. Raises OSError."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as any_socket:
        fcntl.ioctl(any_socket, _SIOCSIFFLAGS, struct.pack("16sh", b"lo", _UP_AND_RUNNING))
