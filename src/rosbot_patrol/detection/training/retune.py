"""Move a network's objectness, so that thresholds mean what they meant before; the order of boxes stays.

    python -m rosbot_patrol.detection.training.retune house.cfg FROM.weights TO.weights --gain 1.05 --offset 0.5

A network that learns `dataset.sureness` is less sure of whoever hides, so that at a threshold of old it has fewer false
alarms and finds fewer people. Who asks for a probability of 0.8 (the patrol) wants the false alarms of old, and more.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from rosbot_patrol.detection.darknet_cfg import read_cfg
from rosbot_patrol.detection.darknet_layers import NetworkSpec, Yolo
from rosbot_patrol.detection.darknet_weights import ConvWeights, format_weights, read_weights

OBJECTNESS = 4  # its place among the filters of an anchor


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
    options = parser.parse_args()
    spec = read_cfg(str(options.cfg))
    numbers = retune(spec, read_weights(str(options.weights), spec), options.gain, options.offset)
    options.to.write_bytes(format_weights(spec, numbers, bits=10))


if __name__ == "__main__":
    main()
