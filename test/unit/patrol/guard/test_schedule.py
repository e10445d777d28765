"""Rounds by the clock: no doubled, no endless, no lost one, whatever the clock does."""

from datetime import datetime
from zoneinfo import ZoneInfo

import pytest

from rosbot_patrol.errors import ParamError
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.patrol.guard.schedule import Round, Schedule, load_schedule
from rosbot_patrol.patrol.house.rooms import Room, Rooms

WARSAW = ZoneInfo("Europe/Warsaw")
ROOMS = Rooms(
    tuple(Room(id=i, name=n, pose=Pose2D(i, 0, 0)) for i, n in enumerate(("base", "hall", "kitchen", "hall")))
)
NIGHT = Round(name="night", rooms=(1, 2), minutes=(150,))  # 02:30


def at(text):
    return datetime.fromisoformat(text).replace(tzinfo=WARSAW).timestamp()


def play(schedule, begin, end, step=20.0, mode="armed_away"):
    """Wall times at which rounds were due."""
    found, wall = [], begin
    while wall <= end:
        found += [wall] * len(schedule.step(wall, wall, mode))
        wall += step
    return found


def clock(wall):
    return datetime.fromtimestamp(wall, WARSAW).strftime("%d %H:%M")


def test_a_time_of_day_is_due_once_a_day_on_its_days():
    weekdays = Round(name="r", rooms=(1,), minutes=(0, 1350), days=frozenset(range(5)))
    due = play(
        Schedule((weekdays,), WARSAW), at("2026-06-04 12:00"), at("2026-06-08 12:00"), 60.0
    )  # Thursday to Monday
    assert [clock(wall) for wall in due] == ["04 22:30", "05 00:00", "05 22:30", "08 00:00"]


@pytest.mark.parametrize(
    ("day", "seen"),
    [("2026-03-29", "29 03:30"), ("2026-10-25", "25 02:30")],  # 02:30 is left out; 02:30 comes twice
)
def test_the_clock_is_put_forward_and_back(day, seen):
    due = play(Schedule((NIGHT,), WARSAW), at(f"{day} 00:00"), at(f"{day} 12:00"))
    assert [clock(wall) for wall in due] == [seen]


def test_a_clock_that_jumps_back_an_hour_makes_no_second_round():
    schedule = Schedule((NIGHT,), WARSAW)
    assert len(play(schedule, at("2026-06-04 02:00"), at("2026-06-04 02:45"))) == 1
    assert play(schedule, at("2026-06-04 01:45"), at("2026-06-04 12:00")) == []
    assert len(play(schedule, at("2026-06-05 02:00"), at("2026-06-05 03:00"))) == 1


@pytest.mark.parametrize(("skips", "rounds"), [(False, 1), (True, 0)])
def test_a_clock_that_jumps_forward_past_several_rounds(skips, rounds, caplog):
    night = Round(name="night", rooms=(1,), minutes=(150,), skips_missed=skips)
    schedule = Schedule((night,), WARSAW)
    play(schedule, at("2026-06-04 01:00"), at("2026-06-04 02:00"))
    assert len(play(schedule, at("2026-06-07 09:00"), at("2026-06-07 10:00"))) == rounds
    assert "was missed 390 minutes ago" in caplog.text


def test_a_clock_that_was_years_ahead_does_not_silence_the_schedule(caplog):
    schedule = Schedule((NIGHT,), WARSAW)
    play(schedule, at("2036-06-04 01:00"), at("2036-06-04 03:00"))
    assert len(play(schedule, at("2026-06-04 01:00"), at("2026-06-04 03:00"))) == 1
    assert "the clock went back" in caplog.text


def test_a_restart_neither_doubles_nor_loses():
    schedule = Schedule((NIGHT,), WARSAW)
    play(schedule, at("2026-06-04 01:00"), at("2026-06-04 02:35"))
    again = Schedule((NIGHT,), WARSAW, schedule.snapshot())
    assert play(again, at("2026-06-04 02:35"), at("2026-06-04 12:00")) == []
    missed = Schedule((NIGHT,), WARSAW, again.snapshot())
    assert len(play(missed, at("2026-06-05 08:00"), at("2026-06-05 12:00"))) == 1


