"""Pick out of training pictures those in which a network errs, as a set of their own to be seen more often.

    python -m rosbot_patrol.detection.training.mine --data FOLDER --name vary --cfg CFG --weights FILE --to hard

Never of test pictures: whatever is picked here is trained on.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np

from rosbot_patrol.detection.training.dataset import JPEGS, Packed, Pictures
from rosbot_patrol.detection.training.render import PER_SHARD
from rosbot_patrol.detection.training.report import find_all, load_forward
from rosbot_patrol.detection.training.scoring import Found
from rosbot_patrol.detection.training.test_set import SETS


def errors(found: Found, threshold: float) -> np.ndarray:
    """How badly each picture goes wrong: the sum of the probabilities of false alarms and of what misses lack.

    Args:
        found: what a network found in a set.
        threshold: false alarms below it do not matter.
    """
    score = np.zeros(len(found.index))
    false = found.boxes[(found.false(0) | found.false(1)) & (found.boxes[:, 2] > threshold)]
    np.add.at(score, false[:, 0].astype(int), false[:, 2])
    rows = found.labels[found.wanted]
    np.add.at(score, rows[:, 0].astype(int), np.maximum(0.8 - found.hit[found.wanted], 0.0))
    return score


def write_set(pictures: Pictures, chosen: np.ndarray, folder: Path, name: str) -> None:
    """Write chosen (shard, picture) pairs as shards of another name."""
    for number, start in enumerate(range(0, len(chosen), PER_SHARD)):
        part = chosen[start : start + PER_SHARD]
        shots, rows = [], []
        for k, (shard, i) in enumerate(part):
            shots.append(pictures.picture(shard, i))
            rows.append(pictures.labels[shard][i].copy())
            rows[-1][:, 0] = k
        target = folder / f"{name}-{number:04d}{JPEGS}"
        np.savez_compressed(target.with_suffix(".npz"), boxes=np.concatenate(rows))
        half = target.with_suffix(".part" + JPEGS)
        Packed.of(np.array(shots)).save(half)
        half.rename(target)


def main() -> None:
    """Pick from the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, required=True)
    parser.add_argument("--name", required=True, help="sets to pick from, with commas")
    parser.add_argument("--cfg", type=Path, required=True)
    parser.add_argument("--weights", type=Path, required=True)
    parser.add_argument("--to", default="hard", help="name of the set that is written")
    parser.add_argument("--share", type=float, default=0.15, help="at most so many of the pictures, the worst")
    parser.add_argument("--threads", type=int, default=2)
    options = parser.parse_args()
    if set(options.name.split(",")) & set(SETS):
        parser.error("the test pictures are not for training")
    pictures = Pictures.open(options.data, options.name)
    found = find_all(pictures, options.cfg, load_forward(options.cfg, options.weights, threads=options.threads))
    score = errors(found, 0.2)
    worst = np.argsort(-score, kind="stable")[: int(options.share * len(score))]
    worst = np.sort(worst[score[worst] > 0.15])
    write_set(pictures, found.index[worst], options.data, options.to)
    sys.stdout.write(f"{len(worst)} of {len(score)} pictures into {options.to}\n")


if __name__ == "__main__":
    main()
