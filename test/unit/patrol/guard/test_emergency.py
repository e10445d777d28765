"""The emergency stop is held until those who pressed it, or the service, release it; over restarts."""

import logging
import threading

import pytest

from rosbot_patrol.patrol.guard import emergency
from rosbot_patrol.patrol.guard.emergency import SERVICE, TOPIC, EmergencyStop


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


HELD = [[SERVICE], [TOPIC], [SERVICE, TOPIC]]


def held_file(path, by):
    stop = EmergencyStop(path)
    for source in by:
        stop.press(True, source)
    stop.save()
    return path.read_bytes()


def is_held_by(path, data):
    path.write_bytes(data)
    return EmergencyStop(path).is_held


@pytest.mark.parametrize("by", HELD)
def test_no_damage_to_a_held_stop_releases_it(tmp_path, by):
    """All single-bit flips, cuts at each byte, zeroed and blanked bytes, a doubled file."""
    logging.disable(logging.CRITICAL)
    path = tmp_path / "stop.json"
    whole = held_file(path, by)
    flipped = [bytes([*whole[:i], whole[i] ^ 1 << bit, *whole[i + 1 :]]) for i in range(len(whole)) for bit in range(8)]
    cut = [whole[:n] for n in range(len(whole))] + [whole[n:] for n in range(len(whole))]
    zeroed = [whole[:i] + bytes(len(whole) - i) for i in range(len(whole))]
    blanked = [bytes([*whole[:i], 32, *whole[i + 1 :]]) for i in range(len(whole))]
    released = [d for d in (*flipped, *cut, *zeroed, *blanked, whole + whole) if not is_held_by(path, d)]
    logging.disable(logging.NOTSET)
    assert released == []


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"{",
        b"[]",
        b"null",
        b"0",
        b'""',
        b"{}",
        b'{"held_by": 3}',
        b'{"held_by": {}}',
        b'{"held_by": ""}',
        b'{"held_by": null}',
        b'{"held_by": [null]}',
        b'{"held_by": [[]]}',
        b'{"held_by": ["nobody"]}',
        b"\xff\xfe",
        b'{"held_by": [], "also": 1}',
        b'{"held_by": false}',
        b"[" * 100_000,
        b'{"held_by": [{}]}',
        bytes(40),
    ],
)
def test_what_cannot_be_read_holds(tmp_path, content, caplog):
    (tmp_path / "stop.json").write_bytes(content)
    stop = EmergencyStop(tmp_path / "stop.json")
    assert stop.is_held
    assert "cannot be read" in caplog.text
    stop.press(False, TOPIC)
    assert stop.is_held
    stop.press(False, SERVICE)
    stop.save()
    assert not EmergencyStop(tmp_path / "stop.json").is_held


def test_a_folder_in_the_files_place_holds(tmp_path):
    (tmp_path / "stop.json").mkdir()
    assert EmergencyStop(tmp_path / "stop.json").is_held


@pytest.mark.parametrize("folder", ["missing", "file"])
def test_a_file_that_cannot_be_there_was_never_pressed(tmp_path, folder):
    (tmp_path / "file").write_text("no folder")
    assert not EmergencyStop(tmp_path / folder / "stop.json").is_held


def test_files_of_earlier_versions_are_read(tmp_path):
    """They have the same form; a person may have written one with other blanks."""
    path = tmp_path / "stop.json"
    assert not is_held_by(path, b'{"held_by": []}')
    assert not is_held_by(path, b'{"held_by":[]}\n')
    assert is_held_by(path, b'{"held_by": ["service", "topic"]}')
    assert EmergencyStop(path).press(False, TOPIC) is False


def test_damage_to_a_released_stop_holds_or_changes_nothing(tmp_path):
    path = tmp_path / "stop.json"
    assert is_held_by(path, b'{"held_by": [}]')
    assert is_held_by(path, b'{"held_bq": []}')


def test_a_damaged_name_keeps_what_can_be_read(tmp_path):
    path = tmp_path / "stop.json"
    path.write_bytes(b'{"held_by": ["servicd", "topic"]}')
    assert "topic" in EmergencyStop(path).why


def test_who_asks_why_while_another_releases_gets_an_answer(tmp_path, monkeypatch):
    """What is released between the question and the answer, as another thread may do it."""
    stop = EmergencyStop(tmp_path / "stop.json")
    stop.press(True, SERVICE)

    class Words(dict):
        def __iter__(self):
            stop.press(False, SERVICE)
            return super().__iter__()

    monkeypatch.setattr(emergency, "_WORDS", Words(emergency._WORDS))
    assert "service" in stop.why
    assert not stop.is_held
    assert stop.why == ""


def test_two_threads_press_and_ask(tmp_path):
    stop, errors, is_over = EmergencyStop(tmp_path / "stop.json"), [], threading.Event()

    def ask():
        while not is_over.is_set():
            try:
                assert stop.why in ("", emergency._WORDS[SERVICE], emergency._WORDS[TOPIC])
            except Exception as err:
                errors.append(err)
                return

    asking = threading.Thread(target=ask)
    asking.start()
    for _ in range(3000):
        for pressed, source in ((True, TOPIC), (True, SERVICE), (False, TOPIC), (False, SERVICE)):
            stop.press(pressed, source)
    is_over.set()
    asking.join()
    assert errors == []
