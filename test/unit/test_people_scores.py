"""Scores and pictures of benchmarks/real_people.py, against cases worked out by hand."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import people_pictures
import pytest
import real_people
from people_pictures import Photograph
from people_scores import Answer, average_precision, iou, score


def rows(*boxes: tuple[float, ...], columns: int) -> np.ndarray:
    return np.array(boxes, dtype=np.float64).reshape(-1, columns)


def answer(persons: list[tuple[float, ...]], boxes: list[tuple[float, ...]], height: int = 100) -> Answer:
    return Answer(height, rows(*persons, columns=4), rows(*boxes, columns=5))


def test_overlap() -> None:
    one = rows((0, 0, 10, 10), columns=4)
    others = rows((0, 0, 10, 10), (5, 0, 15, 10), (10, 0, 20, 10), (30, 30, 30, 30), columns=4)
    assert iou(one, others) == pytest.approx(np.array([[1.0, 1 / 3, 0.0, 0.0]]))
    assert iou(rows(columns=4), others).shape == (0, 4)


def test_each_person_is_found_once_by_the_surest_box() -> None:
    one = answer([(0, 0, 10, 40), (50, 0, 60, 40)], [(0.5, 0, 0, 10, 40), (0.9, 0, 0, 10, 38), (0.8, 51, 0, 61, 40)])
    assert one.matches().tolist() == [-1, 0, 1]


def test_a_box_goes_to_the_person_it_overlaps_most() -> None:
    # two people half behind each other: the surer box lies on the second
    one = answer([(0, 0, 10, 40), (4, 0, 14, 40)], [(0.9, 3, 0, 13, 40), (0.6, 1, 0, 11, 40)])
    assert one.matches().tolist() == [1, 0]


def test_least_overlap() -> None:
    one = answer([(0, 0, 10, 10)], [(0.9, 0, 0, 10, 4.5)])
    assert one.matches().tolist() == [0]
    assert one.matches(0.5).tolist() == [-1]


def test_counts_by_size_and_empty_pictures() -> None:
    counted = score(
        [
            answer([(0, 0, 9, 30), (20, 0, 30, 29), (40, 0, 44, 9)], [(0.9, 0, 0, 9, 30), (0.8, 40, 0, 44, 9)]),
            answer([], [(0.7, 0, 0, 9, 30), (0.7, 20, 0, 29, 30)]),
            answer([], []),
        ]
    )
    assert counted.there == {"small": 1, "medium": 1, "big": 1}
    assert counted.found == {"small": 1, "medium": 0, "big": 1}
    assert (counted.boxes, counted.false, counted.empty, counted.alarms) == (4, 2, 2, 1)
    assert counted.recall("big") == 1.0
    assert counted.precision == 0.5
    nothing = score([])
    assert (nothing.recall("big"), nothing.precision) == (0.0, 0.0)


def test_average_precision() -> None:
    # by probability: right, false, right; one of three persons is never found
    two = answer([(0, 0, 10, 40), (50, 0, 60, 40)], [(0.9, 0, 0, 10, 40), (0.5, 50, 0, 60, 40)])
    other = answer([(0, 0, 10, 40)], [(0.7, 80, 0, 90, 40)])
    assert average_precision([two, other]) == pytest.approx(1 / 3 * 1 + 1 / 3 * 2 / 3)
    assert average_precision([answer([(0, 0, 10, 40)], [])]) == 0.0
    assert average_precision([]) == 0.0


def photograph(*persons: tuple[float, ...]) -> Photograph:
    return Photograph("a.jpg", np.full((400, 600, 3), 200, dtype=np.uint8), rows(*persons, columns=4))


def test_legs_of_whole_people_only() -> None:
    whole = (260, 100, 340, 300)
    others = [
        (0, 100, 80, 300),  # cut by the border
        (400, 150, 540, 350),  # sits: less than 1.8 times as high as wide
        (500, 100, 530, 210),  # too small
    ]
    one = photograph(whole, *others)
    (crop,) = people_pictures.crop_legs([one])
    # from 55 % of the height to 5 % of it below the feet: rows 210 to 310, 4:3 around x 300
    assert crop.pixels.shape == (100, 133, 3)
    assert crop.persons.tolist() == [[260 - 233, 0, 340 - 233, 90]]


def test_dark_pictures() -> None:
    one = photograph()
    first, again, other = (people_pictures.darken([one], seed)[0].pixels for seed in (0, 0, 1))
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)
    assert first.mean() == pytest.approx(20.0, abs=0.1)
    assert first.std() == pytest.approx(people_pictures.NOISE, abs=0.1)


def test_photographs_that_are_absent(tmp_path: Path) -> None:
    with pytest.raises(SystemExit, match=r"has no coco\.json; give the folder .* with --people FOLDER"):
        people_pictures.find_people(tmp_path)
    (tmp_path / "coco.json").write_text(json.dumps({"a.jpg": {"size": [4, 3], "persons": []}}))
    assert people_pictures.find_people(tmp_path) == tmp_path
    with pytest.raises(SystemExit, match=r"a\.jpg is missing or no picture"):
        people_pictures.read_set(tmp_path, "coco")


def test_figures_are_those_of_the_default() -> None:
    row = dict.fromkeys(("big_recall", "empty_alarms", "legs", "dark", "ms", "mb"), 0.5)
    both = {name: {**row, "ms": ms} for name, ms in (("ssdlite", 9.0), ("yolo-fastest-1.1-xl", 12.0))}
    pair = "yolo-fastest-1.1-xl and ssdlite"
    found = real_people.figures({**both, pair: {**row, "big_recall": 0.9}}, pair)
    assert (found["default_ms"], found["ssdlite_ms"], found["big_recall_two"]) == (12.0, 9.0, 0.9)
    assert real_people.figures({"ssdlite": both["ssdlite"]}, "")["default_ms"] == 9.0
    assert "default_ms" not in real_people.figures({"hog": row}, "")
