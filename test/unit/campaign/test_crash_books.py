"""Kills by the seed, and the books that say whether anything was lost."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any

import pytest

from rosbot_patrol.campaign.crash_ledger import (
    Journal,
    KeptMail,
    KeptRecord,
    balance,
    is_killed,
    next_patrol,
    open_call,
)
from rosbot_patrol.campaign.crash_plan import ALL, ENDS_LIFE, MASTER, MOMENTS, VICTIMS, plan_crashes


def call(name: str, wall: float, patrol: int = 0, room: int = 1) -> dict[str, Any]:
    return {"kind": "call", "call": name, "patrol": patrol, "room": room, "wall": wall}


def kill(of: str, victim: str = "amcl") -> dict[str, Any]:
    return {"kind": "kill", "call": of, "victim": victim, "moment": "driving", "delay": 1.0}


def record(name: str, wall: float, verdict: str = "confirmed", room: int = 1) -> KeptRecord:
    return KeptRecord(id=name, room=room, verdict=verdict, wall=wall, is_confirmed=verdict == "confirmed")


VERDICT = {"kind": "verdict", "call": "p0", "verdict": "confirmed"}
MAIL = KeptMail(message_id="<1@x>", incident="a")


def test_every_victim_has_its_turn_and_a_shorter_campaign_is_the_beginning_of_a_longer() -> None:
    patrols = plan_crashes(1, 200)
    kills = [kill for patrol in patrols for kill in patrol.kills]
    assert [kill.number for kill in kills] == list(range(200))
    assert Counter(kill.victim for kill in kills[: len(VICTIMS)]) == Counter(VICTIMS)
    assert {kill.moment for kill in kills} == set(MOMENTS)
    assert all(0.0 <= kill.delay <= MOMENTS[kill.moment] for kill in kills)
    assert plan_crashes(1, 50)[:-1] == patrols[: len(plan_crashes(1, 50)) - 1]
    assert plan_crashes(2, 50) != plan_crashes(1, 50)


def test_kills_of_a_patrol_come_in_the_order_of_its_moments_and_all_comes_last() -> None:
    order = list(MOMENTS)
    for patrol in plan_crashes(3, 100):
        places = [order.index(kill.moment) for kill in patrol.kills]
        assert places == sorted(places)
        assert not {kill.victim for kill in patrol.kills[:-1]} & set(ENDS_LIFE)


def test_a_clean_campaign() -> None:
    books = balance([call("p0", 10.0), kill("p0"), VERDICT], [record("a", 10.4)], [MAIL], verified="", waiting=0)
    assert books.is_clean
    assert "calls with a verdict: 1 of 1 (20.7% to 100.0%); confirmed 1" in books.text()
    assert "database: verifies" in books.text()


@pytest.mark.parametrize(
    ("mails", "told"),
    [
        ([], "incident a has 0 mails"),
        ([MAIL, KeptMail(message_id="<2@x>", incident="a")], "incident a has 2 mails"),
        ([MAIL, KeptMail(message_id="<3@x>", incident="b")], "a mail tells of the incident b, which is not kept"),
        ([MAIL, MAIL], "mails that came twice under one Message-ID: 1"),
    ],
)
def test_mails_that_do_not_add_up(mails: list[KeptMail], told: str) -> None:
    books = balance([call("p0", 10.0), VERDICT], [record("a", 10.4)], mails, verified="", waiting=0)
    assert not books.is_clean
    assert told in books.text()


def test_a_mail_about_what_is_on_record_as_clear_is_told() -> None:
    records = [record("a", 10.4, "clear"), record("b", 20.0, "")]
    mails = [MAIL, KeptMail(message_id="<2@x>", incident="b")]
    told = balance([call("p0", 10.0), VERDICT], records, mails, verified="", waiting=0).text()
    assert "a mail tells of the incident a, which is on record as clear" in told
    assert "a mail tells of the incident b, which is on record as open" in told


def test_a_call_is_answered_by_what_the_patrol_kept_of_it_alone() -> None:
    journal = [call("p0", 100.0), kill("p0", ALL), {**VERDICT, "verdict": "clear"}, call("p1", 200.0, 1)]
    answers = [record("a", 100.3, "unverified"), record("b", 201.0, "clear")]
    assert dict(balance(journal, answers, [], verified=None, waiting=0).answered) == {"unverified": 1, "clear": 1}
    for other in (record("a", 50.0, "clear"), record("a", 130.0, "clear", room=2), record("a", 100.3, "")):
        lost = balance(journal, [other, answers[1]], [], verified=None, waiting=0)
        assert lost.lost == ["call p0 of room 1, killed: all driving+1.00 s: no verdict"]
        assert not lost.is_clean


@pytest.mark.parametrize(("verdict", "is_clean"), [("clear", False), ("unverified", True), ("confirmed", True)])
def test_a_room_that_is_clear_with_somebody_in_it_is_not_clean(verdict: str, is_clean: bool) -> None:
    said = {**VERDICT, "verdict": verdict, "there": True}
    mails = [MAIL] if verdict == "confirmed" else []
    books = balance([call("p0", 10.0), kill("p0"), said], [record("a", 10.4, verdict)], mails, verified="", waiting=0)
    assert books.is_clean == is_clean
    assert f"somebody in the room, and yet clear: {int(not is_clean)} of 1" in books.text()
    gone = balance(
        [call("p0", 10.0), {**said, "there": False}], [record("a", 10.4, "clear")], [], verified="", waiting=0
    )
    assert gone.is_clean  # all was killed, and in the next life somebody stands elsewhere


def test_what_is_left_over_is_not_clean() -> None:
    journal = [call("p0", 10.0), VERDICT]
    assert not balance(journal, [record("a", 10.4)], [MAIL], verified="", waiting=1).is_clean
    assert not balance(journal, [record("a", 10.4)], [MAIL], verified="link 3 is broken", waiting=0).is_clean


def test_the_journal_goes_on_where_a_kill_cut_it(tmp_path: Path) -> None:
    journal = Journal(tmp_path / "deep" / "journal.jsonl")
    assert journal.read() == []
    assert next_patrol([]) == 0
    journal.add("call", call="p4", patrol=4, room=1, wall=1.0)
    with journal.path.open("a") as file:
        file.write('{"kind": "kil')
    lines = journal.read()
    assert next_patrol(lines) == 5
    open_one = open_call(lines)
    assert open_one is not None
    assert open_one["call"] == "p4"
    assert not is_killed(lines)
    assert open_call([*lines, {"kind": "verdict", "call": "p4"}]) is None
    assert is_killed([*lines, kill("p4", ALL)])
    assert is_killed([*lines, kill("p4", MASTER)])
