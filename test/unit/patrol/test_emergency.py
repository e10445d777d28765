"""The emergency stop is held until those who pressed it, or the service, release it; over restarts."""

import pytest

from rosbot_patrol.patrol.emergency import SERVICE, TOPIC, EmergencyStop


def test_it_is_held_until_released_over_restarts(tmp_path):
    path = tmp_path / "stop.json"
    stop = EmergencyStop(path)
    assert not stop.is_held
    assert stop.press(True, SERVICE)
    stop.save()
    again = EmergencyStop(path)
    assert again.is_held
    assert "service" in again.why
    assert again.press(False, SERVICE)
    again.save()
    assert not EmergencyStop(path).is_held


def test_a_button_that_is_not_pressed_releases_only_its_own(tmp_path):
    stop = EmergencyStop(tmp_path / "stop.json")
    stop.press(True, SERVICE)
    assert not stop.press(False, TOPIC)
    assert stop.is_held
    stop.press(True, TOPIC)
    assert stop.press(False, SERVICE)  # whoever calls the service means the robot
    assert not stop.is_held


@pytest.mark.parametrize("content", [b"", b"{", b"[]", b'{"held_by": 3}'])
def test_what_cannot_be_read_holds(tmp_path, content, caplog):
    (tmp_path / "stop.json").write_bytes(content)
    stop = EmergencyStop(tmp_path / "stop.json")
    assert stop.is_held
    assert "cannot be read" in caplog.text
    stop.press(False, SERVICE)
    stop.save()
    assert not EmergencyStop(tmp_path / "stop.json").is_held
