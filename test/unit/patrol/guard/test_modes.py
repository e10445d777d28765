"""What people type for the modes, and that a hint never says the opposite."""

from __future__ import annotations

import pytest

from rosbot_patrol.patrol.guard.modes import DISARMED, MODES, parse_mode, unknown_mode


@pytest.mark.parametrize(
    ("typed", "mode"),
    [
        *((mode, mode) for mode in MODES),
        ("armed", "armed_away"),
        (" Armed ", "armed_away"),
        ("ARMED_HOME", "armed_home"),
        ("armed home", "armed_home"),
        ("armed-away\n", "armed_away"),
        ("Disarmed", DISARMED),
        ("\tnight", "night"),
    ],
)
def test_a_mode_in_any_case_and_with_blanks(typed: str, mode: str) -> None:
    assert parse_mode(typed) == mode


@pytest.mark.parametrize(
    ("typed", "meant"),
    [
        ("arm", "armed_away"),
        ("away", "armed_away"),
        ("on", "armed_away"),
        ("armed_awya", "armed_away"),
        ("arned", "armed_away"),
        ("home", "armed_home"),
        ("armed_hom", "armed_home"),
        ("nigth", "night"),
        ("disarm", DISARMED),
        ("off", DISARMED),
        ("OFF ", DISARMED),
        ("unarmed", DISARMED),
        ("dissarmed", DISARMED),
    ],
)
def test_a_slip_gets_the_mode_that_was_meant(typed: str, meant: str) -> None:
    assert parse_mode(typed) is None
    assert unknown_mode(typed).endswith(f"is not known here, did you mean '{meant}'?")


@pytest.mark.parametrize(
    "typed", ["", "   ", "party", "darmed", "isarmed", "not armed", "de-armed", "armed?no", "1", "x" * 9999]
)
def test_what_is_not_sure_gets_all_names(typed: str) -> None:
    text = unknown_mode(typed)
    assert text.endswith("is not known here, expected one of armed_away, armed_home, night, disarmed")
    assert len(text) < 160


ARMED_LIKE = [
    "armed",
    "arm",
    "armed_",
    "armd",
    "amed",
    "armed1",
    "armeed",
    "Armed!",
    "rmed",
    "away",
    "on",
    "home",
    "night",
]
DISARMED_LIKE = ["disarm", "disarmd", "disramed", "dsarmed", "disarmed!", "off", "unarm", "disarming", "disarmed_away"]


@pytest.mark.parametrize("typed", ARMED_LIKE)
def test_arming_is_never_answered_by_disarming(typed: str) -> None:
    assert parse_mode(typed) != DISARMED
    assert f"'{DISARMED}'" not in unknown_mode(typed)


@pytest.mark.parametrize("typed", DISARMED_LIKE)
def test_disarming_is_never_answered_by_arming(typed: str) -> None:
    assert parse_mode(typed) in (None, DISARMED)
    assert not any(f"did you mean '{mode}'" in unknown_mode(typed) for mode in MODES if mode != DISARMED)
