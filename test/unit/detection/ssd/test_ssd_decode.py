"""Boxes from encodings, computed by hand."""

from __future__ import annotations

import numpy as np
import pytest

from rosbot_patrol.detection.ssd.decode import decode

ANCHORS = np.array([[0.5, 0.5, 0.2, 0.4], [0.25, 0.75, 0.1, 0.1]], dtype=np.float32)


def encoded(*rows: tuple[float, float, float, float]) -> np.ndarray:
    return np.array(rows, dtype=np.float32)


def test_zeros_are_the_anchor() -> None:
    found = decode(np.zeros((2, 4), np.float32), np.array([[0, 3], [0, 2]], np.float32), ANCHORS, threshold=0.5)
    assert found.boxes == pytest.approx(ANCHORS)
    assert found.objectness == pytest.approx(1 / (1 + np.exp([-3.0, -2.0])))
    assert found.probabilities[:, 0] == pytest.approx(found.objectness)


def test_shift_and_size_in_the_coders_scale() -> None:
    # y by 5 / 10 of the height, x by -10 / 10 of the width, height by exp(5 ln 2 / 5), width by exp(-5 ln 4 / 5)
    raw = encoded((5.0, -10.0, 5 * np.log(2), -5 * np.log(4)), (0, 0, 0, 0))
    found = decode(raw, np.array([[0, 1], [0, -1]], np.float32), ANCHORS, threshold=0.5)
    assert found.boxes == pytest.approx(np.array([[0.5 - 0.2, 0.5 + 0.2, 0.05, 0.8]]))


def test_threshold_is_on_the_person_not_the_background() -> None:
    logits = np.array([[9.0, -1.0], [-9.0, 0.1]], np.float32)
    found = decode(np.zeros((2, 4), np.float32), logits, ANCHORS, threshold=0.5)
    assert found.boxes == pytest.approx(ANCHORS[1:])
    assert len(decode(np.zeros((2, 4), np.float32), logits, ANCHORS, threshold=0.9)) == 0


def test_values_that_are_no_numbers_give_no_box() -> None:
    logits = np.array([[0.0, np.nan], [0.0, -np.inf]], np.float32)
    assert len(decode(encoded((np.nan,) * 4, (1e9,) * 4), logits, ANCHORS, threshold=0.3)) == 0
