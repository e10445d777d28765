from __future__ import annotations

import math

import numpy as np
import pytest
from floors import DESK, TWO_ROOMS, drawn_floor, drawn_map

from rosbot_patrol.errors import MapError
from rosbot_patrol.grid import Grid, GridInfo
from rosbot_patrol.maps.zones import Zone
from rosbot_patrol.patrol.house.floor import _clearance, floor_of


def test_floor_lies_where_the_map_has_it() -> None:
    floor = drawn_floor(*TWO_ROOMS)
    assert floor.info.resolution == pytest.approx(0.1)
    assert floor.is_free(0.55, 0.55)
    assert not floor.is_free(0.45, 0.55)
    assert not floor.is_free(-5.0, 0.5)
    assert floor.free.sum() * floor.cell_area == pytest.approx(114 * 0.25, rel=1e-6)


def test_floor_of_unknown_cells_is_none() -> None:
    floor = drawn_floor("..  ", "..  ")
    assert floor.is_free(0.9, 0.5)
    assert not floor.is_free(1.2, 0.5)


def test_a_floor_at_the_edge_of_its_map_is_whole() -> None:
    floor = drawn_floor("..", "..")
    assert floor.free.sum() * floor.cell_area == pytest.approx(1.0)


def test_clearance_is_exact() -> None:
    rng = np.random.default_rng(1)
    free = rng.random((30, 40)) > 0.03
    free[[0, -1]] = free[:, [0, -1]] = False
    found = _clearance(free, 9.0)
    solid = np.argwhere(~free)
    for y, x in np.ndindex(free.shape):
        nearest = np.hypot(*(solid - [y, x]).T).min() if free[y, x] else 0.0
        assert found[y, x] == pytest.approx(min(nearest, 9.0))


def test_nearest_cell_of_a_mask() -> None:
    floor = drawn_floor(*TWO_ROOMS)
    ix, iy = floor.nearest(floor.free, 0.0, 0.8) or (0, 0)
    assert floor.info.centre_of(ix, iy) == pytest.approx((0.55, 0.75), abs=0.11)
    assert floor.nearest(floor.free, -3.0, 0.8, within=1.0) is None
    assert floor.nearest(np.zeros(floor.info.shape, bool), 1.0, 1.0) is None


def test_points_mark_what_is_near() -> None:
    floor = drawn_floor(*TWO_ROOMS)
    near = floor.mark_near(np.array([[2.05, 2.05], [99.0, 0.0]]), 0.3)
    iy, ix = np.nonzero(near)
    xs, ys = floor.centres(ix, iy)
    assert np.hypot(xs - 2.05, ys - 2.05).max() <= 0.3 + 1e-9
    assert near.sum() == 29


def test_a_map_without_floor_is_refused_in_a_sentence() -> None:
    with pytest.raises(MapError, match="no free cell"):
        floor_of(drawn_map("##", "##"))


def test_a_turned_map_is_refused() -> None:
    grid = drawn_map("..")
    info = GridInfo(resolution=0.05, width=grid.info.width, height=grid.info.height, yaw=math.pi / 4)
    with pytest.raises(MapError, match="turned"):
        floor_of(Grid(info, grid.cells))


def test_zones_are_floor_where_the_robot_does_not_go() -> None:
    zone = Zone(name="corner", points=((1.0, 1.0), (2.0, 1.0), (2.0, 2.0), (1.0, 2.0)))
    plain, floor = (floor_of(drawn_map(*TWO_ROOMS), zones=zones) for zones in ((), (zone,)))
    assert (floor.free == plain.free).all()

    def clearance(x: float, y: float) -> float:
        ix, iy = floor.info.cell_of(x, y)
        return float(floor.clearance[iy, ix])

    assert clearance(1.5, 1.5) == 0.0
    assert clearance(2.35, 1.5) == pytest.approx(0.35, abs=0.1)
    assert clearance(6.0, 3.0) > 0.9


def test_unknown_cells_that_floor_runs_into_are_unmapped_floor() -> None:
    floor = drawn_floor(*DESK)
    assert floor.unmapped.sum() * floor.cell_area == pytest.approx(1.0, abs=0.05)
    ys, xs = np.nonzero(floor.unmapped)
    assert 2.5 <= xs.min() * 0.1 + floor.info.origin_x <= 2.6
    assert 1.95 <= ys.min() * 0.1 + floor.info.origin_y <= 2.05
    assert floor.are_free(np.array([3.0]), np.array([2.25])).all()
    assert not floor.is_free(3.0, 2.25)  # no place for a room's point
    assert floor.clearance[floor.unmapped].max() < 0.05  # and none to drive to


CLOSED = {
    "a cupboard": ("########", "#..##..#", "#..# #.#", "#..##..#", "########"),
    "outside of a house without walls": ("....", "....", "...."),
}


@pytest.mark.parametrize("what", CLOSED)
def test_unknown_cells_that_nobody_gets_to_are_no_floor(what: str) -> None:
    assert not drawn_floor(*CLOSED[what]).unmapped.any()


def test_unmapped_floor_is_as_deep_as_somebody_hides() -> None:
    deep = drawn_floor("#" * 22, "#...." + " " * 16 + "#", "#" * 22)
    assert not deep.unmapped.any()  # the house ends where the mapped floor does
    deep = drawn_floor("#" * 22, "#...." + " " * 13 + "...#", "#" * 22)
    xs = np.nonzero(deep.unmapped)[1] * 0.1 + deep.info.origin_x
    assert ((xs < 4.3) | (xs > 7.2)).all()
    assert xs.min() < 2.7
    assert xs.max() > 8.7


@pytest.mark.parametrize(("width", "hides"), [(0.1, False), (0.2, False), (0.3, True), (0.5, True)])
def test_somebody_of_whom_less_than_half_was_seen_hides(width: float, hides: bool) -> None:
    floor = drawn_floor(*[6 * "."] * 6)
    iy, ix = np.nonzero(floor.free)
    x, _ = floor.centres(ix, iy)
    unseen = np.zeros_like(floor.free)
    by_wall = x < x.min() + width - 0.05
    unseen[iy[by_wall], ix[by_wall]] = True
    found = floor.hideouts(unseen, 0.2)
    assert found.any() == hides
    assert not (found & ~unseen).any()
