"""Recorded turns: what is read, and what is counted of them."""

from __future__ import annotations

import gzip
import json
from pathlib import Path

import pytest
from belief_pictures import COLUMNS, FOCAL, WEST, eye_at

from rosbot_patrol.errors import BagError
from rosbot_patrol.patrol.belief.fitting import Samples
from rosbot_patrol.patrol.belief.recorded import read_scenes
from rosbot_patrol.patrol.belief.samples import add_scene

SIGHT = {"x": -3.0, "y": 0.0, "first": 0.0, "step": 0.0175, "lengths": [5.0] * 360}
SCENE = {
    "scene": 1,
    "world": "flat",
    "kind": "person",
    "subject": [0.0, 0.0, 0.0],
    "columns": COLUMNS,
    "rows": 480,
    "fx": FOCAL,
    "light": 1.0,
}
LOOK = {"stage": "turn", "target": None, "truth": [0.08, -0.08, 0.4, -0.1, 9000.0], "sight": SIGHT}


def box(xmin: int, score: float, **given: object) -> dict[str, object]:
    measured = {"x": 0.0, "y": 0.0, "error": 0.1, "away": 3.0, "top": 1.7, "height": 1.7, "width": 0.5}
    sides = {"xmin": xmin, "xmax": xmin + 90, "ymin": 20, "ymax": 295}
    return {"probability": score, **sides, "measured": measured | given}


def picture(stamp: float, *boxes: dict[str, object]) -> dict[str, object]:
    return {"stamp": stamp, "eye": list(WEST), "boxes": {"house": list(boxes)}}


def written(folder: Path, *lines: object) -> Path:
    path = folder / "turns.jsonl.gz"
    with gzip.open(path, "wt") as file:
        file.writelines(json.dumps(line) + "\n" for line in lines)
    return path


def test_a_scene_is_read(tmp_path: Path) -> None:
    (scene,) = read_scenes(written(tmp_path, SCENE, LOOK, picture(0.1, box(275, 0.9)), picture(0.2)))
    assert scene.has_person
    (look,) = scene.looks
    assert look.is_turn
    first, second = look.frames["house"]
    assert first.boxes[0].measured is not None
    assert second.boxes == ()
    left, top, right, bottom = scene.box_of(look, eye_at(WEST)) or (0.0,) * 4
    assert (left + right) / 2.0 == pytest.approx(COLUMNS / 2.0, abs=1.0)
    assert top < 240 < bottom


def test_the_person_s_boxes_and_misses_are_counted(tmp_path: Path) -> None:
    samples = Samples()
    lines = [SCENE, LOOK, picture(0.1, box(275, 0.9)), picture(0.2), picture(0.3, box(500, 0.3))]
    for scene in read_scenes(written(tmp_path, *lines)):
        add_scene(samples, scene, "house")
    assert [score for _, score in samples.persons[1, 0]] == [0.9, 0.0, 0.0]
    (found,) = samples.false.values()
    assert [score for _, score in found] == [0.3]
    assert samples.pictures == [3, 0]


def test_what_size_or_depth_tells_is_not_counted_by_its_score(tmp_path: Path) -> None:
    samples = Samples()
    poster = SCENE | {"kind": "poster"}
    for scene in read_scenes(written(tmp_path, poster, LOOK, picture(0.1, box(500, 0.9, is_flat=True)))):
        add_scene(samples, scene, "house")
    assert not samples.false
    assert not samples.persons


def test_a_file_that_is_no_record(tmp_path: Path) -> None:
    path = tmp_path / "bad.jsonl.gz"
    path.write_bytes(b"garbage")
    with pytest.raises(BagError, match=r"holds no recorded turns .* make it with benchmarks/record_turns\.py"):
        list(read_scenes(path))
    with pytest.raises(BagError, match="it begins with no scene"):
        list(read_scenes(written(tmp_path, LOOK)))
    with pytest.raises(BagError, match="holds no recorded turns"):
        list(read_scenes(tmp_path / "gone.jsonl.gz"))
