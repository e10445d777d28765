from __future__ import annotations

from pathlib import Path

import pytest

from rosbot_patrol.errors import ParamError
from rosbot_patrol.simulation.sensors.sensor_places import read_sensors
from rosbot_patrol.yaml_files import read_mapping


def test_a_mapping_is_read(tmp_path: Path) -> None:
    path = tmp_path / "good.yaml"
    path.write_text("a: 1\nb: {c: [2, 3]}\n")
    assert read_mapping(path, keys="a and b") == {"a": 1, "b": {"c": [2, 3]}}


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (b"a: [1\nb: 2\n", "is no valid yaml at line 2, column 2: "),
        (b"a: 1\nb: 2\na: 3\n", "is no valid yaml at line 3, column 1: the key 'a' stands twice"),
        (b"a: \x00\n", "is no valid yaml: "),
        (b"a: caf\xe9\n", "is no text in UTF-8"),
        (b"", "expected the keys a and b, got 'None'"),
        (b"- 1\n", "expected the keys a and b, got '[1]'"),
    ],
)
def test_a_fault_is_one_line_that_names_the_file(tmp_path: Path, data: bytes, said: str) -> None:
    path = tmp_path / "bad.yaml"
    path.write_bytes(data)
    with pytest.raises(ParamError) as caught:
        read_mapping(path, keys="a and b")
    assert str(caught.value).startswith(f"{path}: {said}")
    assert "\n" not in str(caught.value)


def test_a_file_that_is_not_there_is_named_once() -> None:
    with pytest.raises(ParamError) as caught:
        read_mapping("/nowhere/sensors.yaml", keys="sensors")
    assert str(caught.value) == "/nowhere/sensors.yaml: cannot be read: No such file or directory"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("sensors: here\n", "sensors: expected a list of sensors, got 'here'"),
        ("angle_unit: turns\nsensors: []\n", "angle_unit: is 'turns', expected rad or deg"),
        ("sensors: [{id: 1, x: 0}]\n", "sensors[0]/room: is missing"),
    ],
)
def test_a_wrong_sensor_file_names_the_key(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "sensors.yaml"
    path.write_text(text)
    with pytest.raises(ParamError) as caught:
        read_sensors(str(path))
    assert said in str(caught.value)
