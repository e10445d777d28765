"""Objectness moved, and nothing else."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from small_networks import small_cfg

from rosbot_patrol.detection.darknet.cfg import parse_cfg, read_cfg
from rosbot_patrol.detection.darknet.weights import read_weights
from training.judging.scoring import Found
from training.pictures.labels import COLUMNS
from training.surgery.retune import find_figures, main, retune

MODELS = Path(__file__).parents[2] / "models"
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


def found_false(probabilities: np.ndarray, pictures: int) -> Found:
    """Boxes of persons, all of them false, in pictures with nobody."""
    boxes = np.zeros((len(probabilities), 9))
    boxes[:, 2], boxes[:, 7] = probabilities, -1
    return Found(boxes, np.zeros((0, len(COLUMNS))), np.zeros(0), np.zeros((pictures, 2), int))


def test_as_many_are_false_above_a_threshold_as_are_wanted() -> None:
    sure = np.random.default_rng(1).uniform(0.02, 0.7, 300)
    gain, offset = find_figures(found_false(sure, 2000), {0.4: 50.0, 0.8: 10.0})
    moved = 1 / (1 + np.exp(-(gain * np.log(sure / (1 - sure)) + offset)))
    assert (moved > 0.4).sum() == 100
    assert (moved > 0.8).sum() == 20


@pytest.mark.parametrize(("boxes", "pictures"), [(100, 2000), (300, 10), (0, 2000)])
def test_too_little_to_tell_by_is_said(boxes: int, pictures: int) -> None:
    sure = np.linspace(0.02, 0.7, boxes)
    with pytest.raises(ValueError, match=f"{boxes} false boxes in {pictures} pictures .* draw more pictures"):
        find_figures(found_false(sure, pictures), {0.4: 50.0, 0.8: 10.0})


def test_where_there_are_no_pictures_the_command_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    files = [str(MODELS / "house.cfg"), str(MODELS / "house.weights"), str(tmp_path / "to.weights")]
    monkeypatch.setattr("sys.argv", ["retune", *files, "--data", str(tmp_path), "--name", "vary_1"])
    with pytest.raises(SystemExit, match=r"retune: .* holds no pictures named vary_1"):
        main()


@pytest.mark.parametrize(
    ("more", "message"),
    [([], "belong together"), (["--name", "vary_1", "--gain", "1.1"], "give the one or the others")],
)
def test_figures_are_found_or_given(more: list[str], message: str, monkeypatch: pytest.MonkeyPatch, capsys) -> None:
    monkeypatch.setattr("sys.argv", ["retune", "house.cfg", "from.weights", "to.weights", "--data", "here", *more])
    with pytest.raises(SystemExit):
        main()
    assert message in capsys.readouterr().err


def test_from_the_command_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    to = tmp_path / "to.weights"
    files = [str(MODELS / "house.cfg"), str(MODELS / "house.weights"), str(to)]
    monkeypatch.setattr("sys.argv", ["retune", *files])
    main()
    assert to.read_bytes()[20:] == (MODELS / "house.weights").read_bytes()[20:]
    monkeypatch.setattr("sys.argv", ["retune", *files, "--offset", "0.5"])
    main()
    assert read_weights(str(to), SPEC)[-1].biases[4] == pytest.approx(NUMBERS[-1].biases[4] + 0.5, abs=2e-3)
