"""Changes of the house's files: comments stay, wrong values change nothing, other files follow, undo."""

from __future__ import annotations

from pathlib import Path

import pytest

from rosbot_patrol.alerts.channels.config import Surroundings
from rosbot_patrol.console.house import edit
from rosbot_patrol.console.house.files import KNOWN, SHAPES, Given, HouseFiles
from rosbot_patrol.errors import AccessError, ParamError
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.patrol.house.own_files import CHANNELS, ROOMS, SCHEDULE, SENSORS
from rosbot_patrol.patrol.house.rooms import Room
from rosbot_patrol.patrol.intruder.known_objects import KnownObject

ROOMS_TEXT = """\
# my rooms
rooms_num: 3
angle_unit: deg
rooms:
  room0: {name: base, x: 0, y: 0, angle: 0}
  room1:
    name: hall   # where the coats are
    x: 1.0
    y: 2.0
    angle: 90
  room2: {name: kitchen, x: 3, y: 4, angle: 0}
"""


@pytest.fixture
def house(tmp_path: Path) -> HouseFiles:
    rooms = tmp_path / "my_rooms.yaml"
    rooms.write_text(ROOMS_TEXT)
    return HouseFiles(tmp_path / "state", Given(rooms=str(rooms)), Surroundings(home=tmp_path, environ={}))


def room(number: int, name: str, x: float = 5.0, yaw: float = 0.0) -> Room:
    return Room(id=number, name=name, pose=Pose2D(x, 6.0, yaw))


def text(house: HouseFiles, name: str) -> str:
    return house.path(name).read_text()


def test_a_room_is_changed_where_it_stands_and_comments_stay(house: HouseFiles) -> None:
    edit.save_room(house, room(1, "corridor", yaw=1.5708))
    written = text(house, ROOMS)
    assert "# my rooms" in written
    assert "# where the coats are" in written
    assert house.rooms is not None
    assert [each.name for each in house.rooms] == ["base", "corridor", "kitchen"]
    assert house.rooms.get(1).pose.yaw == pytest.approx(1.5708, abs=1e-3)


def test_a_room_is_added(house: HouseFiles) -> None:
    edit.save_room(house, room(3, "study"))
    assert house.rooms is not None
    assert [each.name for each in house.rooms] == ["base", "hall", "kitchen", "study"]


@pytest.mark.parametrize(
    ("given", "key", "problem"),
    [
        (room(1, " "), "name", "is empty, expected a name"),
        (room(1, "Kitchen"), "name", "is 'Kitchen', which room2 has already"),
        (room(1, "hall", x=float("nan")), "x", "expected a number [m], got nan"),
        (room(7, "study"), "rooms_num", "expected at most 256 rooms, in order"),
    ],
)
def test_a_wrong_room_changes_nothing(house: HouseFiles, given: Room, key: str, problem: str) -> None:
    with pytest.raises(ParamError) as refused:
        edit.save_room(house, given)
    assert refused.value.name.endswith(key)
    assert str(house.path(ROOMS)) in refused.value.name
    assert refused.value.problem == problem
    assert text(house, ROOMS) == ROOMS_TEXT
    assert house.undoable == ""


def test_the_first_room_of_a_new_house_is_the_base(tmp_path: Path) -> None:
    house = HouseFiles(tmp_path, Given(), Surroundings(home=tmp_path, environ={}))
    assert house.rooms is None
    edit.save_room(house, room(0, "base"))
    assert house.rooms is not None
    assert house.rooms.base.name == "base"
    assert house.path(ROOMS) == tmp_path / "house" / "rooms.yaml"


def test_a_removed_room_leaves_no_wrong_numbers(house: HouseFiles) -> None:
    edit.save_sensor(house, 9, 2, "window", is_enabled=True)
    edit.save_round(house, "", {"name": "evening", "at": ["22:30"], "rooms": [2]})
    edit.save_modes(house, {"night": {"rooms": [0, 2]}}, [2])
    edit.remove_sensor(house, 1)
    edit.remove_room(house, 1)
    assert house.rooms is not None
    assert [each.name for each in house.rooms] == ["base", "kitchen"]
    assert {spec.id: spec.room for spec in house.sensors} == {2: 1, 9: 1}
    assert house.rounds[0].rooms == (1,)
    assert house.rules.modes["night"].rooms == frozenset({0, 1})
    assert house.rules.entry_rooms == frozenset({1})
    assert house.undo() == "1 (hall)"
    assert house.rooms is not None
    assert len(house.rooms) == 3
    assert {spec.id: spec.room for spec in house.sensors} == {2: 2, 9: 2}


def test_a_room_that_is_needed_stays(house: HouseFiles) -> None:
    edit.save_round(house, "", {"name": "evening", "at": ["22:30"], "rooms": ["kitchen"]})
    with pytest.raises(AccessError, match="kitchen is still part of a mode or a round"):
        edit.remove_room(house, 2)
    edit.save_sensor(house, 9, 1, "", is_enabled=True)
    with pytest.raises(AccessError, match="hall is still watched by the motion sensor 1"):
        edit.remove_room(house, 1)
    with pytest.raises(AccessError, match="the robot needs its base"):
        edit.remove_room(house, 0)


def test_sensors(house: HouseFiles) -> None:
    edit.save_sensor(house, 9, 2, "window", is_enabled=False)
    assert {(spec.id, spec.room, spec.name, spec.enabled) for spec in house.sensors} == {
        (1, 1, "", True),
        (2, 2, "", True),
        (9, 2, "window", False),
    }
    with pytest.raises(ParamError, match="there is no room 7"):
        edit.save_sensor(house, 9, 7, "", is_enabled=True)
    for number in (1, 2, 9):
        edit.remove_sensor(house, number)
    assert not house.path(SENSORS).exists()
    assert not house.sensors.has_file


