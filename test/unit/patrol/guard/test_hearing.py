"""Does the patrol hear as much as the sensor watch."""

from __future__ import annotations

from rosbot_patrol.patrol.guard.hearing import Hearing


def states(hearing: Hearing, begin: int, end: int, *, rate: int = 4, hears: bool = True) -> list[int]:
    """The watch's count every five seconds; returns the times at which the patrol listens anew."""
    anew = []
    for now in range(begin, end, 5):
        if hears:
            hearing.heard()
        if hearing.told(rate * now, float(now)):
            anew.append(now)
    return anew


def test_hearing_the_same_is_well() -> None:
    hearing = Hearing()
    assert states(hearing, 0, 600) == []
    assert hearing.step(600.0) == ()


def test_a_deaf_patrol_listens_anew_and_says_so_once() -> None:
    hearing = Hearing()
    states(hearing, 0, 60)
    assert states(hearing, 60, 100, hears=False) == [65, 80, 95]
    assert hearing.is_deaf
    (word,) = hearing.step(100.0)
    assert "its link was cut" in word.text
    assert hearing.step(101.0) == ()
    states(hearing, 100, 600)
    assert not hearing.is_deaf
    assert hearing.step(600.0) == ()
    (word,) = hearing.step(700.0)
    assert word.is_over


def test_a_quiet_house_or_a_new_watch_says_nothing() -> None:
    hearing = Hearing()
    assert states(hearing, 0, 300, rate=0, hears=False) == []
    hearing.told(1000, 300.0)
    assert not hearing.told(5, 310.0)  # the watch has started again
    assert not hearing.told(7, 320.0)  # two messages: one may have been on its way


def test_a_few_messages_are_no_proof() -> None:
    hearing = Hearing()
    for now in range(0, 25, 5):
        assert not hearing.told(now // 5, float(now))
