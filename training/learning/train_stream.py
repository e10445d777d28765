"""Train on a GPU on pictures that all the processor's cores draw meanwhile: each is learnt some times, then goes.

A GPU learns a hundred times as fast as two cores: it is drawing that holds it up. So the pictures stay in its memory
(`view_pool.py`), are mixed there (`device_mixing.py`), and those in which the network errs come more often. Seeded, but
which pictures are there at a step depends on the machine.

    python -m training.learning.train_stream --cfg models/house.cfg --start models/house.weights \
        --weights NEW.weights --minutes 9 --seed 11
"""

from __future__ import annotations

import argparse
import copy
import queue
import sys
import tempfile
import threading
import time
from multiprocessing.process import BaseProcess
from pathlib import Path

import cv2
import numpy as np
import torch

from rosbot_patrol.detection.darknet.cfg import read_cfg
from training.learning import stream
from training.learning.dataset import read_labels
from training.learning.device_mixing import Mixer
from training.learning.learner import Learner, schedule
from training.pictures.labels import COLUMNS, HEIGHT, WIDTH
from training.pictures.view_pool import ViewPool, Views

VIEW_BYTES = HEIGHT * WIDTH * 4 + 1400
LEAST, MOST = 0.5, 4.0  # how often a picture comes that the network knows, and one in which it errs, to one between
EVERY = 10.0
_NO_ROWS = np.zeros((0, len(COLUMNS)), np.float32)


class Feed:
    """Shards of a folder as they are finished, read by threads of their own; a file that was read is deleted."""

    def __init__(self, folder: Path, threads: int, *, pin: bool) -> None:
        self.ready: queue.Queue[Views | Exception] = queue.Queue(4)
        self._folder, self._pin = folder, pin
        self._seen: set[Path] = set()
        self._lock = threading.Lock()
        for _ in range(threads):
            threading.Thread(target=self._read, daemon=True).start()

    def _next(self) -> Path | None:
        with self._lock:
            for file in sorted(self._folder.glob("stream-[0-9]*.npy")):
                if file not in self._seen and ".part" not in file.name:
                    self._seen.add(file)
                    return file
        return None

    def _read(self) -> None:
        while True:
            file = self._next()
            if file is None:
                time.sleep(0.2)
                continue
            try:
                views = read_views(file)
            except (OSError, ValueError, KeyError) as err:
                self.ready.put(err)
                return
            self.ready.put(views.pinned() if self._pin else views)
            file.unlink()
            file.with_suffix(".npz").unlink()


def read_views(file: Path) -> Views:
    """A shard of pictures with masks."""
    pictures = np.load(file)
    rows, masks = read_labels(file.with_suffix(".npz"), len(pictures))
    if masks is None:
        raise ValueError(f"{file} has no masks: draw it anew")
    return Views.of(pictures, [cv2.imdecode(mask, cv2.IMREAD_GRAYSCALE) for mask in masks], rows)


