"""The layout of a scan: ours with fixed angles, and upstream's."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rosbot_patrol.drivers.rplidar.laser_scan import ascending, fixed_angles, upstream_angles
from rosbot_patrol.drivers.rplidar.samples import Samples
from rosbot_patrol.drivers.rplidar.turns import MOST, Turn, Turns


def turn(degrees: list[float], distance: list[float] | float = 1.0) -> Turn:
    angle = np.radians(degrees)
    return Turn(angle, np.broadcast_to(np.asarray(distance, float), angle.shape).copy(), np.full(len(angle), 188))


EVEN = [each * 3.6 for each in range(100)]


def test_the_angles_are_the_same_for_every_turn() -> None:
    for degrees in (EVEN, EVEN[3:], [each + 1.0 for each in EVEN[:-1]]):
        layout = fixed_angles(turn(degrees), 100)
        assert layout.angle_min == -math.pi
        assert layout.angle_increment == pytest.approx(math.tau / 100)
        assert layout.angle_max == pytest.approx(math.pi - math.tau / 100)
        assert len(layout.ranges) == len(layout.intensities) == 100


def test_a_sample_stands_at_pi_minus_its_angle() -> None:
    layout = fixed_angles(turn([90.0], 2.0), 100)
    at = int(np.flatnonzero(layout.ranges == 2.0)[0])
    assert layout.angle_min + at * layout.angle_increment == pytest.approx(math.pi / 2)
    assert layout.intensities[at] == 47
    upside_down = fixed_angles(turn([90.0], 2.0), 100, inverted=True)
    at = int(np.flatnonzero(upside_down.ranges == 2.0)[0])
    assert upside_down.angle_min + at * upside_down.angle_increment == pytest.approx(-math.pi / 2)


def test_the_lidars_zero_is_the_seam() -> None:
    layout = fixed_angles(turn([0.0, 180.0], [3.0, 5.0]), 100)
    assert layout.ranges[0] == 3.0
    assert layout.ranges[50] == 5.0


def test_no_echo_is_inf_and_no_sample_is_nan() -> None:
    layout = fixed_angles(turn([90.0, 93.6], [0.0, 2.0]), 100)
    assert np.isinf(layout.ranges).sum() in (1, 2)
    assert np.isnan(layout.ranges).sum() >= 96


def test_a_cell_that_a_wobble_left_empty_takes_its_nearest_neighbour() -> None:
    degrees = [*EVEN[:50], EVEN[50] + 2.0, *EVEN[51:]]
    layout = fixed_angles(turn(degrees, [*([1.0] * 50), 7.0, *([1.0] * 49)]), 100)
    assert not np.isnan(layout.ranges).any()


def test_two_samples_in_a_cell_leave_the_nearer_angle() -> None:
    layout = fixed_angles(turn([90.0, 90.5], [4.0, 2.0]), 100)
    assert layout.ranges[75] == 4.0


def test_upstream_without_compensation_spans_the_echoes_and_turns_the_order() -> None:
    layout = upstream_angles(turn([10.0, 20.0, 30.0, 40.0], [0.0, 1.0, 2.0, 0.0]), 400, compensate=False)
    assert layout is not None
    assert layout.ranges.tolist() == [2.0, 1.0]
    assert (layout.angle_min, layout.angle_max) == pytest.approx((math.radians(150.0), math.radians(160.0)))
    kept = upstream_angles(turn([10.0, 20.0, 30.0, 40.0], [0.0, 1.0, 2.0, 0.0]), 400, compensate=False, inverted=True)
    assert kept is not None
    assert kept.ranges.tolist() == [1.0, 2.0]


def test_upstream_with_compensation_spreads_each_echo() -> None:
    layout = upstream_angles(turn(EVEN), 800)
    assert layout is not None
    cells = int(360 * (800 / 360 + 1))
    assert len(layout.ranges) == cells
    assert (layout.angle_min, layout.angle_max) == (-math.pi, math.pi)
    assert layout.angle_increment == pytest.approx(math.tau / (cells - 1))
    assert np.isfinite(layout.ranges).sum() == 100 * 4
    assert layout.ranges[cells - 1] == 1.0  # the lidar's 0 degrees, which upstream lays at the end


def test_a_turn_without_an_echo_is_no_scan_of_upstream() -> None:
    assert upstream_angles(turn([0.0, 90.0], 0.0), 400) is None
    assert ascending(turn([0.0, 90.0], 0.0)) is None
    assert np.isinf(fixed_angles(turn(EVEN, 0.0), 100).ranges).all()


def test_ascending_fills_the_angles_of_lost_samples() -> None:
    found = ascending(turn([0.0, 90.0, 180.0, 270.0], [0.0, 1.0, 0.0, 1.0]))
    assert found is not None
    assert np.degrees(found.angle).tolist() == pytest.approx([0.0, 90.0, 180.0, 270.0])


def samples(count: int, first: list[int], *, is_new_scan: bool = False) -> Samples:
    is_first = np.zeros(count, bool)
    is_first[first] = True
    ones = np.ones(count, np.int64)
    return Samples(np.arange(count), ones * 4000, ones * 188, is_first, is_new_scan)


def test_the_first_partial_turn_is_dropped() -> None:
    turns = Turns()
    assert turns.feed(samples(10, [4])) == []
    done = turns.feed(samples(10, [7]))
    assert [len(each) for each in done] == [13]
    assert done[0].distance[0] == 1.0


def test_a_new_scan_voids_the_turn_under_way() -> None:
    turns = Turns()
    turns.feed(samples(10, [0]))
    assert turns.feed(samples(0, [], is_new_scan=True)) == []
    assert turns.feed(samples(10, [3])) == []
    assert [len(each) for each in turns.feed(samples(5, [0]))] == [7]


def test_a_turn_that_never_ends_is_cut() -> None:
    turns = Turns()
    turns.feed(samples(10, [0]))
    for _ in range(3):
        turns.feed(samples(5000, []))
    done = turns.feed(samples(1, [0]))
    assert [len(each) for each in done] == [MOST]
    assert turns.lost == 15010 - MOST
