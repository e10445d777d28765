from pathlib import Path

import pytest

from rosbot_patrol.errors import ParamError
from rosbot_patrol.patrol.house.rooms import load_rooms
from rosbot_patrol.sensors.sensor_file import SensorList, load_sensors
from rosbot_patrol.simulation.sensors.sensor_places import read_sensors

ROOT = Path(__file__).resolve().parents[3]
ROOMS = {0: "base", 1: "kitchen", 5: "hall"}


def load(tmp_path, text):
    path = tmp_path / "sensors.yaml"
    path.write_text(text, encoding="utf-8")
    return load_sensors(path, ROOMS, rooms_source="points.yaml")


def test_a_sensors_id_need_not_be_its_room(tmp_path):
    sensors = load(tmp_path, "sensors:\n- {id: 3, room: 5, name: Haustür}\n- {id: 4, room: 5, enabled: false}\n")
    assert sensors.room_of(3) == 5
    assert sensors.title(3) == 'sensor 3 "Haustür" in room 5 (hall)'
    assert sensors.room_of(4) is None
    assert "enabled: false" in sensors.refusal(4)
    assert sensors.room_of(5) is None
    assert sensors.refusal(5).endswith("sensors.yaml has no sensor with id 5")


def test_without_a_file_the_id_is_the_room():
    assert not load_sensors("none", ROOMS, rooms_source="points.yaml").has_file
    sensors = load_sensors("", ROOMS, rooms_source="points.yaml")
    assert not sensors.has_file
    assert [sensors.room_of(i) for i in (0, 1, 2, 5)] == [0, 1, None, 5]
    assert sensors.title(5) == "sensor 5 in room 5 (hall)"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("sensors: []", "sensors: expected a list of sensors, got []"),
        ("sensors: {1: 2}", "sensors: expected a list"),
        ("sensors:\n- {id: 1}", "sensors[0]/room: is missing"),
        ("sensors:\n- {id: 256, room: 1}", "sensors[0]/id: is 256, expected at most 255"),
        ("sensors:\n- {id: yes, room: 1}", "sensors[0]/id: expected a whole number, got True"),
        ("sensors:\n- {id: 1, room: 1}\n- {id: 1, room: 5}", "sensors[1]/id: is 1, which sensors[0] has already"),
        (
            "sensors:\n- {id: 1, room: 2}",
            "sensors[0]/room: there is no room 2: points.yaml has the rooms 0, 1, 5",
        ),
        ("sensors:\n- {id: 1, room: 1, nmae: x}", "sensors[0]/nmae: 'nmae' is not known here, did you mean 'name'?"),
        ("sensors:\n- {id: 1, room: 1, peers: [kitchen.local]}", "sensors[0]/peers: expected an address or a network"),
        ("sensors:\n- {id: 1, room: 1, heartbeat: -1}", "sensors[0]/heartbeat: is -1.0, expected at least 0.0"),
        ('sensors:\n- {id: 1, room: 1, name: "a\\nBcc: x"}', "sensors[0]/name: is 'a\\nBcc: x', expected one line"),
        ("sensors:\n- 5", "sensors[0]/: expected a group of parameters, got 5"),
        ("sensor:\n- {id: 1, room: 1}", "sensor: 'sensor' is not known here, did you mean 'sensors'?"),
        ("sensors: [", "is no valid yaml at line 1"),
    ],
)
def test_a_fault_is_one_sentence_with_file_and_key(tmp_path, text, message):
    with pytest.raises(ParamError) as caught:
        load(tmp_path, text)
    assert str(caught.value).startswith(str(tmp_path / "sensors.yaml"))
    assert message in str(caught.value)


def test_peers_are_addresses_and_networks(tmp_path):
    spec = load(tmp_path, "sensors:\n- {id: 1, room: 1, peers: [10.0.0.0/24, 'fc94::7']}").find(1)
    assert [spec.may_speak_from(h) for h in ("10.0.0.9", "fc94::7", "fc94::8", "10.0.1.9", "/dev/ttyUSB0")] == [
        True,
        True,
        False,
        False,
        True,
    ]


@pytest.mark.parametrize(
    ("sensors", "places", "points"),
    [
        ("sensors", "house_sensors", "room_points"),
        ("flat_sensors", "flat_sensors", "flat_room_points"),
        ("office_sensors", "office_sensors", "office_room_points"),
    ],
)
def test_our_files_agree_with_rooms_and_with_the_simulator(sensors, places, points):
    rooms = load_rooms(ROOT / "params" / f"{points}.yaml")
    listed = load_sensors(ROOT / "config" / f"{sensors}.yaml", {r.id: r.name for r in rooms}, rooms_source=rooms.source)
    hung = [(place.id, place.room) for place in read_sensors(str(ROOT / "config" / f"{places}.yaml"))]
    listed.check_places(hung, places)
    assert [(spec.id, spec.room) for spec in listed] == hung


def test_two_files_that_contradict_each_other_are_told():
    from rosbot_patrol.sensors.sensor_file import SensorSpec

    sensors = SensorList([SensorSpec(id=1, room=5)], ROOMS, "sensors.yaml")
    sensors.check_places([(1, 5), (2, 1)], "house.yaml")
    with pytest.raises(ParamError, match="sensor 1 watches room 5, and room 1 in house"):
        sensors.check_places([(1, 1)], "house.yaml")
