"""Draw training pictures for as long as somebody learns them: all kinds in turns, with the shares of `kinds.py`.

Each shard, `stream-00007.npy` with its npz, is as `render.py` writes it, and depends on the seed and its number only.
"""

from __future__ import annotations

import itertools
import multiprocessing
import os
from multiprocessing.process import BaseProcess
from pathlib import Path
from time import sleep

import cv2
import numpy as np

from training.pictures.kinds import KINDS, Kind
from training.pictures.render import studio_of, write_shard

PER_SHARD, WAITING = 250, 80
ROUND = [kind for kind in KINDS for _ in range(kind.parts)]


def kind_of(number: int, seed: int) -> Kind:
    """The kind of a shard by its number: all of a round in an order by chance, then all again."""
    order = np.random.default_rng([seed, 77, number // len(ROUND)]).permutation(len(ROUND))
    return ROUND[int(order[number % len(ROUND)])]


def draw(folder: Path, worlds: Path, seed: int, first: int, step: int, *, last: int | None = None) -> None:
    """Draw the shards `first`, `first` + `step` and so on before `last` into a folder; waits while it is full."""
    cv2.setNumThreads(1)
    os.nice(5)
    for number in itertools.count(first, step):
        if last is not None and number >= last:
            return
        while len(list(folder.glob("stream-*.npy"))) > WAITING:
            sleep(0.5)
        kind = kind_of(number, seed)
        shard = studio_of(kind.world(worlds)).shard([seed, number, 2], PER_SHARD, test=False, **kind.told)
        write_shard(folder / f"stream-{number:05d}.npy", *shard)


def start(folder: Path, worlds: Path, seed: int, processes: int, first: int = 0) -> list[BaseProcess]:
    """Processes that draw the shards from `first` on into a folder; they end with the process that started them."""
    for name in ("LP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
        os.environ[name] = "1"
    context = multiprocessing.get_context("spawn")
    started: list[BaseProcess] = []
    for k in range(processes):
        process = context.Process(target=draw, args=(folder, worlds, seed, first + k, processes), daemon=True)
        process.start()
        started.append(process)
    return started
