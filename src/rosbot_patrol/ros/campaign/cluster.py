"""Work on other machines, as tasks of dask.distributed.

A worker that ends has its piece of work done by another one. Workers with other sources than ours are sent away: their
results would not belong with the rest.
"""

from __future__ import annotations

import asyncio
import hashlib
import io
import logging
import time
import zipfile
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rosbot_patrol import errors
from rosbot_patrol.errors import PatrolError

_PATIENCE = 10.0  # for the scheduler's first answer [s]
_POLL = 0.2  # between two looks at what has ended [s]
_GONE = 60.0  # a worker without a scheduler ends after this time [s]
_REMIND = 30.0  # between two sentences about missing workers [s]


class ClusterError(PatrolError):
    """The scheduler cannot be reached, or dask.distributed is missing."""


@dataclass(frozen=True)
class Task:
    """A kind of work.

    Attributes:
        name: of one piece, such as "patrol".
        work: does a piece on a worker. It takes the piece's data, its name, and `digest`; it returns a problem, "" for
            none, and the result; no result if the worker has other sources.
        digest: of the sources here.
        find_digest: called on a worker, gives the digest of its sources.
        start: command that starts a worker.
    """

    name: str
    work: Callable[[bytes, str, str], tuple[str, bytes]]
    digest: str
    find_digest: Callable[[], str]
    start: str


def digest_of(root: Path, folders: Iterable[str]) -> str:
    """Digest of the package's sources, and of the files below folders of a root."""
    digest = hashlib.sha256()
    package = Path(errors.__file__).parent
    files = [*((p, p.relative_to(package)) for p in package.rglob("*.py"))]
    files += [(p, p.relative_to(root)) for name in folders for p in (root / name).rglob("*") if p.is_file()]
    for path, name in sorted(files, key=lambda pair: str(pair[1])):
        if path.suffix != ".pyc":
            digest.update(str(name).encode() + b"\0" + hashlib.sha256(path.read_bytes()).digest())
    return digest.hexdigest()[:16]


def pack(folder: Path, parts: Iterable[Path]) -> bytes:
    """Zip files and folders, by their names below a folder."""
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w", zipfile.ZIP_DEFLATED) as archive:
        for part in parts:
            for path in sorted(part.rglob("*")) if part.is_dir() else [part]:
                if path.is_file():
                    archive.write(path, path.relative_to(folder))
    return data.getvalue()


def unpack(data: bytes, folder: Path) -> None:
    """Unzip into a folder."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        archive.extractall(folder)


def serve(address: str, jobs: int, what: str) -> None:
    """Work for a scheduler until it is gone.

    Args:
        address: of the scheduler.
        jobs: pieces at a time.
        what: it does, for people, such as "plays 1 patrol at a time".

    Raises:
        ClusterError: it does not answer.
    """
    worker_class = _distributed().Worker
    logging.getLogger("distributed").setLevel(logging.ERROR)  # it tells of every connection

    async def run() -> None:
        async with worker_class(address, nthreads=jobs, memory_limit=0, death_timeout=_GONE) as worker:
            print(f"{worker.address} {what} for {address}", flush=True)
            await worker.finished()

    try:
        asyncio.run(run())
    except (TimeoutError, OSError) as err:
        raise ClusterError(f"the scheduler {address} does not answer: {err}") from err


class Cluster:
    """The workers of a scheduler.

    Args:
        address: of the scheduler, such as tcp://host:8786.
        task: what they do.
        patience: for its first answer [s].

    Raises:
        ClusterError: it does not answer.
    """

    def __init__(self, address: str, task: Task, *, patience: float = _PATIENCE) -> None:
        self._address, self._task = address, task
        try:
            self._client = _distributed().Client(address, timeout=patience, set_as_default=False)
        except (OSError, ValueError) as err:
            raise ClusterError(f"the scheduler {address} does not answer: {err}") from err

    def results(self, pieces: Iterable[tuple[str, bytes]]) -> Iterator[tuple[str, str, bytes]]:
        """Have pieces of work done; yields the name, the problem and the result of each as it ends.

        Args:
            pieces: name and data of each; asked for when a worker is nearly free.

        Raises:
            ClusterError: the scheduler is gone.
        """
        waiting = iter(pieces)
        running: dict[Any, tuple[str, bytes]] = {}
        told = -_REMIND
        while True:
            threads = sum(self._client.nthreads().values()) if self._is_there() else 0
            if not threads and time.monotonic() - told > _REMIND:
                told = time.monotonic()
                print(f"no worker is there: start one with `{self._task.start} {self._address}`", flush=True)
            while len(running) < threads + 1:
                piece = next(waiting, None)
                if piece is None:
                    break
                running[self._submit(*piece)] = piece
            if not running:
                return
            for future in self._ended(list(running)):
                piece = running.pop(future)
                result = self._result(future)
                if result is None:
                    running[self._submit(*piece)] = piece
                else:
                    yield piece[0], *result

    def close(self) -> None:
        """Leave the scheduler; what still runs there is given up."""
        self._client.close()

    def _is_there(self) -> bool:
        if self._client.status != "running":
            raise ClusterError(f"the scheduler {self._address} is gone")
        return True

    def _submit(self, name: str, data: bytes) -> Any:
        task = self._task
        key = f"{task.name}-{name}-{time.monotonic_ns()}"
        return self._client.submit(task.work, data, name, task.digest, key=key, pure=False)

    def _ended(self, futures: list[Any]) -> list[Any]:
        """Those that have ended, after a moment."""
        time.sleep(_POLL)
        self._is_there()
        return [future for future in futures if future.status != "pending"]

    def _result(self, future: Any) -> tuple[str, bytes] | None:
        """The problem and the result; None if the work has to be done again."""
        if future.status == "cancelled":
            self._is_there()
            return None
        if future.status == "error":
            return f"no worker could do it: {future.exception()}", b""
        problem, data = future.result()
        if data:
            return problem, data
        future.release()  # a worker that still holds a result does not go
        refused = self._other_workers()
        print(f"{', '.join(refused)}: other sources than here, sent away; give it the same commit", flush=True)
        self._client.retire_workers(refused)
        return None

    def _other_workers(self) -> list[str]:
        """Addresses of the workers with other sources."""
        found = self._client.run(self._task.find_digest)
        return [address for address, digest in found.items() if digest != self._task.digest]


def _distributed() -> Any:
    try:
        import distributed
    except ImportError as err:
        raise ClusterError("dask.distributed is missing: sudo apt-get install python3-distributed") from err
    return distributed
