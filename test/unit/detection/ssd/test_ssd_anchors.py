"""Anchors of TensorFlow's ssd_anchor_generator, computed by hand."""

from __future__ import annotations

import numpy as np
import pytest

from rosbot_patrol.detection.ssd.anchors import make_anchors
from rosbot_patrol.detection.ssdlite import GRIDS


def test_number_and_order() -> None:
    anchors = make_anchors(GRIDS)
    assert anchors.shape == (3 * 19**2 + 6 * (10**2 + 5**2 + 3**2 + 2**2 + 1), 4)
    assert anchors.dtype == np.float32
    # cell by cell along a row, then the next row
    assert anchors[[0, 3, 3 * 19], :2] == pytest.approx(np.array([[1, 1], [3, 1], [1, 3]]) / 38)


def test_finest_map() -> None:
    wanted = [(0.1, 0.1), (0.2 * 2**0.5, 0.2 / 2**0.5), (0.2 / 2**0.5, 0.2 * 2**0.5)]
    assert make_anchors(GRIDS)[:3, 2:] == pytest.approx(np.array(wanted))


def test_second_map() -> None:
    at = 3 * 19**2
    wanted = [
        (0.35, 0.35),
        (0.35 * 2**0.5, 0.35 / 2**0.5),
        (0.35 / 2**0.5, 0.35 * 2**0.5),
        (0.35 * 3**0.5, 0.35 / 3**0.5),
        (0.35 * 0.3333**0.5, 0.35 / 0.3333**0.5),
        (0.41833, 0.41833),  # sqrt(0.35 * 0.5)
    ]
    anchors = make_anchors(GRIDS)[at : at + 6]
    assert anchors[:, :2] == pytest.approx(np.full((6, 2), 0.05))
    assert anchors[:, 2:] == pytest.approx(np.array(wanted), abs=1e-5)


def test_coarsest_map() -> None:
    last = make_anchors(GRIDS)[-6:]
    assert last[:, :2] == pytest.approx(np.full((6, 2), 0.5))
    assert last[0, 2:] == pytest.approx([0.95, 0.95])
    assert last[5, 2:] == pytest.approx([0.95**0.5] * 2)  # the scale after the last is 1
