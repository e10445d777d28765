"""Room points marked on a map."""

from __future__ import annotations

import logging
from pathlib import Path

import pytest
from floors import drawn_floor

from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.patrol.house.rooms import Room, Rooms, load_rooms, save_rooms
from rosbot_patrol.patrol.visibility.marking import Marks

FLOOR = drawn_floor(
    "###############",
    "#......#......#",
    "#......#......#",
    "#.............#",
    "#......#......#",
    "###############",
    "#......#      #",
    "#......#      #",
    "###############",
)  # two rooms with a door, a shut one below


@pytest.fixture
def marks() -> Marks:
    made = Marks()
    made.add("base", 1.5, 2.5)
    return made


@pytest.mark.parametrize(
    ("place", "told"),
    [
        ((5.5, 2.5), ""),
        ((8.0, 2.5), "no floor there; the nearest place for it is (6."),
        ((5.5, 1.0), "the map shows no floor there"),
        ((40.0, 40.0), "the map shows no floor there"),
        ((0.6, 2.5), "0.10 m from the nearest thing, and the robot needs 0.20 m to turn; the nearest place"),
        ((1.5, 1.0), "no way leads there from room 0 (base)"),
        ((1.7, 2.4), "room 0 (base) is there already"),
    ],
)
def test_places(marks: Marks, place: tuple[float, float], told: str) -> None:
    problem = marks.problem(FLOOR, *place)
    assert told in problem
    assert bool(problem) == bool(told)


def test_the_base_needs_no_way_from_anywhere() -> None:
    assert Marks().problem(FLOOR, 1.5, 1.0) == ""


def test_names(marks: Marks) -> None:
    assert marks.name_problem("Küche") == ""
    assert "room 0 (base) has that name" in marks.name_problem(" Base ")
    assert "is empty" in marks.name_problem("  ")
    assert "control characters" in marks.name_problem("a\tb")


def test_what_is_saved_is_what_is_read(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    rooms = [
        Room(id=0, name="base", pose=Pose2D(0.0, 0.0, 1.5)),
        Room(id=1, name="Küche: 2", pose=Pose2D(1.25, -3.0, 0.0)),
    ]
    save_rooms(tmp_path / "points.yaml", rooms)
    with caplog.at_level(logging.WARNING):
        found = list(load_rooms(tmp_path / "points.yaml"))
    assert [room.name for room in found] == ["base", "Küche: 2"]
    assert found[0].pose == pytest.approx(rooms[0].pose, abs=0.001)
    assert found[1].pose == rooms[1].pose
    assert not caplog.text
    again = Marks(Rooms(tuple(found)))
    assert again.add("hall", 1.0, 1.0).id == 2
    assert not again.is_full
