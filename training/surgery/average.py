"""The mean of two networks' numbers, of one that was trained on from the other: often better than either.

    python -m training.surgery.average house.cfg BEFORE.weights AFTER.weights TO.weights

As in "Averaging Weights Leads to Wider Optima and Better Generalization" (Izmailov et al. 2018) and "Model soups"
(Wortsman et al. 2022). Figures of batch normalisation are averaged like the rest: they differ little in such a pair.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

from rosbot_patrol.detection.darknet.cfg import read_cfg
from rosbot_patrol.detection.darknet.weights import ConvWeights, format_weights, read_weights


def average(one: Sequence[ConvWeights], other: Sequence[ConvWeights]) -> list[ConvWeights]:
    """The mean, number by number, of two networks of the same layers."""
    return [_mean(a, b) for a, b in zip(one, other, strict=True)]


def _mean(one: ConvWeights, other: ConvWeights) -> ConvWeights:
    numbers: dict[str, Any] = {}
    for name in (field.name for field in fields(ConvWeights)):
        a, b = getattr(one, name), getattr(other, name)
        numbers[name] = None if a is None else ((a.astype(np.float64) + b) / 2).astype("<f4")
    return ConvWeights(**numbers)


def main() -> None:
    """Average from the command line."""
    if len(sys.argv) != 5:
        sys.exit("usage: average CFG ONE.weights OTHER.weights TO.weights")
    cfg, one, other, to = sys.argv[1:]
    spec = read_cfg(cfg)
    mean = average(read_weights(one, spec), read_weights(other, spec))
    Path(to).write_bytes(format_weights(spec, mean, bits=10))


if __name__ == "__main__":
    main()
