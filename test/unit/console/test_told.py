"""Sentences of the guard in German, and as they came where nobody has translated them."""

import pytest

from rosbot_patrol.console.told import told
from rosbot_patrol.console.words import words_of

PAIRS = {
    "the robot drives home": "der Roboter fährt nach Hause",
    "the mode is night already": "der Modus ist schon night",
    "the mode is night now, it was away": "der Modus ist jetzt night, vorher away",
    "is 9.0, expected at most 5.0 m": "ist 9.0, erwartet wird höchstens 5.0 m",
    "The code is wrong.": "der Code ist falsch.",
    "the map shows no floor there": "die Karte zeigt dort keinen Boden",
    "something that nobody has thought of": "something that nobody has thought of",
    "Guests give no orders.": "Gäste geben keine Befehle.",
    "{odd} braces}": "{odd} braces}",
}


@pytest.mark.parametrize(("text", "german"), PAIRS.items())
def test_a_sentence_in_german(text: str, german: str) -> None:
    assert told(text, words_of("de")) == german
    english = told(text, words_of("en"))
    assert english.lower() == text.lower()