def test_an_interval_counts_ros_time_over_restarts():
    hourly = Round(name="hourly", rooms=(1,), every=3600.0)
    schedule = Schedule((hourly,))
    assert schedule.step(100.0, 0.0, "night") == []
    assert schedule.step(3699.0, 0.0, "night") == []
    again = Schedule((hourly,), memory=schedule.snapshot())
    assert again.step(3700.0, 0.0, "night") == [hourly]
    assert again.step(3701.0, 0.0, "night") == []
    assert again.step(5.0, 0.0, "night") == []  # a simulation that begins anew
    assert again.step(3605.0, 0.0, "night") == [hourly]
    assert again.step(360500.0, 0.0, "night") == [hourly]  # a hundred were missed
    assert again.step(360501.0, 0.0, "night") == []


def test_it_holds_in_its_modes_only(caplog):
    caplog.set_level("INFO")
    assert play(Schedule((NIGHT,), WARSAW), at("2026-06-04 02:00"), at("2026-06-04 03:00"), mode="disarmed") == []
    assert "the round 'night' is left out, as the mode is disarmed" in caplog.text


def load(tmp_path, text):
    path = tmp_path / "schedule.yaml"
    path.write_text(text)
    return load_schedule(str(path), ROOMS)


def test_a_file(tmp_path):
    rounds, zone = load(
        tmp_path,
        "time_zone: Europe/Warsaw\nrounds:\n"
        "  - {name: evening, at: [22:30, '7:05'], days: [Mon, sunday], rooms: [Kitchen, 1], missed: skip}\n"
        "  - {name: hourly, every: 3600, modes: [night]}\n",
    )
    assert zone == WARSAW
    assert rounds[0] == Round(
        name="evening", rooms=(2, 1), minutes=(425, 1350), days=frozenset({0, 6}), skips_missed=True
    )
    assert rounds[1] == Round(name="hourly", rooms=(1, 2, 3, 0), every=3600.0, modes=frozenset({"night"}))
    assert load_schedule("", ROOMS) == ((), None)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("rounds: [", "schedule.yaml: is no valid yaml at line 1"),
        ("round: []", "schedule.yaml: round: 'round' is not known here, did you mean 'rounds'?"),
        ("rounds: [{at: [22:30]}]", "rounds[0]/name: is missing"),
        ("rounds: [{name: a}]", "rounds[0]/at: expected either times of day (at) or an interval (every)"),
        ("rounds: [{name: a, at: ['25:00']}]", "rounds[0]/at[0]: is '25:00', expected a time of day"),
        ("rounds: [{name: a, at: [noon]}]", "rounds[0]/at[0]: is 'noon', expected a time of day"),
        ("rounds: [{name: a, every: 5}]", "rounds[0]/every: is 5, expected at least 60 s"),
        (
            "rounds: [{name: a, every: 60, days: [mo]}]",
            "rounds[0]/days[0]: 'mo' is not known here, did you mean 'mon'?",
        ),
        (
            "rounds: [{name: a, every: 60, modes: [nigth]}]",
            "rounds[0]/modes[0]: 'nigth' is not known here",
        ),
        ("rounds: [{name: a, every: 60, rooms: [9]}]", "rounds[0]/rooms[0]: there is no room 9"),
        ("rounds: [{name: a, every: 60, rooms: [hall]}]", "'hall' is the name of the rooms 1 and 3"),
        ("rounds: [{name: a, every: 60, rooms: [attic]}]", "there is no room 'attic'"),
        ("rounds: [{name: a, every: 60}, {name: a, every: 90}]", "rounds[1]/name: is 'a', which rounds[0] has already"),
        ("{rounds: [], time_zone: Mars/Olympus}", "time_zone: is 'Mars/Olympus', expected a time zone"),
    ],
)
def test_a_bad_file_is_one_sentence_with_file_and_key(tmp_path, text, said):
    with pytest.raises(ParamError) as caught:
        load(tmp_path, text)
    assert said in str(caught.value)
    assert "schedule.yaml: " in str(caught.value)


def test_a_file_that_is_not_there(tmp_path):
    with pytest.raises(ParamError, match=r"nowhere\.yaml: cannot be read"):
        load_schedule(str(tmp_path / "nowhere.yaml"), ROOMS)