class StreamTrainer:
    """Trains until the time is over."""

    def __init__(self, options: argparse.Namespace) -> None:
        torch.manual_seed(options.seed)
        self.options = options
        self.device = torch.device("cuda" if torch.cuda.is_available() else "cpu")
        on_gpu = self.device.type == "cuda"
        if not on_gpu:
            sys.stdout.write("PyTorch sees no GPU: this is a trial, a hundred times slower, and nothing is compiled\n")
        compile_it = options.compile and on_gpu
        torch.backends.cudnn.benchmark = True
        self.learner = Learner(
            read_cfg(str(options.cfg)), self.device, options.rate, muon=True, bf16=True, compile_it=compile_it
        )
        self.learner.network.train()
        room = torch.cuda.mem_get_info()[0] - options.reserve * 1e9 if on_gpu else 4e9
        self.pool = ViewPool(min(int(room / VIEW_BYTES), options.views), self.device)
        self.mixer = Mixer(self.pool, options.seed, compile_it=compile_it)
        self.scores = torch.zeros(self.pool.places, device=self.device)
        self._sums = {name: torch.zeros((), device=self.device) for name in ("box", "object", "kind")}
        self._counted = 0
        self._spent, self.drawn_before = 0.0, 0
        self._found = None
        if options.checkpoint and options.checkpoint.exists():
            self._found = torch.load(options.checkpoint, map_location=self.device, weights_only=True)
            self._spent, self.drawn_before = self._found["spent"], self._found["drawn"]

    def run(self, feed: Feed, drawing: list[BaseProcess]) -> None:
        """Learn until the minutes are over, those of a run before with the same checkpoint counted in.

        Raises:
            RuntimeError: a process that draws has ended with an error, or the minutes were over before the first step.
        """
        options = self.options
        begun = said = saved = time.monotonic()
        self._prepare()
        self._resume()
        sys.stdout.write(f"ready after {time.monotonic() - begun:.0f} s\n")
        begun -= self._spent
        while time.monotonic() - begun < options.minutes * 60:
            now = time.monotonic()
            self._spent = now - begun
            self._take(feed, drawing)
            rate = 0.0
            if self.pool.size >= options.least:
                spent = self._spent / 60 / options.minutes
                rate = options.rate * schedule(spent, self.learner.step, options.cool)
                self._learn(rate)
            if now - said > EVERY:
                self._say(now - begun, rate)
                said = now
            if now - saved > 60:
                self.save()
                saved = now
        self._spent = time.monotonic() - begun
        self._say(self._spent, 0.0)
        if self.learner.step == 0:
            raise RuntimeError(
                f"nothing was learnt in {options.minutes:g} minutes: {self.pool.added} of the {options.least} views to "
                "begin with were there; give it more --minutes"
            )
        self.save()

    def _prepare(self) -> None:
        """A step on nothing, which compiles all of it while the first pictures are drawn, and is forgotten then."""
        blank = ViewPool(1, self.device)
        blank.add(
            Views.of(np.zeros((1, HEIGHT, WIDTH, 3), np.uint8), [np.zeros((HEIGHT, WIDTH), np.uint8)], [_NO_ROWS])
        )
        places = torch.zeros(self.options.batch, dtype=torch.long, device=self.device)
        kept = copy.deepcopy(self.learner.network.state_dict())
        self.learner.learn(*self.mixer.batch(places, blank), 0.0)
        self.learner.network.load_state_dict(kept)
        self.learner.mean.load_state_dict(kept)
        self.learner.restart(self.options.start)

    def save(self) -> None:
        """Write the running mean as it is, and the checkpoint."""
        part = self.options.weights.with_suffix(".part")
        part.write_bytes(self.learner.weights(self.learner.step * self.options.batch))
        part.replace(self.options.weights)
        if self.options.checkpoint:
            part = self.options.checkpoint.with_suffix(".part")
            drawn = self.drawn_before + self.pool.added
            torch.save({**self.learner.state_dict(), "spent": self._spent, "drawn": drawn}, part)
            part.replace(self.options.checkpoint)

    def _resume(self) -> None:
        if self._found is None:
            return
        self.learner.load_state_dict(self._found)
        self._found = None
        sys.stdout.write(f"going on after {self._spent:.0f} s\n")

    def _take(self, feed: Feed, drawing: list[BaseProcess]) -> None:
        if any(process.exitcode for process in drawing):
            raise RuntimeError("a process that draws the pictures has ended; its error is above")
        try:
            waits = self.pool.size < self.options.least
            views = feed.ready.get(waits, timeout=0.05)
        except queue.Empty:
            return
        if isinstance(views, Exception):
            raise views
        known = self.scores[: self.pool.size]
        usual = known.mean().clamp(min=1e-3) if self.pool.size else 1.0
        self.scores[self.pool.add(views)] = usual

    def _learn(self, rate: float) -> None:
        scores = self.scores[: self.pool.size]
        weights = (scores / scores.mean().clamp(min=1e-6)).clamp(LEAST, MOST)
        places = self.mixer.choose(self.options.batch, weights)
        inputs, truth = self.mixer.batch(places)
        parts, each = self.learner.learn(inputs, truth, rate)
        self.scores[places] = torch.lerp(self.scores[places], each, 0.3)
        for name, value in parts.items():
            self._sums[name] += value
        self._counted += 1

    def _say(self, seconds: float, rate: float) -> None:
        count = max(self._counted, 1)
        parts = ", ".join(f"{name} {float(value) / count:.4f}" for name, value in self._sums.items())
        for value in self._sums.values():
            value.zero_()
        self._counted = 0
        learnt = self.learner.step * self.options.batch
        sys.stdout.write(
            f"{seconds:5.0f} s: {self.pool.added} drawn, {self.pool.size} held, {learnt} learnt, rate {rate:.5f}; "
            f"{parts}\n"
        )
        sys.stdout.flush()


def main() -> None:
    """Train from the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cfg", type=Path, required=True)
    parser.add_argument("--weights", type=Path, required=True, help="written each minute and in the end")
    parser.add_argument("--checkpoint", type=Path, help="written each minute; if it is there, it goes on from it")
    parser.add_argument("--start", type=Path, help="a .weights file to begin with; without it from nothing")
    parser.add_argument("--worlds", type=Path, default=Path("worlds"), help="the folder of the houses")
    parser.add_argument("--minutes", type=float, required=True)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--batch", type=int, default=128)
    parser.add_argument("--rate", type=float, default=3e-3)
    parser.add_argument("--cool", type=float, default=0.6, help="share of the time in which the rate falls")
    parser.add_argument("--processes", type=int, default=2, help="that draw")
    parser.add_argument("--least", type=int, default=10000, help="views to begin with")
    parser.add_argument("--views", type=int, default=250000, help="to hold at most")
    parser.add_argument("--reserve", type=float, default=20.0, help="of the GPU's memory, for all but the views [GB]")
    parser.add_argument("--compile", action="store_true")
    options = parser.parse_args()
    cv2.setNumThreads(1)
    trainer = StreamTrainer(options)
    first = -(-trainer.drawn_before // stream.PER_SHARD)
    with tempfile.TemporaryDirectory(dir="/dev/shm" if Path("/dev/shm").is_dir() else None) as folder:
        drawing = stream.start(Path(folder), options.worlds, options.seed, options.processes, first)
        feed = Feed(Path(folder), 2, pin=torch.cuda.is_available())
        try:
            trainer.run(feed, drawing)
        finally:
            for process in drawing:
                process.terminate()


if __name__ == "__main__":
    main()
