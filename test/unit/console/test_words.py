"""Every text of the pages has its German one, with the same gaps to fill."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest
from babel.messages.pofile import read_po

from rosbot_patrol.console import words
from rosbot_patrol.console.live.house_state import ArmingNow, GuardNow, HouseState
from rosbot_patrol.console.sentences import ago, headline

CONSOLE = Path(words.__file__).resolve().parent
MARKS = ("_", "words", "later")


def texts() -> set[str]:
    found = set()
    for path in CONSOLE.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            if not (isinstance(node, ast.Call) and node.args and isinstance(node.args[0], ast.Constant)):
                continue
            name = getattr(node.func, "id", getattr(node.func, "attr", ""))
            if name in MARKS and isinstance(node.args[0].value, str):
                found.add(node.args[0].value)
    return found


def test_the_catalogue_is_complete() -> None:
    with (CONSOLE / "locale" / "de.po").open("rb") as file:
        german = {str(each.id): str(each.string) for each in read_po(file, locale="de") if each.id}
    assert sorted(texts() - german.keys()) == []
    assert sorted(german.keys() - texts()) == []
    assert [text for text, other in german.items() if not other] == []
    gaps = re.compile(r"\{\w+\}")
    assert [text for text, other in german.items() if sorted(gaps.findall(text)) != sorted(gaps.findall(other))] == []


@pytest.mark.parametrize(
    ("accept", "language"),
    [("de-AT,de;q=0.9,en;q=0.5", "de"), ("fr,en;q=0.5", "en"), ("fr", "en"), ("", "en"), ("*", "en")],
)
def test_the_language_is_the_browsers_first_that_there_is(accept: str, language: str) -> None:
    assert words.language_of(accept) == language


STATES = [
    (HouseState(), "Waiting for the guard."),
    (HouseState(guard=GuardNow(doing="idle")), "The guard does not answer."),
    (HouseState(is_heard=True, guard=GuardNow(doing="idle")), "On guard. All is quiet."),
    (HouseState(is_heard=True, guard=GuardNow(doing="idle"), is_stopped=True), "Stopped by the emergency stop."),
    (
        HouseState(is_heard=True, guard=GuardNow(doing="idle"), arming=ArmingNow(mode="disarmed")),
        "Disarmed: no sensor calls the guard.",
    ),
    (
        HouseState(is_heard=True, guard=GuardNow(doing="driving", room_name="kitchen", origin="trigger")),
        "On the way to kitchen: its motion sensor called.",
    ),
    (
        HouseState(is_heard=True, guard=GuardNow(doing="looking", room_name="kitchen", verdict="confirmed")),
        "Somebody is in kitchen!",
    ),
]


@pytest.mark.parametrize(("state", "text"), STATES)
def test_the_guard_is_told_in_one_sentence(state: HouseState, text: str) -> None:
    assert headline(state, words.words_of("en")).text == text
    assert headline(state, words.words_of("de")).text != text


def test_how_long_ago() -> None:
    english = words.words_of("en")
    assert [ago(s, english) for s in (None, 5, 119, 120, 7200, 200_000)] == [
        "never", "5 s ago", "119 s ago", "2 min ago", "2 h ago", "2 d ago",
    ]  # fmt: skip
