"""Shards drawn on other machines, as tasks of dask.distributed: the same pictures as here.

    python -m training.pictures.afar tcp://host:8786 [--processes N]

draws for a scheduler until that is gone. `render.py --scheduler ADDRESS` asks for the pictures.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import sys
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path

from rosbot_patrol.ros.campaign.cluster import Cluster, ClusterError, Task, digest_of, pack, serve, unpack
from training.pictures.render import Job, draw

ROOT = Path(__file__).parents[2]

_READ = ("training", "worlds", "config", "test/data/villa")  # besides the package's sources


def draw_afar(address: str, jobs: Sequence[Job]) -> Iterator[str]:
    """Have shards drawn by the workers of a scheduler; yields the name of each that is there.

    Raises:
        ClusterError: the scheduler does not answer or is gone, or a shard could not be drawn.
    """
    missing = {job.target.name: job for job in jobs if not job.target.exists()}
    yield from (job.target.name for job in jobs if job.target.name not in missing)
    cluster = Cluster(address, task())
    try:
        for name, problem, data in cluster.results((name, _packed(job)) for name, job in missing.items()):
            if problem:
                raise ClusterError(f"{name}: {problem}")
            _keep(data, missing[name].target)
            yield name
    finally:
        cluster.close()


def task() -> Task:
    """Shards as a task of workers with the same sources and worlds."""
    return Task("shard", _draw, _sources(), _sources, "scripts/train_network --work")


def _sources() -> str:
    return digest_of(ROOT, _READ)


def _packed(job: Job) -> bytes:
    """What a worker has to know of a shard."""
    house = None if job.house is None else os.path.relpath(job.house.resolve(), ROOT)
    return json.dumps([job.seed, house, job.test, job.told, job.detailed, job.count]).encode()


def _draw(data: bytes, name: str, digest: str) -> tuple[str, bytes]:
    """Draw a shard on a worker: `Task.work`. The result is a zip of its files."""
    if _sources() != digest:
        return "other sources", b""
    seed, house, test, told, detailed, count = json.loads(data)
    with tempfile.TemporaryDirectory(prefix="shard-") as temporary:
        folder = Path(temporary)
        draw(Job(folder / name, tuple(seed), ROOT / house if house else None, test, told, detailed, count))
        return "", pack(folder, sorted(folder.iterdir()))


def _keep(data: bytes, target: Path) -> None:
    """Put the files of a shard into its folder: the pictures last, as a shard with pictures counts as drawn."""
    with tempfile.TemporaryDirectory(prefix="part-", dir=target.parent) as temporary:
        folder = Path(temporary)
        unpack(data, folder)
        for path in sorted(folder.iterdir(), key=lambda path: path.name == target.name):
            path.rename(target.parent / path.name)


def _work(address: str) -> None:
    try:
        serve(address, 1, "draws pictures")
    except ClusterError as err:
        sys.exit(str(err))
    except KeyboardInterrupt:
        sys.exit(130)


def main() -> None:
    """Draw for a scheduler, in several processes."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("address", help="of the scheduler")
    parser.add_argument("--processes", type=int, default=os.cpu_count() or 1, help="that draw (one a core)")
    options = parser.parse_args()
    context = multiprocessing.get_context("spawn")
    workers = [context.Process(target=_work, args=(options.address,)) for _ in range(options.processes)]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    sys.exit(max(abs(worker.exitcode or 0) for worker in workers))


if __name__ == "__main__":
    main()
