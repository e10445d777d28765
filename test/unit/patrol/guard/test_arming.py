"""Modes and their delays."""

import pytest

from rosbot_patrol.errors import ParamError
from rosbot_patrol.files import write_json
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.patrol.guard.arming import Arming, ArmingRules, Mode, load_rules, read_memory
from rosbot_patrol.patrol.guard.wall_times import Window
from rosbot_patrol.patrol.house.rooms import Room, Rooms

ROOMS = Rooms(tuple(Room(id=i, name=n, pose=Pose2D(i, 0, 0)) for i, n in enumerate(("base", "hall", "kitchen"))))
RULES = ArmingRules(
    modes={
        "armed_away": Mode(exit_delay=30.0, entry_delay=20.0),
        "armed_home": Mode(rooms=frozenset({2})),
        "night": Mode(),
        "disarmed": Mode(rooms=frozenset()),
    },
    entry_rooms=frozenset({1}),
)


def test_a_fresh_install_guards_everything_at_once():
    guarded = Arming(ArmingRules()).step(1000.0)
    assert (guarded.mode, guarded.rooms, guarded.why, guarded.holds_until) == ("armed_away", None, "", None)
    assert guarded.counts(7)


def test_an_unknown_mode_is_refused_with_a_sentence():
    arming = Arming(RULES)
    taken, text = arming.arm("nigth", 0.0)
    assert not taken
    assert text == "the mode 'nigth' is not known here, did you mean 'night'?; the mode stays armed_away"
    assert arming.mode == "armed_away"


def test_rooms_by_mode():
    arming = Arming(RULES)
    assert arming.arm("armed_home", 0.0) == (True, "the mode is armed_home now, it was armed_away")
    assert [arming.step(1.0).counts(room) for room in (1, 2)] == [False, True]
    arming.arm("disarmed", 2.0)
    assert not arming.step(3.0).counts(2)
    assert arming.step(3.0).why == "the house is disarmed"
    assert arming.arm("disarmed", 4.0) == (True, "the mode is disarmed already")


def test_the_exit_delay():
    arming = Arming(RULES)
    arming.arm("disarmed", 0.0)
    taken, text = arming.arm("armed_away", 100.0)
    assert taken
    assert "it guards in 30 s" in text
    assert arming.exit_left(110.0) == 20.0
    assert not arming.step(129.0).counts(1)
    assert arming.step(129.0).why == "the exit delay of armed_away runs"
    assert arming.step(130.5).counts(1)


def test_the_entry_delay_holds_notices_from_an_entry_room_on():
    arming = Arming(RULES)
    arming.follow({"m1": 2}, 100.0)
    assert arming.step(100.0).holds_until is None
    arming.follow({"m2": 1}, 101.0)
    assert arming.step(102.0).holds_until == 121.0
    arming.follow({"m2": 1}, 110.0)  # the same mission does not prolong it
    assert arming.step(120.0).holds_until == 121.0
    assert arming.step(121.5).holds_until is None
    arming.follow({"m2": 1}, 122.0)
    assert arming.step(123.0).holds_until is None


def test_disarming_ends_the_entry_delay():
    arming = Arming(RULES)
    arming.follow({"m": 1}, 0.0)
    arming.arm("disarmed", 5.0)
    assert arming.step(5.0).holds_until is None


@pytest.mark.parametrize("jump", [-3600.0, 3600.0, 86400.0 * 365])
def test_a_clock_that_is_set_makes_no_delay_longer(jump):
    arming = Arming(RULES)
    arming.arm("disarmed", 1e6)
    arming.arm("armed_away", 1e6)
    assert arming.step(1e6 + jump).counts(1)
    arming.follow({"m": 1}, 1e6)
    assert arming.step(1e6 + jump).holds_until is None


def test_the_mode_is_kept_over_restarts(tmp_path):
    path = tmp_path / "arming.json"
    arming = Arming(RULES, read_memory(path))
    arming.arm("disarmed", 0.0)
    arming.arm("armed_away", 100.0)
    write_json(path, arming.snapshot())
    again = Arming(RULES, read_memory(path))
    assert again.mode == "armed_away"
    assert not again.step(120.0).counts(1)
    assert again.step(131.0).counts(1)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"", "arming.json: cannot be read"),
        (b"[]", "arming.json: holds no group of values"),
        (b"{", "arming.json: cannot be read"),
        (b'{"mode": "party"}', "'party', is none"),
    ],
)
def test_a_broken_memory_is_said_and_guards(tmp_path, caplog, content, said):
    path = tmp_path / "arming.json"
    path.write_bytes(content)
    assert Arming(RULES, read_memory(path)).mode == "armed_away"
    assert said in caplog.text


