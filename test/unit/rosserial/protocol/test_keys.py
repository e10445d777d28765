"""Key files: what is refused says file and sensor, and never a key."""

import os

import pytest

from rosbot_patrol.errors import ParamError
from rosbot_patrol.rosserial.protocol.keys import add_key, c_define, key_of, new_key, read_keys
from rosbot_patrol.rosserial.server.settings import SerialNodeParams

A, B = "00112233445566778899aabbccddeeff" * 2, "0f1e2d3c4b5a69788796a5b4c3d2e1f0" * 2


def key_file(tmp_path, text, mode=0o600):
    path = tmp_path / "keys.yaml"
    path.write_text(text, encoding="utf-8")
    path.chmod(mode)
    return path


def test_keys_by_sensor(tmp_path):
    path = key_file(tmp_path, f'keys: {{1: "{A}", 2: "{B.upper()}"}}\n')
    assert read_keys(path) == {1: bytes.fromhex(A), 2: bytes.fromhex(B)}
    assert key_of(path, 2) == bytes.fromhex(B)
    with pytest.raises(ParamError, match=r"keys\.yaml: keys/7: is missing; 'rosrun rosbot_patrol sensor_key 7'"):
        key_of(path, 7)


@pytest.mark.parametrize("mode", [0o640, 0o604, 0o660, 0o620, 0o610])
def test_file_that_others_can_read_is_refused(tmp_path, mode):
    with pytest.raises(ParamError, match=rf"others can read it \(mode {mode:o}\); 'chmod 600 "):
        read_keys(key_file(tmp_path, f'keys: {{1: "{A}"}}', mode))


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        (f'keys: {{1: "{A}", 1: "{B}"}}', "is no valid yaml at line 1, column 79: a key stands twice"),
        (f'keys: {{1: "{A}", 01: "{B}"}}', "a key stands twice"),
        (f'keys: {{1: "{A}", "1": "{B}"}}', "keys/1: stands twice"),
        (f'keys: {{1: "{A}", 2: "{A}"}}', "keys/2: is the key of sensor 1 too"),
        (f'keys: {{1: "{A[:62]}"}}', "keys/1: expected 64 hexadecimal digits, got 62"),
        (f'keys: {{1: "{A}00"}}', "keys/1: expected 64 hexadecimal digits, got 66"),
        (f'keys: {{1: "{A[:-1]}x"}}', "keys/1: expected 64 hexadecimal digits, found others"),
        ("keys: {1: 12345678}", "keys/1: expected 64 hexadecimal digits in quotes"),
        (f'keys: {{1: "{"0" * 64}"}}', "keys/1: is not random"),
        (f'keys: {{256: "{A}"}}', "keys/'256': expected a sensor id, 0 to 255"),
        (f'keys: {{true: "{A}"}}', "keys/'True': expected a sensor id"),
        (f'keys: {{{A}: "1"}}', "expected a sensor id"),
        ("keys: {}", "keys: expected one line per sensor"),
        ("keys:", "keys: expected one line per sensor"),
        (f'key: {{1: "{A}"}}', "'key': is not known here, expected 'keys' alone"),
        (A, "expected the keys 'keys', got something else"),
        (f"keys: [{A}", "is no valid yaml at line 1, column 72: it cannot be parsed"),
        (f"keys: !{A} 1", "it cannot be parsed"),
    ],
)
def test_bad_file_is_named_and_no_key_is_told(tmp_path, text, problem):
    with pytest.raises(ParamError) as error:
        read_keys(key_file(tmp_path, text))
    assert problem in str(error.value)
    assert str(tmp_path / "keys.yaml") in str(error.value)
    assert A[10:40] not in str(error.value)
    assert B[10:40] not in str(error.value)


def test_missing_file_and_folder(tmp_path):
    with pytest.raises(ParamError, match=r"none\.yaml: cannot be read: No such file"):
        read_keys(tmp_path / "none.yaml")
    with pytest.raises(ParamError, match="is no file"):
        read_keys(tmp_path)


def test_new_keys_are_added_to_a_file_that_nobody_else_reads(tmp_path):
    path, first, second = tmp_path / "new" / "keys.yaml", new_key(), new_key()
    before = os.umask(0)
    try:
        add_key(path, 5, first)
        add_key(path, 2, second)
    finally:
        os.umask(before)
    assert read_keys(path) == {5: first, 2: second}
    assert [p.name for p in path.parent.iterdir()] == ["keys.yaml"]
    with pytest.raises(ParamError, match="keys/5: is there already; --replace"):
        add_key(path, 5, new_key())
    third = new_key()
    add_key(path, 5, third, is_replacing=True)
    assert read_keys(path) == {5: third, 2: second}
    assert c_define(5, third) == f'#define SENSOR_ID 5\n#define SENSOR_KEY "{third.hex()}"'


def test_node_names_its_parameter_and_a_serial_device_needs_no_key(tmp_path):
    path = key_file(tmp_path, f'keys: {{1: "{A}"}}')
    assert SerialNodeParams(port="tcp", key_file=str(path)).policy("/n/").keys == {1: bytes.fromhex(A)}
    assert A not in repr(SerialNodeParams(port="tcp", key_file=str(path)).policy("/n/"))
    assert not SerialNodeParams(port="/dev/ttyUSB0", key_file=str(path)).policy("/n/").keys
    assert SerialNodeParams(port="/dev/ttyUSB0", restrict="always", key_file=str(path)).policy("/n/").keys
    assert SerialNodeParams(port="tcp", restrict="never", key_file=str(path)).policy("/n/").keys
    path.chmod(0o644)
    with pytest.raises(ParamError, match=r"/n/key_file: .*keys\.yaml: others can read it"):
        SerialNodeParams(port="tcp", key_file=str(path)).policy("/n/")
