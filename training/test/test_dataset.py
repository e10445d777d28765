"""Shards on disk as pictures and labels, read from there or kept in memory."""

from pathlib import Path

import numpy as np
import pytest

from training.learning.dataset import JPEGS, Pictures, batch_of, pack_masks
from training.pictures.labels import COLUMNS, HEIGHT, WIDTH


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Two shards of two pictures each; in each picture a person."""
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    for shard in range(2):
        picture = np.stack([x * 0.5 + 40 * shard, y * 0.8, (x + y) * 0.3], axis=-1).astype(np.uint8)
        rows = np.zeros((2, len(COLUMNS)))
        rows[:, COLUMNS.index("picture")] = 0, 1
        rows[:, COLUMNS.index("x0")], rows[:, COLUMNS.index("x1")] = 0.25, 0.5
        rows[:, COLUMNS.index("y0")], rows[:, COLUMNS.index("y1")] = 0.5, 1.0
        np.save(tmp_path / f"room-{shard:04d}.npy", np.stack([picture, picture[::-1]]))
        np.savez(tmp_path / f"room-{shard:04d}.npz", boxes=rows)
    return tmp_path


def test_pictures_in_memory_are_those_on_disk(folder: Path) -> None:
    disk = Pictures.open(folder, "room,room")  # listed twice, it counts twice
    memory = disk.pack()
    assert len(memory) == len(disk) == 8
    assert memory.shards[0] is memory.shards[2]  # but is kept once
    for shard, i in disk.index():
        off = np.abs(memory.picture(shard, i).astype(int) - disk.picture(shard, i))
        assert off.mean() < 2.0
    _, rows = batch_of(memory, memory.index()[:2], None)
    assert rows[0, 2:6].tolist() == [144.0, 216.0, 96.0, 144.0]


def test_shards_of_jpegs_are_read_like_the_others(folder: Path) -> None:
    disk = Pictures.open(folder, "room")
    memory = disk.pack()
    for shard in range(2):
        memory.shards[shard].save(folder / f"small-{shard:04d}{JPEGS}")
        labels = np.load(folder / f"room-{shard:04d}.npz")["boxes"]
        np.savez(folder / f"small-{shard:04d}.npz", boxes=labels)
    small = Pictures.open(folder, "small,small")
    assert len(small) == 8
    assert small.shards[0] is small.shards[2]
    for shard, i in disk.index():
        assert (small.picture(shard, i) == memory.picture(shard, i)).all()
    assert small.pack().shards[1] is small.shards[1]


def test_no_pictures_of_a_name(folder: Path) -> None:
    with pytest.raises(FileNotFoundError, match="holds no pictures named hall"):
        Pictures.open(folder, "hall")


def test_pictures_with_masks_are_mixed_by_chance_and_as_they_are_without(folder: Path) -> None:
    masks = np.zeros((2, HEIGHT, WIDTH), np.uint8)
    masks[:, 144:, 96:192] = 1
    for shard in range(2):
        file = folder / f"room-{shard:04d}.npz"
        rows = np.load(file)["boxes"]
        rows[:, COLUMNS.index("mask")] = 1
        rows[:, COLUMNS.index("pixels")], rows[:, COLUMNS.index("seen_of_part")] = 38400, 1.0
        np.savez(file, boxes=rows, **pack_masks(masks))
    pictures = Pictures.open(folder, "room")
    view = pictures.pack().view(1, 0)
    assert view is not None
    assert (view.mask == masks[0]).all()
    assert (view.picture == pictures.pack().picture(1, 0)).all()
    plain, rows = batch_of(pictures, pictures.index(), None)
    assert rows[:, 2:6].tolist() == [[144.0, 216.0, 96.0, 144.0]] * 4
    counts = set()
    for seed in range(8):
        images, rows = batch_of(pictures, pictures.index(), np.random.default_rng(seed))
        again, rows_again = batch_of(pictures, pictures.index(), np.random.default_rng(seed))
        assert (images == again).all()
        assert (rows == rows_again).all()
        assert (images != plain).any()
        assert (rows[:, 2] - rows[:, 4] / 2 >= 0).all()
        assert (rows[:, 2] + rows[:, 4] / 2 <= WIDTH).all()
        counts.add(len(rows))
    assert len(counts) > 1  # some came in from other pictures
