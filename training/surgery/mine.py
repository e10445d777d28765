"""Pick out of training pictures those in which a network errs, as a set of their own to be seen more often.

    python -m training.surgery.mine --data FOLDER --name vary --cfg CFG --weights FILE --to hard

A network that is good errs in few of them: a fifth holds nine tenths of what `errors` sums up. A set that was picked
already stays as it is. Never of test pictures: whatever is picked here is trained on.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from training.judging.report import find_all, load_forward
from training.judging.scoring import Found
from training.judging.test_set import SETS
from training.learning.dataset import JPEGS, Packed, Pictures, join_masks, sureness
from training.pictures.render import PER_SHARD

LEAST, FAINTEST = 0.15, 0.05  # of a picture's errors, to be picked at all; of a false alarm's probability, to count


def errors(found: Found, threshold: float) -> NDArray[Any]:
    """How badly each picture goes wrong: the sum of the probabilities of false alarms and of what misses lack.

    Args:
        found: what a network found in a set.
        threshold: false alarms below it do not matter.
    """
    score = np.zeros(len(found.index))
    false = found.boxes[(found.false(0) | found.false(1)) & (found.boxes[:, 2] > threshold)]
    np.add.at(score, false[:, 0].astype(int), false[:, 2])
    rows = found.labels[found.wanted]
    np.add.at(score, rows[:, 0].astype(int), np.maximum(0.8 * sureness(rows) - found.hit[found.wanted], 0.0))
    return score


def write_set(pictures: Pictures, chosen: NDArray[Any], folder: Path, name: str) -> None:
    """Write chosen (shard, picture) pairs, with their masks, as shards of another name; the first of them last."""
    for number, start in reversed(list(enumerate(range(0, len(chosen), PER_SHARD)))):
        part = chosen[start : start + PER_SHARD]
        rows = [pictures.labels[shard][i].copy() for shard, i in part]
        for k, mine in enumerate(rows):
            mine[:, 0] = k
        held = [pictures.masks[shard] for shard, _ in part]
        masks = [of_shard[i] for of_shard, (_, i) in zip(held, part, strict=True) if of_shard is not None]
        more = join_masks(masks) if len(masks) == len(part) else {}
        target = folder / f"{name}-{number:04d}{JPEGS}"
        np.savez(target.with_suffix(".npz"), boxes=np.concatenate(rows), **more)
        half = target.with_suffix(".part" + JPEGS)
        Packed([pictures.jpeg(shard, i) for shard, i in part]).save(half)
        half.rename(target)


def main() -> None:
    """Pick from the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, required=True)
    parser.add_argument("--name", required=True, help="sets to pick from, with commas")
    parser.add_argument("--cfg", type=Path, required=True)
    parser.add_argument("--weights", type=Path, required=True)
    parser.add_argument("--to", default="hard", help="what is picked of a set X becomes a set TO_X")
    parser.add_argument("--share", type=float, default=0.25, help="at most so many of the pictures, the worst")
    parser.add_argument("--threads", type=int, default=2)
    options = parser.parse_args()
    names = options.name.split(",")
    if set(names) & set(SETS):
        parser.error("the test pictures are not for training")
    forward = load_forward(options.cfg, options.weights, threads=options.threads)
    for name in names:
        target = f"{options.to}_{name}"
        if (options.data / f"{target}-0000{JPEGS}").exists():
            continue
        pictures = Pictures.open(options.data, name)
        found = find_all(pictures, options.cfg, forward)
        score = errors(found, FAINTEST)
        worst = np.argsort(-score, kind="stable")[: int(options.share * len(score))]
        worst = np.sort(worst[score[worst] > LEAST])
        write_set(pictures, found.index[worst], options.data, target)
        sys.stdout.write(f"{len(worst)} of {len(score)} pictures into {target}\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main()
