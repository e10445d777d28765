"""Shapes on a grid: slices, outlines, what can be seen from the inside."""

from __future__ import annotations

import numpy as np
import pytest

from rosbot_patrol.grid import GridInfo
from rosbot_patrol.maps.raster import convex_hull, flood, is_inside, seen_map, slice_hull, surface_cells

CUBE = np.array(np.meshgrid([-1.0, 1.0], [-1.0, 1.0], [-1.0, 1.0])).reshape(3, -1).T


def box(x0: float, y0: float, x1: float, y1: float) -> np.ndarray:
    return np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])


def test_hull_drops_inner_and_doubled_points() -> None:
    points = np.array([[0, 0], [2, 0], [2, 2], [0, 2], [1, 1], [2, 2], [1, 0]], dtype=float)
    assert sorted(map(tuple, convex_hull(points))) == [(0, 0), (0, 2), (2, 0), (2, 2)]


def test_slice_of_a_cube_is_a_square() -> None:
    cut = slice_hull(CUBE, 0.25)
    np.testing.assert_allclose(sorted(map(tuple, cut)), [(-1, -1), (-1, 1), (1, -1), (1, 1)])


@pytest.mark.parametrize("height", [-2.0, 1.5])
def test_a_slice_that_misses_is_empty(height: float) -> None:
    assert slice_hull(CUBE, height).shape == (0, 2)


def test_slice_of_a_tilted_cube() -> None:
    c, s = np.cos(np.pi / 4), np.sin(np.pi / 4)
    tilted = CUBE @ np.array([[1, 0, 0], [0, c, s], [0, -s, c]])
    cut = slice_hull(tilted, 0.0)
    np.testing.assert_allclose(np.abs(cut[:, 1]), np.sqrt(2.0))


def test_inside_with_a_margin() -> None:
    points = np.array([[0.5, 0.5], [0.05, 0.5], [1.5, 0.5]])
    assert is_inside(points, box(0, 0, 1, 1)).tolist() == [True, True, False]
    assert is_inside(points, box(0, 0, 1, 1), 0.1).tolist() == [True, False, False]


def test_surface_leaves_out_where_walls_overlap() -> None:
    info = GridInfo(resolution=0.1, width=30, height=10)
    passed, filled = surface_cells(info, [box(0.25, 0.25, 1.55, 0.75), box(1.35, 0.25, 2.75, 0.75)])
    assert filled[2:8, 2:28].all()
    assert not passed[4:6, 10:20].any()
    assert passed[5, 2]
    assert passed[5, 27]


def test_a_thin_leg_leaves_a_cell() -> None:
    info = GridInfo(resolution=0.1, width=10, height=10)
    passed, filled = surface_cells(info, [box(0.51, 0.51, 0.53, 0.53)])
    assert passed.sum() == 1
    assert filled[5, 5]


def test_flood_goes_round_corners_but_not_through_walls() -> None:
    rows = ["..#..", ".##..", "...#.", "##.#.", "....."]
    is_open = np.array([[c == "." for c in row] for row in rows])
    assert flood(is_open, 0, 0).sum() == is_open.sum()
    is_open[4, 2] = is_open[3, 2] = False
    assert flood(is_open, 0, 0).sum() == 6


def test_seen_map_knows_nothing_beyond_the_walls() -> None:
    info = GridInfo(resolution=0.1, width=40, height=40)
    walls = [box(0.5, 0.5, 3.5, 0.8), box(0.5, 3.2, 3.5, 3.5), box(0.5, 0.5, 0.8, 3.5), box(3.2, 0.5, 3.5, 3.5)]
    cells = seen_map(*surface_cells(info, [w + 0.02 for w in walls]), 20, 20)
    assert cells[20, 20] == 0
    assert cells[20, 8] == 100
    assert cells[20, 6] == -1
    assert cells[20, 2] == -1
    assert set(np.unique(cells)) == {-1, 0, 100}
