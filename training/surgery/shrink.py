"""Begin a faster network with the numbers of a larger one: channels that are hardly heard go, the others stay.

A channel counts by how much comes out of it and how much is made of it: its normalisation's scale, times the length of
the weights that it is heard with (after "Learning Efficient Convolutional Networks through Network Slimming", Liu et
al. 2017; the other factor makes it independent of how the two share a scale). Convolutions joined by a shortcut keep
the same channels. A 1 x 1 convolution that only the new network has, before one of both, takes the directions in which
that one hears most ("Accelerating Very Deep Convolutional Networks", Zhang et al. 2015, without its pictures).

What comes out has to be trained on.

    python -m training.surgery.shrink OLD.cfg OLD.weights NEW.cfg NEW.weights --pairs 0:0,1:1,...
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.detection.darknet.cfg import read_cfg
from rosbot_patrol.detection.darknet.layers import Convolutional, Layer, NetworkSpec, Route, Shortcut
from rosbot_patrol.detection.darknet.weights import ConvWeights, format_weights, read_weights

Ids = NDArray[Any]
LINEAR = 2.0  # deviations by which new channels are lifted, so that the leaky activation hardly bends them


def shrink(old: NetworkSpec, numbers: list[ConvWeights], new: NetworkSpec, pairs: dict[int, int]) -> list[ConvWeights]:
    """The numbers of the smaller network's convolutions, in their order.

    Args:
        old: layers of the larger network.
        numbers: of its convolutions, in their order.
        new: layers of the smaller one.
        pairs: layer of the new network -> layer of the old one whose numbers it takes; convolutions only.

    Raises:
        ValueError: a convolution is in no pair and no 1 x 1 before one that is, or does not fit what it is paired with.
    """
    mine = dict(zip((i for i, x in enumerate(old.layers) if isinstance(x, Convolutional)), numbers, strict=True))
    ids = _channels(old)
    spread, score = _scores(old, mine, ids)
    kept: list[Ids] = []
    out: list[ConvWeights] = []
    split: Ids | None = None  # what the 1 x 1 before hears, where only the new network has that
    for i, layer in enumerate(new.layers):
        before = kept[i - 1] if i else np.arange(-layer.in_shape[0], 0)
        if not isinstance(layer, Convolutional):
            kept.append(_passed(layer, kept, before))
        elif i in pairs:
            heard = ids[pairs[i] - 1] if pairs[i] else np.arange(-old.channels, 0)
            theirs = _hearing(mine[pairs[i]], heard, before if split is None else split, i)
            if split is not None:
                theirs = _split(theirs, spread[split], out, layer.in_shape[0])
            wanted = ids[pairs[i]]
            chosen = np.sort(np.argsort(-score[wanted], kind="stable")[: layer.filters])
            out.append(_filters(theirs, chosen))
            kept.append(wanted[chosen])
            split = None
        elif layer.size == 1 and layer.batch_normalize and split is None:
            split = before
            kept.append(np.full(layer.filters, -1))
        else:
            raise ValueError(f"line {layer.line}: the convolution is in no pair, and no 1 x 1 before one that is")
    return out


def _channels(spec: NetworkSpec) -> list[Ids]:
    """A number for each channel of each layer's output; those that a shortcut adds have one number."""
    ids: list[Ids] = []
    count = 0
    for i, layer in enumerate(spec.layers):
        if isinstance(layer, Convolutional):
            ids.append(np.arange(count, count + layer.filters))
            count += layer.filters
        else:
            ids.append(_passed(layer, ids, ids[i - 1]))
            if isinstance(layer, Shortcut):
                ids[i - 1] = ids[i]
    return ids


