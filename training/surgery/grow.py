"""Begin a larger network with the numbers of a smaller one, so that it answers as that one did before it learns on.

Channels that are new are fed by chance but not yet heard; a new residual block adds nothing at first (its last
convolution has a scale of 0). After "Net2Net: Accelerating Learning via Knowledge Transfer", Chen et al. 2016, with
zeros where that copies, and the zero scale of "Accurate, Large Minibatch SGD", Goyal et al. 2017.

    python -m training.surgery.grow OLD.cfg OLD.weights NEW.cfg NEW.weights --pairs 0:0,1:1,...
"""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from rosbot_patrol.detection.darknet.layers import Convolutional, Layer, NetworkSpec, Route, Shortcut
from rosbot_patrol.detection.darknet.weights import ConvWeights
from training.learning.network import Darknet
from training.surgery.shrink import change_weights_file

Map = NDArray[Any]


def grow(
    old: NetworkSpec, numbers: list[ConvWeights], new: NetworkSpec, pairs: dict[int, int], seed: int = 0
) -> Darknet:
    """The larger network.

    Args:
        old: layers of the smaller network.
        numbers: of its convolutions, in their order.
        new: layers of the larger one.
        pairs: layer of the new network -> layer of the old one whose numbers it takes; convolutions only.
        seed: of the new numbers.
    """
    torch.manual_seed(seed)
    network = Darknet(new)
    mine = network.to_weights()
    where = {i: k for k, i in enumerate(i for i, x in enumerate(old.layers) if isinstance(x, Convolutional))}
    maps: list[Map] = []
    count = 0
    for i, layer in enumerate(new.layers):
        if isinstance(layer, Convolutional):
            source = maps[i - 1] if i else np.arange(layer.in_shape[0])
            if i in pairs:
                _embed(mine[count], numbers[where[pairs[i]]], source)
                maps.append(np.arange(len(numbers[where[pairs[i]]].weights)))
            else:
                scales = mine[count].scales
                if scales is not None and _ends_block(new.layers, i):
                    scales[:] = 0.0
                maps.append(source)
            count += 1
        else:
            maps.append(_passed(layer, new.layers, maps, i))
    network.from_weights(mine)
    return network


def _ends_block(layers: tuple[Layer, ...] | list[Layer], i: int) -> bool:
    return i + 1 < len(layers) and isinstance(layers[i + 1], Shortcut)


def _passed(layer: Layer, layers: tuple[Layer, ...] | list[Layer], maps: list[Map], i: int) -> Map:
    """Where the old channels are in the output of a layer without numbers."""
    if isinstance(layer, Shortcut):
        return maps[layer.layers[0]]
    if isinstance(layer, Route):
        parts, first = [], 0
        for j in layer.layers:
            parts.append(maps[j] + first)
            first += layers[j].out_shape[0]
        return np.concatenate(parts)
    return maps[i - 1]


def _embed(mine: ConvWeights, theirs: ConvWeights, source: Map) -> None:
    outs, ins = theirs.weights.shape[:2]
    if ins != len(source):
        raise ValueError(f"a convolution of {ins} channels in is paired with one that hears {len(source)} of them")
    mine.weights[:outs] = 0.0
    mine.weights[:outs, source] = theirs.weights
    for name in ("biases", "scales", "means", "variances"):
        if getattr(theirs, name) is not None:
            getattr(mine, name)[:outs] = getattr(theirs, name)


def main() -> None:
    """Grow a weights file from the command line."""
    change_weights_file(__doc__, lambda *of: grow(*of).to_weights())


if __name__ == "__main__":
    main()
