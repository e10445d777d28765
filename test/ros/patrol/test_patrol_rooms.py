"""The patrol's thread of the rooms outlives bad maps, says so, and takes the next good one; no master."""

import threading
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("rospy", reason="needs ROS: source the workspace first")

import rospy
from nav_msgs.msg import OccupancyGrid

from rosbot_patrol.patrol.house.rooms import load_rooms
from rosbot_patrol.patrol.senses.house_map import HouseMap
from rosbot_patrol.ros.patrol import sight_topics
from rosbot_patrol.ros.runtime.diagnostics import ERROR, OK, WARN
from rosbot_patrol.ros.runtime.node import Worker

ROOT = Path(__file__).parents[3]


class Health:
    def __init__(self) -> None:
        self.told: list[tuple[str, int, str]] = []
        self.came = threading.Event()

    def set(self, part: str, level: int, message: str) -> None:
        self.told.append((part, level, message))
        self.came.set()


@pytest.fixture
def listening(monkeypatch: pytest.MonkeyPatch) -> tuple[sight_topics.MapTopic, HouseMap, Health]:
    """The map's topic with nothing to listen to."""
    health = Health()
    monkeypatch.setattr(rospy, "Subscriber", lambda *_, **__: None)
    monkeypatch.setattr(sight_topics, "now", lambda: 0.0)
    house_map = HouseMap(load_rooms(ROOT / "params" / "room_points.yaml"), health)
    return sight_topics.MapTopic(house_map), house_map, health


def hall() -> OccupancyGrid:
    message = OccupancyGrid()
    message.info.resolution, message.info.width, message.info.height = 0.2, 200, 200
    message.info.origin.position.x = message.info.origin.position.y = -15.0
    message.info.origin.orientation.w = 1.0
    message.data = np.zeros(200 * 200, np.int8)
    return message


def cut(message: OccupancyGrid) -> None:
    message.data = message.data[:-1]


def flat(message: OccupancyGrid) -> None:
    message.info.resolution = 0.0


def empty(message: OccupancyGrid) -> None:
    message.info.width, message.data = 0, message.data[:0]


def unknown(message: OccupancyGrid) -> None:
    message.data = np.full_like(message.data, -1)


@pytest.mark.parametrize("spoil", [cut, flat, empty, unknown])
def test_a_bad_map_is_told_and_the_next_good_one_taken(listening, spoil) -> None:
    topic, rooms, health = listening
    bad = hall()
    spoil(bad)
    topic._on_map(bad)
    assert health.came.wait(10.0)
    assert health.told[-1][:2] == ("map", ERROR)
    assert rooms.house is None
    health.came.clear()
    topic._on_map(hall())
    assert health.came.wait(10.0)
    assert health.told[-1][:2] == ("map", OK)
    assert rooms.house is not None


def test_a_bad_map_after_a_good_one_leaves_the_rooms_as_they_are(listening) -> None:
    topic, rooms, health = listening
    topic._on_map(hall())
    assert health.came.wait(10.0)
    house = rooms.house
    health.came.clear()
    bad = hall()
    cut(bad)
    topic._on_map(bad)
    assert health.came.wait(10.0)
    assert health.told[-1][:2] == ("map", WARN)
    assert "has 39999 cells, expected 200 x 200" in health.told[-1][2]
    assert rooms.house is house


def test_the_thread_is_one_that_ends_the_node_with_it(listening) -> None:
    assert any(isinstance(thread, Worker) and thread.name == "rooms" for thread in threading.enumerate())
