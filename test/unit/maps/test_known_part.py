"""Maps cut to what is known."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rosbot_patrol.grid import Grid, GridInfo
from rosbot_patrol.maps.known_part import known_part


def small_map(**place: float) -> Grid:
    cells = np.full((10, 20), -1, dtype=np.int8)
    cells[4:6, 7:9] = 0
    return Grid(GridInfo(resolution=0.5, width=20, height=10, **place), cells)


@pytest.mark.parametrize(
    ("margin", "corner", "size"),
    [(0.0, (2.5, 5.0), (2, 2)), (0.5, (2.0, 4.5), (4, 4)), (0.7, (1.5, 4.0), (6, 6)), (100.0, (-1.0, 3.0), (20, 10))],
)
def test_a_margin_stays_within_the_map(margin: float, corner: tuple[float, float], size: tuple[int, int]) -> None:
    whole = small_map(origin_x=-1.0, origin_y=3.0)
    part = known_part(whole, margin)
    assert (part.info.origin_x, part.info.origin_y) == corner
    assert (part.info.width, part.info.height) == size
    assert part.at(2.6, 5.1) == whole.at(2.6, 5.1) == 0
    assert np.count_nonzero(part.cells == 0) == 4


def test_a_turned_map_stays_where_it_is() -> None:
    part = known_part(small_map(origin_x=1.0, origin_y=2.0, yaw=0.5 * math.pi))
    assert (part.info.origin_x, part.info.origin_y) == pytest.approx((1.0 - 2.0, 2.0 + 3.5))


def test_of_an_unknown_map_one_cell_is_left() -> None:
    assert known_part(
        Grid(GridInfo(resolution=0.5, width=20, height=10), np.full((10, 20), -1)), 1.0
    ).cells.tolist() == [[-1]]