def test_rounds(house: HouseFiles) -> None:
    edit.save_round(house, "", {"name": "evening", "at": ["22:30"], "days": ["mon"], "every": 0.0, "rooms": []})
    edit.save_round(house, "evening", {"name": "late", "every": 3600.0, "at": []})
    (entry,) = house.rounds
    assert (entry.name, entry.every, entry.rooms) == ("late", 3600.0, (1, 2, 0))
    with pytest.raises(ParamError, match=r"which rounds\[0\] has already"):
        edit.save_round(house, "", {"name": "late", "every": 60.0})
    with pytest.raises(ParamError, match="either times of day"):
        edit.save_round(house, "", {"name": "never"})
    edit.remove_round(house, "late")
    assert house.rounds == ()
    assert "rounds" in text(house, SCHEDULE)


def test_quiet_hours(house: HouseFiles) -> None:
    edit.save_quiet_hours(house, [{"from": "22:00", "to": "06:00", "days": ["sat", "sun"]}])
    (window,) = house.rules.quiet_hours
    assert (window.start, window.end, window.days) == (1320, 360, frozenset({5, 6}))
    with pytest.raises(ParamError, match="expected a time of day"):
        edit.save_quiet_hours(house, [{"from": "", "to": "06:00"}])


def test_zones_and_objects(house: HouseFiles) -> None:
    edit.add_zone(house, "dog", [(0, 0), (1, 0), (1, 1)])
    edit.add_zone(house, "cat", [(0, 0), (1, 0), (1, 1)])
    with pytest.raises(ParamError, match="which another zone has already"):
        edit.add_zone(house, "cat", [(0, 0), (1, 0), (1, 1)])
    with pytest.raises(ParamError, match="lie on a line"):
        edit.add_zone(house, "line", [(0, 0), (1, 0), (2, 0)])
    edit.remove_zone(house, "dog")
    assert [zone.name for zone in house.zones] == ["cat"]
    edit.add_object(house, KnownObject(x=1.0, y=2.0, name="coat stand"))
    with pytest.raises(ParamError, match="expected at most 5"):
        edit.add_object(house, KnownObject(x=1.0, y=2.0, radius=9.0, name="all of it"))
    assert [thing.name for thing in house.known] == ["coat stand"]
    house.path(KNOWN).write_text(text(house, KNOWN) + "  # the one in the hall\n")
    edit.add_object(house, KnownObject(x=3.0, y=4.0, name="statue: mine"))
    assert [thing.name for thing in house.known] == ["coat stand", "statue: mine"]
    assert "# the one in the hall" in text(house, KNOWN)
    edit.remove_object(house, 1)
    edit.remove_object(house, 0)
    assert house.known == ()
    assert house.path(SHAPES).exists()
    assert house.path(KNOWN).exists()


def test_channels_keep_their_secrets_in_files_of_their_own(house: HouseFiles, tmp_path: Path) -> None:
    given = {"type": "smtp", "to": "a@example.org", "host": "mail.example.org", "user": "a", "security": "starttls"}
    edit.save_channel(house, "mail2", given, ("password_file", "swordfish"))
    secret = house.secrets / "mail2"
    assert secret.read_text() == "swordfish\n"
    assert secret.stat().st_mode & 0o777 == 0o600
    assert "swordfish" not in text(house, CHANNELS)
    assert edit.channel_types(house) == {"mail2": "smtp"}
    with pytest.raises(ParamError) as refused:
        edit.save_channel(house, "mail2", {**given, "security": "none"}, ("password_file", "other"))
    assert refused.value.name.endswith("security")
    assert secret.read_text() == "swordfish\n"
    with pytest.raises(ParamError, match="expected a name of letters"):
        edit.save_channel(house, "../x", given, ("password_file", "x"))
    assert not (tmp_path / "x").exists()
    edit.remove_channel(house, "mail2")
    assert not house.path(CHANNELS).exists()
    assert house.undo() == "channel mail2"
    assert edit.channel_types(house) == {"mail2": "smtp"}


def test_there_is_one_undo(house: HouseFiles) -> None:
    with pytest.raises(AccessError, match="the last change is not known any more"):
        house.undo()
    edit.save_room(house, room(3, "study"))
    assert house.undoable == "3 (study)"
    assert house.undo() == "3 (study)"
    assert text(house, ROOMS) == ROOMS_TEXT
    assert house.undoable == ""


def test_a_file_that_somebody_has_broken_is_named(house: HouseFiles) -> None:
    house.path(ROOMS).write_text("rooms: [")
    with pytest.raises(ParamError, match=r"my_rooms\.yaml"):
        edit.save_room(house, room(1, "hall"))


def test_the_rooms_of_a_new_house_are_marked_one_by_one_though_its_sensors_are_known(tmp_path: Path) -> None:
    sensors = tmp_path / "my_sensors.yaml"
    sensors.write_text("sensors: [{id: 1, room: 1}, {id: 2, room: 2}]\n")
    given, around = Given(sensors=str(sensors)), Surroundings(home=tmp_path, environ={})
    house = HouseFiles(tmp_path / "state", given, around, is_new=True)
    for number, name in enumerate(("base", "hall", "kitchen")):
        edit.save_room(house, room(number, name))
    assert [spec.room for spec in house.sensors] == [1, 2]
    later = HouseFiles(tmp_path / "state", given, around)
    with pytest.raises(ParamError, match="there is no room 9"):
        edit.save_sensor(later, 9, 9, "", is_enabled=True)
