"""Maps that make no sense are refused with their topic and the reason; a good one comes through."""

import math

import numpy as np
import pytest

pytest.importorskip("rospy", reason="needs ROS: source the workspace first")

from nav_msgs.msg import OccupancyGrid

from rosbot_patrol.errors import MapError
from rosbot_patrol.ros.messages.convert import grid_from_msg


def hall() -> OccupancyGrid:
    message = OccupancyGrid()
    message.info.resolution, message.info.width, message.info.height = 0.05, 4, 3
    message.info.origin.position.x, message.info.origin.orientation.w = -1.0, 1.0
    message.data = [0] * 11 + [100]
    return message


def wrong(place: str, value: object) -> OccupancyGrid:
    message = hall()
    *path, last = place.split(".")
    holder = message
    for name in path:
        holder = getattr(holder, name)
    setattr(holder, last, value)
    return message


@pytest.mark.parametrize(
    ("place", "value", "said"),
    [
        ("data", [0] * 11, "has 11 cells, expected 4 x 3"),
        ("data", [0] * 13, "has 13 cells, expected 4 x 3"),
        ("data", [], "has 0 cells, expected 4 x 3"),
        ("info.width", 0, "has 0 x 3 cells, expected at least one"),
        ("info.height", 0, "has 4 x 0 cells, expected at least one"),
        ("info.width", 2**32 - 1, f"has 12 cells, expected {2**32 - 1} x 3"),
        ("info.resolution", 0.0, "has cells of 0 m, expected 0.001 to 100 m"),
        ("info.resolution", -0.05, "has cells of -0.05 m, expected 0.001 to 100 m"),
        ("info.resolution", 1e-9, "has cells of 1e-09 m, expected 0.001 to 100 m"),
        ("info.resolution", math.nan, "has cells of nan m, expected 0.001 to 100 m"),
        ("info.resolution", math.inf, "has cells of inf m, expected 0.001 to 100 m"),
        ("info.origin.position.x", math.nan, "has an origin that makes no sense: (nan, 0.0) is no position"),
        ("info.origin.position.y", -math.inf, "has an origin that makes no sense: (-1.0, -inf) is no position"),
        ("info.origin.orientation.w", math.nan, "has an origin that makes no sense: (0.0, 0.0, 0.0, nan) is no orient"),
    ],
)
def test_a_map_that_makes_no_sense_is_refused_by_its_topic(place: str, value: object, said: str) -> None:
    with pytest.raises(MapError) as caught:
        grid_from_msg(wrong(place, value), "/map")
    assert str(caught.value).startswith(f"/map: {said}")


@pytest.mark.parametrize("data", [[0] * 11 + [100], np.array([0] * 11 + [100], np.int8)])
def test_a_good_map_comes_through(data: object) -> None:
    grid = grid_from_msg(wrong("data", data), "/map")
    assert grid.cells.shape == (3, 4)
    assert grid.cells[2, 3] == 100
    assert grid.info.origin_x == -1.0
