"""Patrols on other machines: a task is a zip of the patrol's folder and its house, its result that folder's zip."""

from __future__ import annotations

import functools
import os
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from rosbot_patrol.counts import count_of
from rosbot_patrol.ros.campaign.cluster import Task, digest_of, pack, serve, unpack
from rosbot_patrol.ros.campaign.runner import Job, Runner, own_space

PROGRAM = "ROSBOT_PATROL_CAMPAIGN"  # variable of a worker: the program that plays a patrol

_READ = ("launch", "config", "models", "params", "maps", "worlds", "urdf")  # besides the sources


def patrols_of(root: Path, words: Sequence[str]) -> Task:
    """Patrols as a task.

    Args:
        root: folder of the package.
        words: arguments of the program that plays a patrol.
    """
    play = functools.partial(_play, list(words))
    return Task("patrol", play, sources_digest(root), _digest_here, "campaign --work")


def sources_digest(root: Path) -> str:
    """Digest of everything that decides how a patrol goes: sources, launch files, settings, networks, houses."""
    return digest_of(root, _READ)


def work(address: str, jobs: int) -> None:
    """Play patrols for a scheduler until it is gone. Raises ClusterError."""
    os.environ.setdefault(PROGRAM, str(Path(sys.argv[0]).resolve()))
    serve(address, jobs, f"plays {count_of(jobs, 'patrol')} at a time")


def _play(words: list[str], data: bytes, name: str, digest: str) -> tuple[str, bytes]:
    """Play one patrol on a worker: `Task.work`, after the arguments of the program."""
    if _digest_here() != digest:
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


def _digest_here() -> str:
    from rosbot_patrol.ros.campaign.node import package_root

    return sources_digest(package_root())
