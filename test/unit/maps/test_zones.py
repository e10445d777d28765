"""Zones as polygons: read strictly, drawn by the even-odd rule."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rosbot_patrol.errors import ParamError
from rosbot_patrol.grid import GridInfo
from rosbot_patrol.maps.zones import Zone, read_zones, zones_grid, zones_mask

INFO = GridInfo(resolution=0.5, width=6, height=4, origin_x=-1.0, origin_y=0.0)


def test_no_file_is_no_zone(tmp_path: Path) -> None:
    assert read_zones(tmp_path / "zones.yaml") == ()


def test_zones_are_read(tmp_path: Path) -> None:
    file = tmp_path / "zones.yaml"
    file.write_text("zones:\n  - {name: dog, points: [[0, 0], [1, 0], [1, 1.5]]}\n")
    assert read_zones(file) == (Zone(name="dog", points=((0.0, 0.0), (1.0, 0.0), (1.0, 1.5))),)


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("zones: 3", "zones"),
        ("zones: [7]", "zones[0]/"),
        ("zones: [{name: dog, points: [[0, 0], [1, 0]]}]", "zones[0]/points: are 2, expected 3 to 100 corners"),
        ("zones: [{name: dog, points: [[0, 0], [1, 0], [2, 0]]}]", "zones[0]/points: lie on a line"),
        ("zones: [{name: dog, points: [[0, 0], [1, x], [2, 0]]}]", "zones[0]/points[1]: is [1, 'x'], expected [x, y]"),
        ("zones: [{name: '', points: [[0, 0], [1, 0], [1, 1]]}]", "zones[0]/name: is '', expected one line of text"),
        ("zones: [{points: [[0, 0], [1, 0], [1, 1]]}]", "zones[0]/name"),
        ("zones: [{name: dog, colour: red, points: [[0, 0], [1, 0], [1, 1]]}]", "colour"),
    ],
)
def test_a_wrong_file_is_named_with_its_key(tmp_path: Path, text: str, problem: str) -> None:
    file = tmp_path / "zones.yaml"
    file.write_text(text)
    with pytest.raises(ParamError) as refused:
        read_zones(file)
    assert str(file) in str(refused.value)
    assert problem in str(refused.value)


def test_a_mask_holds_the_cells_whose_centres_are_inside_whichever_way_round() -> None:
    points = ((-0.5, 0.5), (1.5, 0.5), (1.5, 1.5), (-0.5, 1.5))
    expected = np.zeros((4, 6), bool)
    expected[1:3, 1:5] = True
    for corners in (points, points[::-1]):
        assert (zones_mask([Zone(name="a", points=corners)], INFO) == expected).all()


def test_a_hollow_shape_is_hollow() -> None:
    u = Zone(name="u", points=((-1, 0), (2, 0), (2, 2), (1, 2), (1, 1), (0, 1), (0, 2), (-1, 2)))
    mask = zones_mask([u], INFO)
    assert mask.tolist() == [[True] * 6] * 2 + [[True, True, False, False, True, True]] * 2


def test_a_zone_beyond_the_grid_is_cut() -> None:
    far = Zone(name="far", points=((1.0, -5.0), (50.0, -5.0), (50.0, 50.0), (1.0, 50.0)))
    assert zones_mask([far], INFO)[:, 4:].all()
    assert not zones_mask([far], INFO)[:, :4].any()


def test_a_grid_of_no_zones_says_nothing() -> None:
    assert zones_grid(()).cells.tolist() == [[-1]]


def test_a_grid_covers_its_zones() -> None:
    grid = zones_grid((Zone(name="a", points=((1.0, 1.0), (2.0, 1.0), (2.0, 1.5), (1.0, 1.5))),))
    assert grid.cells.shape == (10, 20)
    assert (grid.cells == 100).all()
    assert (grid.info.origin_x, grid.info.origin_y) == (1.0, 1.0)