def _scores(spec: NetworkSpec, mine: dict[int, ConvWeights], ids: list[Ids]) -> tuple[NDArray[Any], NDArray[Any]]:
    """By how much each channel varies, as far as the numbers tell, and how much it matters."""
    count = 1 + max(int(part.max()) for part in ids)
    told, heard = np.zeros(count), np.zeros(count)
    for i, numbers in mine.items():
        scales = numbers.scales if numbers.scales is not None else np.ones(len(numbers.biases))
        np.add.at(told, ids[i], scales.astype(np.float64) ** 2)
        if i:
            np.add.at(heard, ids[i - 1], (numbers.folded()[0].astype(np.float64) ** 2).sum(axis=(0, 2, 3)))
    heads = [ids[i] for i, numbers in mine.items() if numbers.scales is None]
    for part in heads:  # nobody hears them, and all are wanted
        heard[part] = np.inf
    return np.sqrt(told), np.sqrt(told * heard)


def _passed(layer: Layer, known: list[Ids], before: Ids) -> Ids:
    if isinstance(layer, Shortcut):
        return known[layer.layers[0]]
    if isinstance(layer, Route):
        return np.concatenate([known[j] for j in layer.layers])
    return before


def _hearing(theirs: ConvWeights, heard: Ids, left: Ids, i: int) -> ConvWeights:
    """The numbers of a convolution that hears only what is left."""
    at = {int(number): place for place, number in enumerate(heard)}
    if any(int(number) not in at for number in left):
        raise ValueError(f"layer {i} of the new network hears other channels than the one that it is paired with")
    return replace(theirs, weights=theirs.weights[:, [at[int(number)] for number in left]])


def _filters(theirs: ConvWeights, chosen: NDArray[Any]) -> ConvWeights:
    parts = {name: part[chosen] for name, part in vars(theirs).items() if part is not None}
    return replace(theirs, **parts)


def _split(theirs: ConvWeights, spread: NDArray[Any], out: list[ConvWeights], middle: int) -> ConvWeights:
    """Put a 1 x 1 into `out` that gives the `middle` directions of most weight, and make the convolution hear those.

    Args:
        theirs: numbers of the convolution, of what comes before the 1 x 1.
        spread: by how much each channel varies, shape (channels,).
        out: numbers of the layers so far.
        middle: filters of the 1 x 1.
    """
    filters, channels, size, _ = theirs.weights.shape
    spread = np.maximum(spread, 1e-3 * spread.max())
    rows = theirs.weights.transpose(0, 2, 3, 1).reshape(-1, channels) * spread
    directions = np.linalg.svd(rows, full_matrices=False)[2][:middle]
    ones = np.ones(middle, np.float32)
    out.append(
        ConvWeights(
            weights=(directions / spread).reshape(middle, channels, 1, 1).astype(np.float32),
            biases=LINEAR * ones,
            scales=ones,
            means=0 * ones,
            variances=ones,
        )
    )
    back = rows @ directions.T
    weights = back.reshape(filters, size, size, middle).transpose(0, 3, 1, 2).astype(np.float32)
    lifted = LINEAR * weights.sum(axis=(1, 2, 3))
    parts = {"means": theirs.means + lifted} if theirs.means is not None else {"biases": theirs.biases - lifted}
    return replace(theirs, weights=np.ascontiguousarray(weights), **parts)


def change_weights_file(about: str | None, change: Callable[..., list[ConvWeights]]) -> None:
    """Make a network's weights file of another's, from the command line.

    Args:
        about: what for.
        change: gives the numbers from the old network's layers and numbers, the new one's layers, and the pairs.
    """
    parser = argparse.ArgumentParser(description=about, formatter_class=argparse.RawDescriptionHelpFormatter)
    for name in ("old_cfg", "old_weights", "new_cfg", "new_weights"):
        parser.add_argument(name, type=Path)
    parser.add_argument("--pairs", required=True, help="NEW:OLD of each convolution that is taken over, with commas")
    options = parser.parse_args()
    pairs = {int(a): int(b) for a, b in (pair.split(":") for pair in options.pairs.split(","))}
    old, new = read_cfg(str(options.old_cfg)), read_cfg(str(options.new_cfg))
    numbers = change(old, read_weights(str(options.old_weights), old), new, pairs)
    options.new_weights.write_bytes(format_weights(new, numbers))


def main() -> None:
    """Shrink a weights file from the command line."""
    change_weights_file(__doc__, shrink)


if __name__ == "__main__":
    main()
