"""Patrols on other machines, as tasks of dask.distributed.

A task is a zip of the patrol's folder and its house; its result is the zip of the folder afterwards. A worker that ends
has its patrol played by another one. Workers with other sources than ours are sent away, because their results would
not belong to the same campaign.
"""

from __future__ import annotations

import asyncio
import hashlib
import io
import os
import sys
import tempfile
import time
import zipfile
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

from rosbot_patrol import errors
from rosbot_patrol.counts import count_of
from rosbot_patrol.errors import PatrolError
from rosbot_patrol.ros.campaign.runner import Job, Runner, own_space

PROGRAM = "ROSBOT_PATROL_CAMPAIGN"  # variable of a worker: the program that plays a patrol

_PATIENCE = 10.0  # for the scheduler's first answer [s]
_POLL = 0.2  # between two looks at what has ended [s]
_GONE = 60.0  # a worker without a scheduler ends after this time [s]
_REMIND = 30.0  # between two sentences about missing workers [s]
_READ = ("launch", "config", "models", "params", "maps", "worlds", "urdf")  # besides the sources


class ClusterError(PatrolError):
    """The scheduler cannot be reached, or dask.distributed is missing."""


def sources_digest(root: Path) -> str:
    """Digest of everything that decides how a patrol goes: sources, launch files, settings, networks, houses."""
    digest = hashlib.sha256()
    package = Path(errors.__file__).parent
    files = [*((p, p.relative_to(package)) for p in package.rglob("*.py"))]
    files += [(p, p.relative_to(root)) for name in _READ for p in (root / name).rglob("*") if p.is_file()]
    for path, name in sorted(files, key=lambda pair: str(pair[1])):
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


def play_packed(data: bytes, name: str, words: Sequence[str], digest: str, root: str) -> tuple[str, bytes]:
    """Play one patrol on a worker.

    Args:
        data: zip of its folder and its house.
        name: of its folder.
        words: arguments of the program.
        digest: of the sources, by `sources_digest`.
        root: folder of the package on the worker; empty: as the worker finds it.

    Returns:
        A problem, "" for none, and the zip of the folder; no zip if the worker has other sources.
    """
    from rosbot_patrol.ros.campaign.node import package_root

    here = Path(root) if root else package_root()
    if sources_digest(here) != digest:
        return "other sources", b""
    with tempfile.TemporaryDirectory(prefix="patrol-") as temporary:
        folder = Path(temporary)
        unpack(data, folder)
        patrol = folder / name
        prefix = own_space()
        program = os.environ.get(PROGRAM, sys.argv[0])
        command = [sys.executable, program, "--one", str(patrol), *words, *(["--space"] if prefix else [])]
        limit = float(words[words.index("--timeout") + 1])
        problems: list[str] = []
        job = Job(name, command, patrol / "campaign.log", limit)
        Runner(1, prefix, (), lambda _, problem: problems.append(problem)).run([job])
        return problems[0], pack(folder, [patrol])


def work(address: str, jobs: int) -> None:
    """Serve a scheduler until it is gone. Raises ClusterError."""
    worker_class = _distributed().Worker
    os.environ.setdefault(PROGRAM, str(Path(sys.argv[0]).resolve()))

    async def serve() -> None:
        async with worker_class(address, nthreads=jobs, memory_limit=0, death_timeout=_GONE) as worker:
            print(f"{worker.address} plays {count_of(jobs, 'patrol')} at a time for {address}", flush=True)
            await worker.finished()

    try:
        asyncio.run(serve())
    except (TimeoutError, OSError) as err:
        raise ClusterError(f"the scheduler {address} does not answer: {err}") from err


class Cluster:
    """The workers of a scheduler.

    Args:
        address: of the scheduler, such as tcp://host:8786.
        root: folder of the package.
        words: arguments of the program that plays a patrol.
        patience: for its first answer [s].

    Raises:
        ClusterError: it does not answer.
    """

    def __init__(self, address: str, root: Path, words: Sequence[str], *, patience: float = _PATIENCE) -> None:
        self._address, self._words = address, list(words)
        self._digest = sources_digest(root)
        try:
            self._client = _distributed().Client(address, timeout=patience, set_as_default=False)
        except (OSError, ValueError) as err:
            raise ClusterError(f"the scheduler {address} does not answer: {err}") from err

    def run(self, patrols: Iterable[tuple[str, bytes]], done: Callable[[str, str, bytes], None]) -> None:
        """Play patrols; returns when the last one has ended.

        Args:
            patrols: name of the folder, and the zip of it and its house; asked for when a worker is nearly free.
            done: called with the name, the problem, and the zip of the folder afterwards.

        Raises:
            ClusterError: the scheduler is gone.
        """
        waiting = iter(patrols)
        running: dict[Any, tuple[str, bytes]] = {}
        told = -_REMIND
        while True:
            threads = sum(self._client.nthreads().values()) if self._is_there() else 0
            if not threads and time.monotonic() - told > _REMIND:
                told = time.monotonic()
                print(f"no worker is there: start one with `campaign --work {self._address}`", flush=True)
            while len(running) < threads + 1:
                patrol = next(waiting, None)
                if patrol is None:
                    break
                running[self._submit(*patrol)] = patrol
            if not running:
                return
            for future in self._ended(list(running)):
                name, data = running.pop(future)
                again = self._take(future, name, done)
                if again:
                    running[self._submit(name, data)] = name, data

    def close(self) -> None:
        """Leave the scheduler; what still runs there is given up."""
        self._client.close()

    def _is_there(self) -> bool:
        if self._client.status != "running":
            raise ClusterError(f"the scheduler {self._address} is gone")
        return True

    def _submit(self, name: str, data: bytes) -> Any:
        key = f"patrol-{name}-{time.monotonic_ns()}"
        return self._client.submit(play_packed, data, name, self._words, self._digest, "", key=key, pure=False)

    def _ended(self, futures: list[Any]) -> list[Any]:
        """Those that have ended, after a moment."""
        time.sleep(_POLL)
        self._is_there()
        return [future for future in futures if future.status != "pending"]

    def _take(self, future: Any, name: str, done: Callable[[str, str, bytes], None]) -> bool:
        """Take a result; whether the patrol has to be played again."""
        if future.status == "cancelled":
            self._is_there()
            return True
        if future.status == "error":
            done(name, f"could not be played by any worker: {future.exception()}", b"")
            return False
        problem, data = future.result()
        if data:
            done(name, problem, data)
            return False
        future.release()  # a worker that still holds a result does not go
        refused = self._other_workers()
        print(f"{', '.join(refused)}: other sources than here, sent away; give it the same commit", flush=True)
        self._client.retire_workers(refused)
        return True

    def _other_workers(self) -> list[str]:
        """Addresses of the workers with other sources."""
        found = self._client.run(_digest_here)
        return [address for address, digest in found.items() if digest != self._digest]


def _digest_here() -> str:
    from rosbot_patrol.ros.campaign.node import package_root

    return sources_digest(package_root())


def _distributed() -> Any:
    try:
        import distributed
    except ImportError as err:
        raise ClusterError("dask.distributed is missing: sudo apt-get install python3-distributed") from err
    return distributed
