from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rosbot_patrol.detection.darknet.cfg import read_cfg
from rosbot_patrol.detection.darknet.random_weights import random_weights
from rosbot_patrol.detection.darknet.weights import format_weights, read_weights
from training.surgery import average

CFG = str(Path(__file__).parents[2] / "models/house.cfg")


def test_each_number_is_the_mean_of_both(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    spec = read_cfg(CFG)
    pair = [random_weights(spec, np.random.default_rng(seed)) for seed in (1, 2)]
    files = [str(tmp_path / name) for name in ("one", "other", "to")]
    for file, layers in zip(files, pair, strict=False):
        Path(file).write_bytes(format_weights(spec, layers))
    monkeypatch.setattr("sys.argv", ["average", CFG, *files])
    average.main()
    for one, other, mean in zip(*pair, read_weights(files[2], spec), strict=True):
        np.testing.assert_allclose(mean.weights, (one.weights + other.weights) / 2, rtol=1e-3)
        np.testing.assert_allclose(mean.biases, (one.biases + other.biases) / 2, rtol=1e-3)
        assert (mean.scales is None) == (one.scales is None)


def test_it_says_how_it_is_called(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.argv", ["average", CFG])
    with pytest.raises(SystemExit, match="usage"):
        average.main()
