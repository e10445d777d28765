"""Train the network of a cfg file on the pictures that `render.py` made; goes on from its last checkpoint.

Seeded: order of the pictures, their recolouring and the first weights come from `--seed`. Writes darknet weights of
the running mean of the weights (EMA) after every epoch. `--minutes` counts the runs before with the same checkpoint in,
but not what a stop took away from an epoch.
"""

from __future__ import annotations

import argparse
import os
import queue
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import torch
from numpy.typing import NDArray
from tqdm import tqdm

from rosbot_patrol.detection.darknet.cfg import read_cfg
from training.learning.anchors import find_anchors, write_anchors
from training.learning.dataset import Pictures, batch_of
from training.learning.learner import Learner, computes_bf16, schedule
from training.learning.loss import Truth


class Trainer:
    """A network in training, with its optimiser and its running mean."""

    def __init__(self, options: argparse.Namespace) -> None:
        torch.manual_seed(options.seed)
        self.options = options
        if options.anchors and not options.checkpoint.exists():
            write_anchors(options.cfg, find_anchors(Pictures.open(options.data, options.name), 6, options.seed))
        self.spec = read_cfg(str(options.cfg))
        device = torch.device("cuda" if torch.cuda.is_available() else "cpu")
        self.learner = Learner(
            self.spec, device, options.rate, muon=options.muon, bf16=options.bf16, compile_it=options.compile
        )
        if options.bf16 and not computes_bf16(device):
            sys.stdout.write("computing in float32: this processor has no instructions for bfloat16\n")
        self.steps_each = options.samples // options.batch
        self.total = self.steps_each * options.epochs
        pictures = Pictures.open(options.data, options.name)
        self.pictures = pictures.pack() if options.pack else pictures
        self.epoch = 0
        self.begun = time.monotonic()  # of this run, less the time that those before it took

    def run(self) -> None:
        """Train all epochs that are left, or until the minutes are over."""
        self.begun = time.monotonic() - self._resume()
        while self.epoch < self.options.epochs and self._spent() < 1:
            self._epoch()
            self.epoch += 1
            self._save()

    def _epoch(self) -> None:
        index = self._share(self.pictures.index())
        epoch = Batches(self.pictures, index, self.options.batch, (self.options.seed, self.epoch))
        self.learner.network.train()
        self._freeze()
        sums: dict[str, float] = {}
        batches = epoch.ahead(self.options.loaders)
        title = f"epoch {self.epoch + 1}/{self.options.epochs}"
        bar = tqdm(batches, total=self.steps_each, desc=title, mininterval=5)
        for done, (images, rows) in enumerate(bar, 1):
            parts = self._step(images, rows)
            for name, value in parts.items():
                sums[name] = sums.get(name, 0.0) + value
            bar.set_postfix({k: f"{v / done:.3f}" for k, v in sums.items()}, refresh=False)
            if self._spent() >= 1:
                break
        means = ", ".join(f"{k} {v / done:.4f}" for k, v in sums.items())
        sys.stdout.write(f"\n{time.strftime('%H:%M:%S')} epoch {self.epoch + 1}: {means}\n")
        sys.stdout.flush()

    def _freeze(self) -> None:
        """Let the first layers be as they are: nothing goes back through them, the costliest part of a step."""
        for block in self.learner.network.blocks[: self.options.freeze]:
            block.requires_grad_(False).eval()

    def _spent(self) -> float:
        """Share of the minutes that are over; 0 where it may take as long as it does."""
        return (time.monotonic() - self.begun) / 60 / self.options.minutes if self.options.minutes else 0.0

    def _share(self, index: NDArray[Any]) -> NDArray[Any]:
        """This epoch's pictures: each picture comes once before any comes again."""
        count = self.steps_each * self.options.batch
        first = self.epoch * count
        rounds = range(first // len(index), (first + count) // len(index) + 1)
        orders = [np.random.default_rng([self.options.seed, r]).permutation(len(index)) for r in rounds]
        start = first - rounds[0] * len(index)
        share: NDArray[Any] = index[np.concatenate(orders)[start : start + count]]
        return share

    def _step(self, images: NDArray[Any], rows: NDArray[Any]) -> dict[str, float]:
        learner = self.learner
        share = schedule(max(learner.step / self.total, self._spent()), learner.step, self.options.cool)
        inputs = torch.from_numpy(images).to(learner.device).permute(0, 3, 1, 2).float().div_(255.0)
        inputs = inputs.contiguous(memory_format=torch.channels_last)
        boxes = torch.from_numpy(rows).to(learner.device)
        truth = Truth(boxes[:, 2:6], boxes[:, 0].long(), boxes[:, 1].long(), boxes[:, 6] > 0, sure=boxes[:, 6])
        parts, _ = learner.learn(inputs, truth, self.options.rate * share)
        return {name: float(value) for name, value in parts.items()}

    def _save(self) -> None:
        part = self.options.checkpoint.with_suffix(".part")
        spent = time.monotonic() - self.begun
        torch.save({**self.learner.state_dict(), "epoch": self.epoch, "spent": spent}, part)
        os.replace(part, self.options.checkpoint)
        self.options.weights.write_bytes(self.learner.weights(self.learner.step * self.options.batch))

    def _resume(self) -> float:
        """Begin, or go on from the checkpoint; the seconds that went into it."""
        if not self.options.checkpoint.exists():
            if self.options.start:
                self.learner.start_from(self.options.start)
            return 0.0
        state = torch.load(self.options.checkpoint, map_location=self.learner.device, weights_only=True)
        self.learner.load_state_dict(state)
        self.epoch = state["epoch"]
        sys.stdout.write(f"going on after epoch {self.epoch} and {state['spent']:.0f} s\n")
        spent: float = state["spent"]
        return spent


class Batches(torch.utils.data.Dataset):
    """The batches of an epoch; each is the same whoever makes it.

    Args:
        pictures: the set.
        index: (shard, picture) of each of the epoch, shape (N, 2).
        batch: pictures of one.
        seed: of the epoch's chance.
    """

    def __init__(self, pictures: Pictures, index: NDArray[Any], batch: int, seed: tuple[int, int]) -> None:
        self._pictures, self._index, self._batch, self._seed = pictures, index, batch, seed

    def __len__(self) -> int:
        return -(-len(self._index) // self._batch)

    def __getitem__(self, k: int) -> tuple[NDArray[Any], NDArray[Any]]:
        chosen = self._index[k * self._batch : (k + 1) * self._batch]
        return batch_of(self._pictures, chosen, np.random.default_rng([*self._seed, k]))

    def ahead(self, loaders: int) -> Iterator[tuple[NDArray[Any], NDArray[Any]]]:
        """All of them, made by so many processes, or by one thread where that is 0.

        A process is better even beside two cores: a thread takes the interpreter from a compiled network, which asks
        for it before each of its kernels.
        """
        if loaders:
            made = torch.utils.data.DataLoader(
                self, batch_size=None, num_workers=loaders, prefetch_factor=4, worker_init_fn=_step_back
            )
            for images, rows in made:
                yield images.numpy(), rows.numpy()
            return
        ready: queue.Queue[Any] = queue.Queue(2)

        def fill() -> None:
            for k in range(len(self)):
                ready.put(self[k])
            ready.put(None)

        threading.Thread(target=fill, daemon=True).start()
        while (item := ready.get()) is not None:
            yield item


def _step_back(_: int) -> None:
    """A loader runs where a network's threads leave time: they wait for each other at each of its layers."""
    os.nice(14)


def main() -> None:
    """Train from the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--data", type=Path, required=True)
    parser.add_argument("--name", default="train")
    parser.add_argument("--cfg", type=Path, required=True)
    parser.add_argument("--weights", type=Path, required=True, help="written after each epoch")
    parser.add_argument("--checkpoint", type=Path, required=True)
    parser.add_argument("--start", type=Path, help="a checkpoint or a .weights file whose weights to begin with")
    parser.add_argument("--epochs", type=int, default=24)
    parser.add_argument("--samples", type=int, default=10000, help="pictures of an epoch")
    parser.add_argument("--batch", type=int, default=24)
    parser.add_argument("--rate", type=float, default=2e-3)
    parser.add_argument("--cool", type=float, default=0.5, help="share of the steps in which the rate falls")
    parser.add_argument("--minutes", type=float, help="end after so long, with the rate fallen, whatever the epochs")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--loaders", type=int, default=0, help="processes that make batches; 0: a thread")
    parser.add_argument("--bf16", action="store_true", help="compute in bfloat16, where the machine does that itself")
    parser.add_argument("--muon", action="store_true", help="Muon instead of AdamW for the inner convolutions")
    parser.add_argument("--freeze", type=int, default=0, help="so many of the first layers keep their numbers")
    parser.add_argument("--pack", action="store_true", help="read all pictures once and keep them in memory as jpegs")
    parser.add_argument("--compile", action="store_true", help="compile the network first; needs a C++ compiler")
    parser.add_argument("--anchors", action="store_true", help="find anchors and put them into the cfg file first")
    options = parser.parse_args()
    torch.set_num_threads(options.threads)
    cv2.setNumThreads(1)
    Trainer(options).run()


if __name__ == "__main__":
    main()
