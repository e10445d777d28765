"""Move a network's objectness, so that thresholds mean what they meant before; the order of boxes stays.

    python -m training.surgery.retune house.cfg FROM.weights TO.weights --data FOLDER --name SETS
    python -m training.surgery.retune house.cfg FROM.weights TO.weights --gain 1.05 --offset 0.5

A network that learns `dataset.sureness` is less sure of whoever hides, so that at a threshold of old it has fewer false
alarms and finds fewer people. Who asks for a probability of 0.8 (the patrol) wants the false alarms of old, and more.
So the first form finds gain and offset itself: with them as many boxes of persons are false as `FALSE` says, in
pictures that the network has not learnt.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from rosbot_patrol.detection.darknet.cfg import read_cfg
from rosbot_patrol.detection.darknet.layers import NetworkSpec, Yolo
from rosbot_patrol.detection.darknet.weights import ConvWeights, format_weights, read_weights
from training.judging.report import find_all, load_forward
from training.judging.scoring import Found
from training.learning.dataset import Pictures

OBJECTNESS = 4  # its place among the filters of an anchor
FALSE = {0.4: 19.5, 0.8: 3.75}
"""False boxes of persons above thresholds, in 1,000 pictures as `render.py --kinds --pictures 2000` draws them: those
that the network of the eleventh step has, told from 36,000."""


def find_figures(found: Found, wanted: Mapping[float, float] = FALSE) -> tuple[float, float]:
    """The gain and the offset with which a network has so many false boxes of persons.

    Args:
        found: what it found, before, in pictures that it has not learnt.
        wanted: above each of two thresholds, how many in 1,000 pictures.

    Raises:
        ValueError: too few pictures, or too few false boxes, to tell.
    """
    sure = np.sort(found.boxes[found.false(0), 2])[::-1]
    before, after = [], []
    for threshold, rate in sorted(wanted.items()):
        count = round(rate * len(found.index) / 1000)
        if not 0 < count < len(sure) or sure[count] == sure[count - 1]:
            raise ValueError(
                f"{len(sure)} false boxes in {len(found.index)} pictures do not tell where {count} of them are: "
                "draw more pictures, or give --gain and --offset"
            )
        before.append(_logit(float(sure[count - 1] + sure[count]) / 2))
        after.append(_logit(threshold))
    gain = (after[1] - after[0]) / (before[1] - before[0])
    return gain, after[0] - gain * before[0]


def _logit(probability: float) -> float:
    return float(np.log(probability / (1 - probability)))


def retune(spec: NetworkSpec, numbers: Sequence[ConvWeights], gain: float, offset: float) -> list[ConvWeights]:
    """The numbers with the logits of the objectness times `gain` and plus `offset`.

    Args:
        spec: a network with [yolo] heads.
        numbers: of its convolutions, in their order.
        gain: more than 0.
        offset: of logits.

    Raises:
        ValueError: a head of another kind; a gain that would turn the order round.
    """
    if gain <= 0:
        raise ValueError(f"gain is {gain}, has to be more than 0")
    mine = dict(zip((layer.index for layer in spec.convolutions), numbers, strict=True))
    for head in spec.heads:
        if not isinstance(head, Yolo):
            raise ValueError(f"{spec.source}, line {head.line}: not a [yolo] head")
        last, of_anchor = mine[head.index - 1], 5 + head.classes
        weights, biases = last.weights.copy(), last.biases.copy()
        weights[OBJECTNESS::of_anchor] *= gain
        biases[OBJECTNESS::of_anchor] = biases[OBJECTNESS::of_anchor] * gain + offset
        mine[head.index - 1] = replace(last, weights=weights, biases=biases)
    return list(mine.values())


def main() -> None:
    """Retune from the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    for name in ("cfg", "weights", "to"):
        parser.add_argument(name, type=Path)
    parser.add_argument("--gain", type=float, default=1.0)
    parser.add_argument("--offset", type=float, default=0.0)
    parser.add_argument("--data", type=Path, help="a folder of pictures by which to find both")
    parser.add_argument("--name", help="its sets, with commas between them, as `kinds.py` names them")
    options = parser.parse_args()
    if (options.data is None) != (options.name is None):
        parser.error("--data and --name belong together")
    if options.data is not None and (options.gain, options.offset) != (1.0, 0.0):
        parser.error("--data finds --gain and --offset: give the one or the others")
    spec = read_cfg(str(options.cfg))
    gain, offset = options.gain, options.offset
    if options.data is not None:
        try:
            pictures = Pictures.open(options.data, options.name)
            gain, offset = find_figures(find_all(pictures, options.cfg, load_forward(options.cfg, options.weights)))
        except (FileNotFoundError, ValueError) as error:
            sys.exit(f"retune: {error}")
        sys.stdout.write(f"gain {gain:.3f}, offset {offset:.3f}\n")
    numbers = retune(spec, read_weights(str(options.weights), spec), gain, offset)
    options.to.write_bytes(format_weights(spec, numbers, bits=10))


if __name__ == "__main__":
    main()
