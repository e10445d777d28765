"""Training on shards; needs PyTorch, as `test_network.py`."""

from __future__ import annotations

import argparse
from pathlib import Path

import pytest
from oblongs import write_shard
from small_networks import small_cfg

torch = pytest.importorskip("torch", reason="PyTorch is installed only in the environment of scripts/train_network")

from training.learning.train import Trainer  # noqa: E402


@pytest.fixture
def options(tmp_path: Path) -> argparse.Namespace:
    """Of a training of three epochs of two steps, on a shard of four pictures."""
    write_shard(tmp_path / "room-0000.npy", 4)
    (tmp_path / "small.cfg").write_text(small_cfg(384, 288, 16, "40,100"))
    return argparse.Namespace(
        data=tmp_path, name="room", cfg=tmp_path / "small.cfg", weights=tmp_path / "new.weights",
        checkpoint=tmp_path / "checkpoint.pt", start=None, epochs=3, samples=4, batch=2, rate=1e-3, cool=0.5,
        minutes=None, seed=1, loaders=0, bf16=False, muon=False, freeze=0, pack=True, compile=False, anchors=False,
    )  # fmt: skip


def trained(options: argparse.Namespace) -> dict:
    """What the checkpoint holds after it."""
    Trainer(options).run()
    return torch.load(options.checkpoint, weights_only=True)


def test_a_training_that_was_stopped_goes_on_after_its_last_epoch(options: argparse.Namespace) -> None:
    begun = trained(argparse.Namespace(**(vars(options) | {"epochs": 1})))
    assert (begun["epoch"], begun["step"]) == (1, 2)
    ended = trained(options)
    assert (ended["epoch"], ended["step"]) == (3, 6)
    assert ended["spent"] > begun["spent"] > 0.0
    assert options.weights.stat().st_size > 0


def test_the_minutes_of_the_runs_before_count(options: argparse.Namespace, capsys: pytest.CaptureFixture[str]) -> None:
    options.minutes, options.epochs = 10.0, 1
    begun = trained(options)
    torch.save(begun | {"spent": 599.99}, options.checkpoint)
    options.epochs = 100_000
    ended = trained(options)
    assert 1 <= ended["epoch"] < 1000
    assert "going on after epoch 1 and 600 s" in capsys.readouterr().out
    assert trained(options)["step"] == ended["step"]  # nothing is left of them
