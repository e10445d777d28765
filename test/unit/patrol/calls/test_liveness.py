"""Until when the patrol listened."""

from __future__ import annotations

from pathlib import Path

import pytest

from rosbot_patrol.patrol.calls.liveness import Vigil


def test_a_first_start_has_no_gap(tmp_path: Path) -> None:
    vigil = Vigil(tmp_path / "state" / "alive", 1000.0)
    assert not vigil.has_gap
    assert not vigil.missed(999.9)


def test_what_was_called_between_the_last_sign_and_the_start_was_missed(tmp_path: Path) -> None:
    first = Vigil(tmp_path / "alive", 1000.0)
    for k in range(100):
        first.step(1000.0 + 0.1 * k)
    again = Vigil(tmp_path / "alive", 1030.0)
    assert again.has_gap
    assert [again.missed(t) for t in (1008.0, 1009.9, 1020.0, 1030.1, 1031.0)] == [False, True, True, True, False]


def test_a_gap_longer_than_a_restart_is_known(tmp_path: Path) -> None:
    Vigil(tmp_path / "alive", 1000.0)
    assert Vigil(tmp_path / "alive", 1030.0).down is None
    again = Vigil(tmp_path / "alive", 90_000.0)
    assert again.down == 1030.0
    assert not again.has_gap


def test_after_an_orderly_end_nothing_was_missed(tmp_path: Path) -> None:
    first = Vigil(tmp_path / "alive", 1000.0)
    first.end()
    first.end()
    assert not Vigil(tmp_path / "alive", 1030.0).has_gap


@pytest.mark.parametrize("wall", [900.0, 9000.0])
def test_a_clock_that_was_set_and_a_long_night_are_no_gap(tmp_path: Path, wall: float) -> None:
    Vigil(tmp_path / "alive", 1000.0)
    assert not Vigil(tmp_path / "alive", wall).has_gap


def test_a_folder_that_cannot_be_written_is_said(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    vigil = Vigil(tmp_path / "file" / "alive", 1000.0)
    assert "file" in vigil.problem
    assert not vigil.has_gap
    with pytest.raises(OSError, match="file"):
        vigil.step(1001.5)
    (tmp_path / "file").unlink()  # the disk is back
    vigil.step(1003.0)
    assert Vigil(tmp_path / "file" / "alive", 1010.0).missed(1005.0)
