"""Maps, good and bad, and what is told of them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from senses_world import Health

from rosbot_patrol.errors import MapError
from rosbot_patrol.grid import Grid, GridInfo, occupancy_grid
from rosbot_patrol.patrol.house.rooms import load_rooms
from rosbot_patrol.patrol.senses.health import ERROR, OK, WARN
from rosbot_patrol.patrol.senses.house_map import HouseMap

ROOT = Path(__file__).parents[4]


def made() -> tuple[HouseMap, Health]:
    health = Health()
    return HouseMap(load_rooms(ROOT / "params" / "room_points.yaml"), health), health


def hall(fill: int = 0) -> Grid:
    info = GridInfo(resolution=0.2, width=200, height=200, origin_x=-15.0, origin_y=-15.0)
    return occupancy_grid(info, np.full(200 * 200, fill, np.int8), "/map")


def corner() -> Grid:
    """A hall of 4 x 4 m far from all rooms."""
    info = GridInfo(resolution=0.2, width=20, height=20, origin_x=100.0, origin_y=100.0)
    return occupancy_grid(info, np.zeros(400, np.int8), "/map")


def test_a_map_without_floor_is_told_and_the_next_good_one_taken() -> None:
    house_map, health = made()
    house_map.hear(hall(fill=-1))
    assert health.told[-1][:2] == ("map", ERROR)
    assert house_map.house is None
    house_map.hear(hall())
    assert health.told[-1][:2] == ("map", OK)
    assert house_map.house is not None


def test_a_bad_map_after_a_good_one_leaves_the_rooms_as_they_are() -> None:
    house_map, health = made()
    house_map.hear(hall())
    house = house_map.house
    with pytest.raises(MapError) as refused:
        occupancy_grid(hall().info, np.zeros(39999, np.int8), "/map")
    house_map.refuse(refused.value)
    assert health.told[-1][:2] == ("map", WARN)
    assert "has 39999 cells, expected 200 x 200" in health.told[-1][2]
    assert house_map.house is house


def test_rooms_that_are_not_on_the_map_are_named(caplog: pytest.LogCaptureFixture) -> None:
    house_map, health = made()
    house_map.hear(hall())
    assert health.parts["rooms"] == (OK, "all rooms are on the map")
    house_map.hear(corner())
    level, text = health.parts["rooms"]
    assert level == ERROR
    assert text.count("is not on free floor of the map") == len(load_rooms(ROOT / "params" / "room_points.yaml"))
    assert "until then it is not looked at" in caplog.text
    assert "the robot stays where its missions end" in caplog.text
