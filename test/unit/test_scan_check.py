"""What is kept and said of scans that cannot be used."""

from __future__ import annotations

import logging
import math

import numpy as np
import pytest

from rosbot_patrol.scan import LaserScan
from rosbot_patrol.scan_check import ScanCheck

GOOD, ZEROS, NANS = np.full(360, 3.0), np.zeros(360), np.full(360, math.nan)


def scan_of(ranges: np.ndarray, *, range_max: float = 12.0) -> LaserScan:
    return LaserScan(
        stamp=10.0,
        frame_id="front",
        angle_min=-math.pi,
        angle_increment=math.tau / 360,
        range_min=0.1,
        range_max=range_max,
        ranges=ranges,
    )


def hear(check: ScanCheck, ranges: np.ndarray, now: float, **changes: float) -> None:
    if check.accepts(scan_of(ranges, **changes), now):
        check.clear(now)


def said(caplog: pytest.LogCaptureFixture) -> list[str]:
    return [record.getMessage() for record in caplog.records]


def test_a_problem_is_said_once_and_names_frame_problem_and_loss(caplog: pytest.LogCaptureFixture) -> None:
    check = ScanCheck("the base creeps")
    for k in range(1000):
        hear(check, ZEROS, 0.1 * k)
    (text,) = said(caplog)
    assert "'front'" in text
    assert "say nothing" in text
    assert text.endswith("; the base creeps")
    assert "say nothing" in check.problem


def test_another_problem_is_another_sentence_and_turns_of_both_are_no_flood(caplog: pytest.LogCaptureFixture) -> None:
    check = ScanCheck("nothing is mapped")
    for k in range(300):
        hear(check, (ZEROS, GOOD)[k % 2], 0.1 * k)
        hear(check, GOOD, 0.1 * k, range_max=0.0)
    assert len(said(caplog)) == 2
    assert "range_max 0" in said(caplog)[1]


def test_it_is_said_again_when_it_was_well_for_a_while(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO)
    check = ScanCheck("nobody is waited for")
    hear(check, ZEROS, 0.0)
    for k in range(120):
        hear(check, GOOD, 0.1 * k)
    assert check.problem == ""
    hear(check, NANS, 13.0)
    assert [text.split(":")[0] for text in said(caplog)] == [
        "the scan of frame 'front' is left out",
        "scans can be used again",
        "the scan of frame 'front' is left out",
    ]


def test_it_lasts_once_no_scan_was_used_for_a_while() -> None:
    check = ScanCheck("it stands")
    hear(check, GOOD, 0.0)
    hear(check, ZEROS, 0.5)
    assert not check.lasts(0.9, 1.0)
    assert check.lasts(1.1, 1.0)
    hear(check, GOOD, 1.2)
    assert not check.lasts(9.0, 1.0)  # silence is another matter
    check.refuse("the laser is tilted", 9.0)
    assert check.lasts(9.0, 1.0)


def test_one_that_was_never_well_lasts_at_once() -> None:
    check = ScanCheck("it stands")
    assert not check.lasts(0.0, 1.0)
    check.refuse("the laser is tilted", 0.0)
    assert check.lasts(0.0, 1.0)
