"""A neighbour that falls silent: when it counts, when the owner is told."""

from __future__ import annotations

from rosbot_patrol.patrol.guard.absence import Absence
from rosbot_patrol.patrol.records.commands import OwnerMessage


def steps(absence: Absence, begin: float, end: float, *, heard: bool = False) -> list[tuple[float, OwnerMessage]]:
    """Ten steps a second; what was said, and when."""
    said = []
    for k in range(round((end - begin) * 10)):
        now = begin + 0.1 * k
        if heard and k % 50 == 0:
            absence.heard(now)
        said += [(now, word) for word in absence.step(now)]
    return said


def test_one_that_never_was_there_is_not_missed() -> None:
    absence = Absence(20.0, 60.0)
    assert steps(absence, 0.0, 300.0) == []
    assert not absence.was_heard
    assert absence.silence(300.0) == 0.0


def test_it_is_told_once_and_once_again_when_it_is_back() -> None:
    absence = Absence(20.0, 60.0)
    assert steps(absence, 1000.0, 1060.0, heard=True) == []
    (gone,) = steps(absence, 1060.0, 1500.0)
    assert 1055.0 + 20.0 + 59.9 < gone[0] < 1055.0 + 20.0 + 60.3
    assert "has gone, or hangs" in gone[1].text
    assert not gone[1].is_over
    assert absence.silence(1499.0) > 400.0
    (back,) = steps(absence, 1500.0, 1700.0, heard=True)
    assert 1559.9 < back[0] < 1560.3
    assert back[1].is_over
    assert back[1].kind == gone[1].kind


def test_a_restart_of_it_is_not_told() -> None:
    absence = Absence(20.0, 60.0)
    steps(absence, 0.0, 60.0, heard=True)
    assert steps(absence, 60.0, 120.0) == []
    assert absence.silence(119.9) > 60.0
    assert steps(absence, 120.0, 400.0, heard=True) == []


def test_what_this_program_slept_through_is_not_held_against_it() -> None:
    absence = Absence(20.0, 60.0)
    steps(absence, 0.0, 60.0, heard=True)
    assert absence.step(600.0) == ()  # stopped, and now goes on: the first step comes before what waits at the socket
    assert steps(absence, 600.1, 900.0, heard=True) == []
