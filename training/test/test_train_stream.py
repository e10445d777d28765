"""Training while pictures are drawn; needs PyTorch and what draws in one environment, as `train_network --stream`."""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import numpy as np
import pytest
from oblongs import BLUE
from oblongs import write_shard as write_views
from small_networks import small_cfg

torch = pytest.importorskip("torch", reason="PyTorch is installed only in the environment of scripts/train_network")
pytest.importorskip("moderngl", reason="moderngl is in .ws/train only after scripts/train_network --stream")

from training.learning.train_stream import Feed, StreamTrainer, read_views  # noqa: E402

CFG = small_cfg(384, 288, 16, "40,100")


def write_shard(folder: Path, number: int, count: int = 3) -> Path:
    file = folder / f"stream-{number:05d}.npy"
    write_views(file, count, BLUE)
    return file


def options(folder: Path, **changed: object) -> argparse.Namespace:
    (folder / "small.cfg").write_text(CFG)
    given: dict[str, object] = {"cfg": folder / "small.cfg", "start": None, "seed": 1}
    given |= {"weights": folder / "new.weights", "minutes": 0.1, "batch": 2, "rate": 1e-3, "cool": 0.5, "least": 6}
    given |= {"views": 9, "reserve": 1.0, "compile": False, "checkpoint": None}
    return argparse.Namespace(**(given | changed))


def test_shards_come_once_and_their_files_go(tmp_path: Path) -> None:
    feed = Feed(tmp_path, 2, pin=False)
    for number in range(3):
        write_shard(tmp_path, number)
    counts = [len(feed.ready.get(timeout=10).rows) for _ in range(3)]  # type: ignore[union-attr]
    assert counts == [3, 3, 3]
    end = time.monotonic() + 10
    while list(tmp_path.iterdir()) and time.monotonic() < end:
        time.sleep(0.05)
    assert not list(tmp_path.iterdir())
    assert feed.ready.empty()


def test_a_shard_without_masks_is_refused_by_its_name(tmp_path: Path) -> None:
    file = write_shard(tmp_path, 4)
    np.savez(file.with_suffix(".npz"), boxes=np.zeros((0, 14), np.float32))
    with pytest.raises(ValueError, match=r"stream-00004\.npy has no masks"):
        read_views(file)
    with pytest.raises(ValueError, match=r"stream-00004\.npy has no masks"):
        StreamTrainer(options(tmp_path, minutes=5)).run(Feed(tmp_path, 1, pin=False), [])


def test_it_learns_from_what_is_drawn_and_writes_the_weights(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    trainer = StreamTrainer(options(tmp_path))
    for number in range(2):
        write_shard(tmp_path, number)
    trainer.run(Feed(tmp_path, 1, pin=False), [])
    assert trainer.learner.step > 0
    assert trainer.pool.size == 6
    assert (tmp_path / "new.weights").stat().st_size == 20 + 4 * (4 * 4 + 27 * 4 + 7 + 4 * 7)
    assert "6 drawn, 6 held" in capsys.readouterr().out


def test_it_goes_on_from_a_checkpoint(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    given = {"checkpoint": tmp_path / "checkpoint.pt", "least": 3}
    trainer = StreamTrainer(options(tmp_path, minutes=0.1, **given))
    write_shard(tmp_path, 0)
    trainer.run(Feed(tmp_path, 1, pin=False), [])
    again = StreamTrainer(options(tmp_path, minutes=0.101, **given))
    assert again.drawn_before == 3
    again.run(Feed(tmp_path, 1, pin=False), [])
    assert "going on after " in capsys.readouterr().out
    assert again.learner.step == trainer.learner.step > 0


def test_the_end_of_a_process_that_draws_is_an_error(tmp_path: Path) -> None:
    class Ended:
        exitcode = 1

    with pytest.raises(RuntimeError, match="draws"):
        StreamTrainer(options(tmp_path, minutes=5)).run(Feed(tmp_path, 1, pin=False), [Ended()])  # type: ignore[list-item]


def test_minutes_that_are_over_before_the_first_step_are_an_error(tmp_path: Path) -> None:
    write_shard(tmp_path, 0)
    with pytest.raises(RuntimeError, match=r"nothing was learnt in 0\.05 minutes: 3 of the 100 views"):
        StreamTrainer(options(tmp_path, minutes=0.05, least=100)).run(Feed(tmp_path, 1, pin=False), [])
    assert not (tmp_path / "new.weights").exists()
