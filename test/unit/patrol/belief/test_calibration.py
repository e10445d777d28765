"""Calibrations: fit, file, and what is refused."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from belief_pictures import calibration
from hypothesis import given
from hypothesis import strategies as st

from rosbot_patrol.detection.choice import REAL_CAMERAS
from rosbot_patrol.detection.ssd.model_file import GRAPH_SHA256
from rosbot_patrol.errors import DetectorError
from rosbot_patrol.patrol.belief.calibration import (
    CAUTIOUS,
    EDGES,
    Condition,
    outcome,
    read_calibration,
    save_calibration,
)
from rosbot_patrol.patrol.belief.fitting import Samples, fit, fit_fooled, fit_rho, rising
from rosbot_patrol.patrol.belief.networks import find_calibration
from rosbot_patrol.patrol.belief.samples import add_photograph
from rosbot_patrol.patrol.records.inputs import Box


def photographs(seen: float, *, rho: float = 0.0, pictures: int = 400, seed: int = 1) -> Samples:
    """Sides of ten pictures each; a person is found in a share of them, with a score about 0.9."""
    rng, samples = np.random.default_rng(seed), Samples()
    for k in range(pictures // 10):
        strength = (1.0 - rho) / rho if rho else 1e6
        chance = rng.beta(strength * seen, strength * (1.0 - seen))
        for _ in range(10):
            score = float(rng.uniform(0.8, 0.99)) if rng.random() < chance else 0.0
            samples.persons[k].append((Condition(0.3), score))
            samples.pictures[0] += 1
    return samples


def test_round_trip(tmp_path: Path) -> None:
    path = tmp_path / "test.json"
    save_calibration(path, calibration())
    found = read_calibration(path)
    assert found.network == "test"
    assert (found.rho_person, found.rho_nobody, found.fooled) == (0.6, 0.3, 0.5)
    np.testing.assert_allclose(found.person, calibration().person, atol=1e-8)
    np.testing.assert_allclose(found.nobody, calibration().nobody, atol=1e-8)


@pytest.mark.parametrize(
    "text", ["", "no json", "[]", "{}", '{"format": 1}', '{"format": 2}', "null", '{"format": 1, "edges": 3}']
)
def test_garbage_is_refused_in_a_sentence(tmp_path: Path, text: str) -> None:
    path = tmp_path / "bad.json"
    path.write_text(text)
    with pytest.raises(DetectorError, match=r"bad\.json is no calibration of a network"):
        read_calibration(path)


@pytest.mark.parametrize(
    ("key", "value"),
    [("rho_person", 1.5), ("rho_nobody", "x"), ("person", [1.0]), ("sizes", []), ("fooled_by_pets", 1.0)],
)
def test_a_bad_value_is_refused(tmp_path: Path, key: str, value: object) -> None:
    path = tmp_path / "bad.json"
    save_calibration(path, calibration())
    tree = json.loads(path.read_text()) | {key: value}
    path.write_text(json.dumps(tree))
    with pytest.raises(DetectorError, match="is no calibration"):
        read_calibration(path)


def test_a_file_from_before_pets_were_counted_is_cautious_of_them(tmp_path: Path) -> None:
    path = tmp_path / "old.json"
    save_calibration(path, replace(calibration(), fooled=0.1))
    assert read_calibration(path).fooled == 0.1
    tree = json.loads(path.read_text())
    del tree["fooled_by_pets"]
    path.write_text(json.dumps(tree))
    assert read_calibration(path).fooled == CAUTIOUS.fooled


@pytest.mark.parametrize(("boxes", "low", "high"), [(0, 0.0, 0.03), (4, 0.08, 0.16), (40, 0.9, 1.0)])
def test_how_many_pets_fool_a_network(boxes: int, low: float, high: float) -> None:
    """Of forty looks at pets so many show a box in each picture; nine persons in ten have one."""
    samples = photographs(0.9)
    assert fit_fooled(samples) == CAUTIOUS.fooled  # nobody has shown it a pet
    for k in range(40):
        samples.pets[k] = [0.5 if k < boxes else 0.05] * 6
    assert low < fit(samples, "test", "sum").fooled < high


def test_a_file_that_is_gone(tmp_path: Path) -> None:
    with pytest.raises(DetectorError, match="cannot be read: No such file"):
        read_calibration(tmp_path / "gone.json")


def test_a_network_is_found_by_its_sum_or_by_name(tmp_path: Path) -> None:
    save_calibration(tmp_path / "test.json", calibration())
    gone = tmp_path / "gone"
    assert find_calibration([gone, tmp_path], "another name", "sum").network == "test"
    assert find_calibration([tmp_path], "test").sha256 == "sum"


def test_both_networks_for_a_real_camera_have_one() -> None:
    shipped = [Path(__file__).parents[4] / "config" / "calibrations"]
    for name in REAL_CAMERAS:
        assert find_calibration(shipped, name).network == name
    assert find_calibration(shipped, "ssdlite", GRAPH_SHA256).network == "ssdlite"


def test_a_network_without_one_is_told_in_a_sentence(tmp_path: Path) -> None:
    save_calibration(tmp_path / "test.json", calibration())
    (tmp_path / "bad.json").write_text("{}")
    with pytest.raises(DetectorError) as raised:
        find_calibration([tmp_path], "test", "another sum")
    said = str(raised.value)
    assert said.startswith("there is no calibration of the network 'test'; ")
    assert "bad.json is no calibration of a network" in said
    assert "test.json is of other weights" in said


@pytest.mark.parametrize(("score", "index"), [(0.0, 0), (0.049, 0), (0.05, 1), (0.5, 4), (0.95, 7), (1.0, 7)])
def test_bins(score: float, index: int) -> None:
    assert outcome(score) == index


def test_the_fit_finds_how_often_a_person_is_missed() -> None:
    found = fit(photographs(0.7), "test", "sum")
    assert found.person[Condition(0.3).cell][0] == pytest.approx(0.3, abs=0.08)
    assert found.nobody[Condition(0.3).cell][0] > 0.99
    np.testing.assert_allclose(found.person.sum(axis=-1), 1.0)
    np.testing.assert_allclose(found.nobody.sum(axis=-1), 1.0)


def test_the_fit_finds_that_pictures_agree() -> None:
    alike, free = fit(photographs(0.5, rho=0.7), "a", ""), fit(photographs(0.5), "b", "")
    assert alike.rho_person > 0.5 > 0.2 > free.rho_person


def test_few_photographs_keep_the_cautious_correlation() -> None:
    samples = Samples()
    box = Box(label="person", probability=0.9, xmin=100, ymin=100, xmax=200, ymax=300)
    for _ in range(5):
        add_photograph(samples, [(100.0, 100.0, 200.0, 300.0)], [box], (640, 480))
    found = fit(samples, "test", "sum")
    assert found.rho_person == CAUTIOUS.rho_person
    assert found.person[Condition(0.3).cell][outcome(0.9)] > CAUTIOUS.person[Condition(0.3).cell][outcome(0.9)]


def test_false_boxes_of_photographs_lower_what_a_box_says() -> None:
    def told(false: int) -> float:
        samples = photographs(0.7)
        box = Box(label="person", probability=0.9, xmin=400, ymin=100, xmax=480, ymax=290)
        for k in range(50):
            add_photograph(samples, [], [box] if k < false else [], (640, 480))
        found, at = fit(samples, "test", ""), (*Condition(0.3).cell, outcome(0.9))
        return float(np.log(found.person[at] / found.nobody[at]))

    assert told(0) > told(5) > told(40)


def test_nobody_to_fit() -> None:
    with pytest.raises(DetectorError, match="no picture shows a person"):
        fit(Samples(), "test", "sum")


@given(st.lists(st.tuples(st.floats(-5.0, 5.0), st.floats(0.1, 3.0)), min_size=1, max_size=10))
def test_isotonic_regression_rises_and_keeps_the_mean(pairs: list[tuple[float, float]]) -> None:
    values, weights = np.array(pairs).T
    found = rising(values, weights)
    assert (np.diff(found) >= -1e-9).all()
    assert float((found * weights).sum()) == pytest.approx(float((values * weights).sum()), abs=1e-6)


def test_a_fitted_ratio_rises_with_the_score() -> None:
    found = fit(photographs(0.7), "test", "sum")
    ratios = np.log(found.person[..., 1:] / found.nobody[..., 1:])
    assert (np.diff(ratios, axis=-1) >= -1e-6).all()


def test_correlation_without_sides() -> None:
    assert fit_rho([]) == CAUTIOUS.rho_nobody
    assert len(EDGES) == replace(CAUTIOUS).person.shape[-1]
