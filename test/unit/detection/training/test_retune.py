"""Objectness moved, and nothing else."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from small_networks import small_cfg

from rosbot_patrol.detection.darknet_cfg import parse_cfg, read_cfg
from rosbot_patrol.detection.darknet_weights import read_weights
from rosbot_patrol.detection.training.retune import main, retune

MODELS = Path(__file__).parents[4] / "models"
SPEC = read_cfg(str(MODELS / "house.cfg"))
NUMBERS = read_weights(str(MODELS / "house.weights"), SPEC)


def test_only_the_objectness_of_each_anchor_moves() -> None:
    heads = 0
    rest = [0, 1, 2, 3, 5, 6]
    for layer, before, after in zip(SPEC.convolutions, NUMBERS, retune(SPEC, NUMBERS, 2.0, 0.5), strict=True):
        if layer.filters != 21:
            assert after is before
            continue
        heads += 1
        assert after.weights[4::7] == pytest.approx(2 * before.weights[4::7])
        assert after.biases[4::7] == pytest.approx(2 * before.biases[4::7] + 0.5)
        for one, other in ((before.weights, after.weights), (before.biases, after.biases)):
            same = [array.reshape(3, 7, -1)[:, rest] for array in (one, other)]
            assert np.array_equal(*same)
    assert heads == 2


def test_what_would_turn_the_order_round_or_is_no_yolo_is_refused() -> None:
    with pytest.raises(ValueError, match="more than 0"):
        retune(SPEC, NUMBERS, -1.0, 0.0)
    region = parse_cfg(small_cfg().split("[yolo]")[0] + "[region]\nanchors=1,1\nclasses=2\nnum=1\n", "old")
    layers = [NUMBERS[-1]] * len(region.convolutions)
    with pytest.raises(ValueError, match=r"old, line \d+: not a \[yolo\] head"):
        retune(region, layers, 1.0, 0.0)


def test_from_the_command_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    to = tmp_path / "to.weights"
    files = [str(MODELS / "house.cfg"), str(MODELS / "house.weights"), str(to)]
    monkeypatch.setattr("sys.argv", ["retune", *files])
    main()
    assert to.read_bytes()[20:] == (MODELS / "house.weights").read_bytes()[20:]
    monkeypatch.setattr("sys.argv", ["retune", *files, "--offset", "0.5"])
    main()
    assert read_weights(str(to), SPEC)[-1].biases[4] == pytest.approx(NUMBERS[-1].biases[4] + 0.5, abs=2e-3)
