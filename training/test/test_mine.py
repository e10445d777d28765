from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from training.judging.scoring import Found
from training.learning.dataset import HIDDEN, Packed, Pictures, pack_masks
from training.surgery import mine


def label(picture: int, **change: float) -> list[float]:
    return [picture, 0, 0.2, 0.1, 0.4, 0.9, 3.0, 1.0, change.get("part", 1.0), 9000, 100, 0, 50]


def test_misses_and_false_alarms_count_by_their_size() -> None:
    box = [0.5, 0.1, 0.7, 0.9]
    found = Found(
        boxes=np.array([[0, 0, 0.9, *box, 0, 0], [1, 0, 0.7, *box, -1, 0], [3, 0, 0.9, *box, -1, 1]]),
        labels=np.array([label(0), label(2), label(3, part=0.1)]),
        hit=np.array([0.9, 0.3, 0.0]),
        index=np.zeros((4, 2), int),
    )
    assert mine.errors(found, 0.2) == pytest.approx([0.0, 0.7, 0.5, 0.0])


def test_who_hides_need_not_be_as_sure() -> None:
    found = Found(
        boxes=np.zeros((0, 9)),
        labels=np.array([label(0, part=0.3), label(1, part=0.3)]),
        hit=np.array([0.55, 0.2]),
        index=np.zeros((2, 2), int),
    )
    assert mine.errors(found, 0.2) == pytest.approx([0.0, 0.8 * HIDDEN - 0.2])


def test_what_is_picked_is_a_set_like_any_other(tmp_path: Path) -> None:
    shots = np.stack([np.full((288, 384, 3), level, np.uint8) for level in (10, 90, 200)])
    np.save(tmp_path / "a-0000.npy", shots)
    np.savez(tmp_path / "a-0000.npz", boxes=np.array([label(0), label(2)], np.float32))
    mine.write_set(Pictures.open(tmp_path, "a"), np.array([[0, 1], [0, 2]]), tmp_path, "hard")
    picked = Pictures.open(tmp_path, "hard")
    for k in range(2):
        assert np.abs(picked.picture(0, k).astype(int) - shots[k + 1]).max() < 3  # a jpeg
    assert [len(rows) for rows in picked.labels[0]] == [0, 1]


def test_masks_come_along_and_the_jpeg_is_not_made_anew(tmp_path: Path) -> None:
    shots = np.random.default_rng(1).integers(0, 255, (3, 288, 384, 3), np.uint8)
    masks = np.zeros((3, 288, 384), np.uint8)
    masks[2, 100:200, 50:90] = 1
    Packed.of(shots).save(tmp_path / "a-0000.jpegs")
    np.savez(tmp_path / "a-0000.npz", boxes=np.array([label(2)], np.float32), **pack_masks(masks))
    source = Pictures.open(tmp_path, "a")
    mine.write_set(source, np.array([[0, 0], [0, 2]]), tmp_path, "hard")
    picked = Pictures.open(tmp_path, "a,hard,hard")
    assert len(picked) == 7
    assert picked.shards[1] is picked.shards[2]
    assert (picked.picture(1, 1) == source.picture(0, 2)).all()
    view = picked.view(1, 1)
    assert view is not None
    assert (view.mask == masks[2]).all()


def test_a_set_picked_already_stays(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shots = np.full((1, 288, 384, 3), 40, np.uint8)
    for name in ("vary", "hard_vary"):
        Packed.of(shots).save(tmp_path / f"{name}-0000.jpegs")
    models = Path(__file__).parents[2] / "models"
    files = ["--cfg", str(models / "house.cfg"), "--weights", str(models / "house.weights"), "--data", str(tmp_path)]
    monkeypatch.setattr("sys.argv", ["mine", *files, "--name", "vary"])
    mine.main()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["hard_vary-0000.jpegs", "vary-0000.jpegs"]


def test_test_pictures_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys) -> None:
    files = ["--data", str(tmp_path), "--cfg", "x", "--weights", "x"]
    monkeypatch.setattr("sys.argv", ["mine", *files, "--name", "vary,test"])
    with pytest.raises(SystemExit):
        mine.main()
    assert "not for training" in capsys.readouterr().err
