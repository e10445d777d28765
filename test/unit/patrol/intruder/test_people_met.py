from __future__ import annotations

import pytest

from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.patrol.intruder.persons import Persons
from rosbot_patrol.patrol.records.inputs import Measured


def at(x: float, y: float = 0.0, error: float = 0.1) -> Measured:
    return Measured(x=x, y=y, error=error, away=2.0, top=1.7, height=1.6, width=0.5)


def test_the_same_place_is_the_same_person() -> None:
    people = Persons()
    assert [people.note(t, at(1.0 + 0.1 * t))[1] for t in (0.0, 0.5, 20.0)] == [True, False, False]
    assert people.met[0].sightings == 3


def test_somebody_elsewhere_at_once_is_another() -> None:
    people = Persons()
    people.note(0.0, at(0.0))
    person, is_new = people.note(0.1, at(3.0))
    assert (person.number, is_new) == (2, True)
    assert people.note(0.2, at(0.1))[0].number == 1
    assert people.note(0.3, at(3.1))[0].number == 2


def test_one_who_walked_on_is_the_same() -> None:
    people = Persons()
    people.note(0.0, at(0.0))
    assert people.note(4.0, at(4.0)) == (people.met[0], False)


@pytest.mark.parametrize(("first", "second"), [(True, True), (True, False), (False, True)])
def test_of_two_whom_the_lidar_has_not_seen_move_neither_has_walked(first: bool, second: bool) -> None:
    people = Persons()
    people.note(0.0, at(0.0), key=1, stays=first)
    assert people.note(20.0, at(4.0), key=2, stays=second)[1] == (first and second)
    assert not people.note(20.1, at(4.4), key=3, stays=second)[1]


def test_one_whom_the_lidar_saw_move_later_has_walked() -> None:
    people = Persons()
    people.note(0.0, at(0.0), key=1, stays=True)
    people.walks(1)
    people.walks(7)  # of whom nothing is known
    assert not people.note(20.0, at(4.0), key=2, stays=True)[1]


def test_one_whom_nobody_can_have_walked_to_is_another() -> None:
    people = Persons()
    people.note(0.0, at(0.0))
    assert people.note(60.0, at(9.0))[1]


def test_without_a_place_it_is_whom_was_seen_last() -> None:
    people = Persons()
    people.note(0.0, at(0.0))
    people.note(0.1, at(5.0))
    assert people.note(0.2, None)[0].number == 2


def test_the_place_is_the_last_sure_one() -> None:
    people = Persons()
    people.note(0.0, at(1.0))
    people.note(0.2, at(1.8, error=0.9))
    assert people.met[0].x == 1.0
    people.note(0.4, at(1.2))
    assert people.met[0].x == 1.2


def test_of_two_who_may_be_it_the_nearer_is() -> None:
    people = Persons()
    people.note(0.0, at(0.0))
    people.note(0.1, at(4.0))
    for t in range(1, 30):
        people.note(t, at(0.0))
    assert people.note(30.0, at(4.0))[0].number == 2
    assert people.note(30.1, at(0.0))[0].number == 1
    assert len(people.met) == 2


def test_one_hypothesis_is_one_person_however_badly_it_is_measured() -> None:
    people = Persons()
    first, _ = people.note(0.0, at(1.0, 1.0), key=7)
    again, is_new = people.note(0.1, at(6.0, 1.0), key=7)
    assert again is first
    assert not is_new
    assert people.note(0.2, at(9.0, 9.0), key=8)[1]


def test_who_was_in_one_picture_with_somebody_is_another() -> None:
    people = Persons()
    people.note(0.0, at(1.0), key=7)
    assert people.note(5.0, at(4.0), key=8, apart={7})[1]
    assert not people.note(5.0, at(4.2), key=9)[1]


def test_one_in_the_same_direction_is_the_same_unless_they_were_seen_beside_each_other() -> None:
    eye = Pose2D(0.0, 0.0, 0.0)
    people = Persons()
    people.note(0.0, at(5.0, 0.4), key=1, eye=eye)
    assert not people.note(0.5, at(8.0, 0.5), key=2, eye=eye)[1]
    assert people.note(0.6, at(8.0, 3.0), key=3, eye=eye)[1]
    assert people.note(0.7, at(11.5, 0.9), key=4, apart={1, 2, 3}, eye=eye)[1]
