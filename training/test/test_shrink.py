from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rosbot_patrol.detection.darknet.cfg import parse_cfg, read_cfg
from rosbot_patrol.detection.darknet.layers import NetworkSpec
from rosbot_patrol.detection.darknet.letterbox import Letterbox
from rosbot_patrol.detection.darknet.random_weights import random_weights
from rosbot_patrol.detection.darknet.weights import ConvWeights, format_weights, read_weights
from rosbot_patrol.detection.network import load_network
from rosbot_patrol.images.encodings import Picture
from training.surgery import shrink as module
from training.surgery.shrink import shrink

NET = "[net]\nwidth=64\nheight=32\nchannels=3\n"
HEAD = "[convolutional]\nfilters=7\nsize=1\nactivation=linear\n[yolo]\nmask=0\nanchors=10,20\nclasses=2\nnum=1\n"


def conv(filters: int, size: int = 3) -> str:
    return f"[convolutional]\nbatch_normalize=1\nfilters={filters}\nsize={size}\nstride=1\npad=1\nactivation=leaky\n"


def make_net(trunk: int, middle: int) -> str:
    """A residual block, and a head that hears it beside what came before it."""
    return (
        NET
        + conv(trunk)
        + conv(middle, 1)
        + conv(trunk)
        + "[shortcut]\nfrom=-3\nactivation=linear\n"
        + conv(5)
        + "[route]\nlayers=-1,-2\n"
        + HEAD
    )


def run(spec: NetworkSpec, numbers: list[ConvWeights]) -> np.ndarray:
    picture = Picture(np.random.default_rng(3).integers(0, 255, (32, 64, 3), dtype=np.uint8), "rgb8")
    return load_network(spec, numbers).run(picture, Letterbox(64, 32, 64, 32))[0]


def mute(numbers: ConvWeights, channels: list[int]) -> None:
    assert numbers.scales is not None
    numbers.scales[channels] = 0.0
    numbers.biases[channels] = 0.0


def test_channels_that_say_nothing_go_and_nothing_changes() -> None:
    old, new = parse_cfg(make_net(6, 4), "old"), parse_cfg(make_net(4, 3), "new")
    numbers = random_weights(old, np.random.default_rng(1))
    mute(numbers[0], [1, 4])
    mute(numbers[2], [1, 4])  # joined with the first by the shortcut
    mute(numbers[1], [2])
    less = shrink(old, numbers, new, {0: 0, 1: 1, 2: 2, 4: 4, 6: 6})
    assert [part.weights.shape[:2] for part in less] == [(4, 3), (3, 4), (4, 3), (5, 4), (7, 9)]
    assert np.allclose(run(old, numbers), run(new, less), atol=1e-4)


def test_of_two_channels_the_one_goes_that_is_hardly_heard() -> None:
    old, new = parse_cfg(NET + conv(3) + HEAD, "old"), parse_cfg(NET + conv(2) + HEAD, "new")
    numbers = random_weights(old, np.random.default_rng(1))
    numbers[1].weights[:, 1] *= 0.01
    less = shrink(old, numbers, new, {0: 0, 1: 1})
    assert np.array_equal(less[0].weights, numbers[0].weights[[0, 2]])
    assert np.array_equal(less[1].weights, numbers[1].weights[:, [0, 2]])


def test_a_convolution_in_two_steps_gives_the_same() -> None:
    old = parse_cfg(NET + conv(6) + conv(4) + HEAD, "old")
    new = parse_cfg(NET + conv(6) + conv(6, 1) + conv(4) + HEAD, "new")
    numbers = random_weights(old, np.random.default_rng(1))
    assert numbers[0].variances is not None
    numbers[0].variances[:] = 400.0  # so little varies that the activation bends nothing
    more = shrink(old, numbers, new, {0: 0, 2: 1, 3: 2})
    inside = (slice(None), slice(1, -1), slice(1, -1))  # beyond the edge there are zeros, not the lifted channels
    assert np.allclose(run(old, numbers)[inside], run(new, more)[inside], atol=1e-4)


@pytest.mark.parametrize(
    ("pairs", "words"), [({0: 0, 2: 2}, "in no pair"), ({0: 0, 1: 1, 2: 1}, "hears other channels")]
)
def test_pairs_that_make_no_sense_are_refused(pairs: dict[int, int], words: str) -> None:
    spec = parse_cfg(NET + conv(6) + conv(4) + HEAD, "old")
    with pytest.raises(ValueError, match=words):
        shrink(spec, random_weights(spec, np.random.default_rng(1)), spec, pairs)


def test_from_the_command_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    old, new = tmp_path / "old.cfg", tmp_path / "new.cfg"
    old.write_text(NET + conv(3) + HEAD)
    new.write_text(NET + conv(2) + HEAD)
    spec = read_cfg(str(old))
    (tmp_path / "old.weights").write_bytes(format_weights(spec, random_weights(spec, np.random.default_rng(1))))
    files = [str(tmp_path / name) for name in ("old.cfg", "old.weights", "new.cfg", "new.weights")]
    monkeypatch.setattr("sys.argv", ["shrink", *files, "--pairs", "0:0,1:1"])
    module.main()
    assert read_weights(files[3], read_cfg(files[2]))[0].weights.shape == (2, 3, 3, 3)
