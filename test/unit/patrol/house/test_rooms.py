import logging
import math
from pathlib import Path

import pytest

from rosbot_patrol.errors import ParamError
from rosbot_patrol.patrol.house.rooms import load_rooms

PARAMS = Path(__file__).parents[4] / "params"

ROOM = '  room{i}: {{name: "{name}", x: {x}, y: 2, angle: {angle}}}\n'


def text(num=2, unit="angle_unit: deg\n", angle="90", name="hall", listed=2, x="1"):
    rooms = "".join(ROOM.format(i=i, name=name, x=x, angle=angle) for i in range(listed))
    return f"rooms_num: {num}\n{unit}rooms:\n{rooms}"


@pytest.fixture
def write(tmp_path):
    def writer(content):
        path = tmp_path / "rooms.yaml"
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return path

    return writer


@pytest.mark.parametrize(("name", "count"), [("room_points.yaml", 8), ("room_points_tutorial.yaml", 11)])
def test_the_files_we_ship(name, count):
    rooms = load_rooms(PARAMS / name)
    assert len(rooms) == count
    assert rooms.base.pose == (0.0, 0.0, 0.0)
    assert rooms.find(7).pose == (14.75, 11.48, 0.0)
    assert rooms.find(count) is None


def test_tutorial_angles_are_degrees():
    rooms = load_rooms(PARAMS / "room_points_tutorial.yaml")
    assert rooms.find(9).pose.yaw == pytest.approx(math.radians(45))
    assert rooms.find(10).pose.yaw == pytest.approx(math.pi)


def test_without_unit_angles_are_radians_and_a_big_one_is_warned_of(write, caplog):
    with caplog.at_level(logging.WARNING):
        rooms = load_rooms(write(text(unit="", angle="30")))
    assert math.degrees(rooms.find(1).pose.yaw) == pytest.approx(-81.1, abs=0.05)
    assert "rooms/room1/angle is 30 and is read in radians" in caplog.text


def test_small_radians_are_not_warned_of(write, caplog):
    assert load_rooms(write(text(unit="angle_unit: rad\n", angle="1.5"))).find(1).pose.yaw == 1.5
    assert "is read in radians" not in caplog.text


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (text(num=3), "rooms.yaml: rooms_num: is 3, expected exactly room0 to room2 under rooms: room2 not listed"),
        (text(num=1), "rooms_num: is 1, expected exactly room0 to room0 under rooms: room1 beyond it"),
        (text(num=0), "rooms.yaml: rooms_num: is 0, expected at least 1"),
        (text(num=257), "rooms_num: is 257, expected at most 256"),
        ("rooms: {}", "rooms.yaml: rooms_num: is missing, expected a whole number"),
        ("rooms_num: 1", "rooms.yaml: rooms: is missing"),
        (text(x="north"), "rooms.yaml: rooms/room0/x: expected a number [m], got 'north'"),
        (text(x=".inf"), "rooms/room0/x: is inf, expected a finite number"),
        (text(x="true"), "rooms/room0/x: expected a number [m], got True"),
        ("rooms_num: 1\nrooms:\n  room0: {name: a, x: 1, angle: 0}", "rooms.yaml: rooms/room0/y: is missing"),
        ("rooms_num: 1\nrooms:\n  room0: 5", "rooms/room0/: expected a group of parameters, got 5"),
        (text(unit="angle_unit: grad\n"), "angle_unit: is 'grad', expected one of"),
        (text(name="a\\nBcc: evil@x.org"), "rooms/room0/name: is 'a\\nBcc: evil@x.org', expected one line"),
        (text(name=""), "rooms/room0/name: is empty"),
        ("rooms_num: [", "rooms.yaml: is no valid yaml at line 1"),
        ("rooms_num: 1\nrooms_num: 2", "the key 'rooms_num' stands twice"),
        ("a\tb: \x00", "rooms.yaml: is no valid yaml"),
        (b"\xff\xfe\x00", "rooms.yaml: is no text in UTF-8"),
        ("", "rooms.yaml: expected the keys rooms_num and rooms"),
        ("- 1", "rooms.yaml: expected the keys rooms_num and rooms"),
    ],
)
def test_a_bad_file_is_one_sentence_with_file_and_key(write, content, said):
    with pytest.raises(ParamError) as caught:
        load_rooms(write(content))
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_file_that_is_not_there(tmp_path):
    with pytest.raises(ParamError, match=r"nowhere\.yaml: cannot be read: No such file"):
        load_rooms(tmp_path / "nowhere.yaml")


def test_refusal_names_the_id_and_the_file(write):
    rooms = load_rooms(write(text()))
    assert rooms.refusal(9) == f"there is no room 9: {rooms.source} has the rooms 0 to 1"


def test_two_rooms_of_one_name_are_said(write, caplog):
    entries = "".join(
        f"  room{i}: {{name: {name}, x: {i}, y: 0, angle: 0}}\n" for i, name in enumerate(("a", "Hall", "hall"))
    )
    rooms = load_rooms(write(f"rooms_num: 3\nrooms:\n{entries}"))
    assert len(rooms) == 3
    assert "rooms.yaml: rooms/room2/name is 'hall', as room 1's" in caplog.text