def test_quiet_hours():
    window = Window(start=22 * 60, end=6 * 60, days=frozenset({4}))  # Friday's night
    from zoneinfo import ZoneInfo

    utc = ZoneInfo("UTC")
    friday = 1780617600.0  # 2026-06-05 00:00 UTC, a Friday
    opens = [window.contains(friday + hours * 3600.0, utc) for hours in (1, 21.9, 22, 29.9, 30, 46)]
    assert opens == [False, False, True, True, False, False]
    quiet = Arming(ArmingRules(quiet_hours=(window,), zone=utc))
    assert quiet.step(friday + 23 * 3600.0).is_quiet


def load(tmp_path, text):
    (tmp_path / "arming.yaml").write_text(text)
    return load_rules(str(tmp_path / "arming.yaml"), ROOMS)


def test_a_file(tmp_path):
    rules = load(
        tmp_path,
        "{entry_rooms: [hall], quiet_hours: [{from: 22:00, to: '06:30'}],"
        " armed_home: {rooms: [Kitchen], exit_delay: 0}}",
    )
    assert rules.entry_rooms == {1}
    assert rules.modes["armed_home"] == Mode(rooms=frozenset({2}))
    assert rules.modes["armed_away"] == Mode(exit_delay=30.0)
    assert rules.quiet_hours == (Window(start=1320, end=390),)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("{first_mode: on}", "first_mode: expected a text"),
        ("{first_mode: home}", "first_mode: is 'home', expected one of armed_away"),
        ("{armed_home: {rooms: 3}}", "armed_home/rooms: is 3, expected all, or a list"),
        ("{armed_home: {rooms: [3]}}", "armed_home/rooms[0]: there is no room 3"),
        ("{night: {exit_delay: -1}}", "night/exit_delay: is -1.0, expected at least 0.0 s"),
        ("{party: {}}", "party: 'party' is not known here"),
        ("{quiet_hours: [{from: 22:00}]}", "quiet_hours[0]/to: is missing"),
        ("{quiet_hours: [{from: 22:00, to: 6:30, on: x}]}", "quiet_hours[0]/True: 'True' is not known here"),
        ("{quiet_hours: [22:00]}", "quiet_hours[0]: is 1320, expected from, to"),
    ],
)
def test_a_bad_file_is_one_sentence_with_file_and_key(tmp_path, text, said):
    with pytest.raises(ParamError) as caught:
        load(tmp_path, text)
    assert said in str(caught.value)
    assert "arming.yaml: " in str(caught.value)


def test_a_muted_room_starts_no_mission_for_a_while_in_any_mode():
    arming = Arming(RULES)
    room = ROOMS.get(2)
    accepted, text = arming.mute(room, 3600.0, 1000.0)
    assert accepted
    assert text.startswith("the sensors of room 2 (kitchen) start no mission until ")
    assert not arming.step(1001.0).counts(2)
    assert arming.step(1001.0).counts(1)
    arming.arm("armed_home", 1002.0)
    again = Arming(RULES, arming.snapshot())
    assert not again.step(4599.0).counts(2)
    assert again.step(4600.0).counts(2)


def test_a_room_is_guarded_again_before_that():
    arming = Arming(RULES)
    arming.mute(ROOMS.get(2), 3600.0, 1000.0)
    assert arming.mute(ROOMS.get(2), 0.0, 1001.0) == (True, "the sensors of room 2 (kitchen) count again")
    assert arming.step(1001.0).counts(2)


@pytest.mark.parametrize("seconds", [-1.0, 86401.0, float("nan")])
def test_a_senseless_time_mutes_nothing(seconds):
    arming = Arming(RULES)
    assert not arming.mute(ROOMS.get(2), seconds, 1000.0)[0]
    assert arming.step(1001.0).counts(2)


def test_a_clock_that_goes_back_mutes_for_no_longer():
    arming = Arming(RULES)
    arming.mute(ROOMS.get(2), 86400.0, 1_000_000.0)
    assert arming.step(900_000.0).counts(2)


@pytest.mark.parametrize("muted", [[2], {"kitchen": 5.0}, {"2": "soon"}])
def test_damaged_mutes_mute_nothing(muted):
    assert Arming(RULES, {"mode": "night", "muted": muted}).step(1000.0).counts(2)
