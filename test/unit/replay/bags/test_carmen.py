"""CARMEN logs, the odometry made from them, and errors of relations."""

from __future__ import annotations

import gzip
import math
from pathlib import Path

import numpy as np
import pytest

from rosbot_patrol.replay.bags.carmen import LogError, noisy_odometry, parse_lines, read_log
from rosbot_patrol.replay.results.relations import consecutive_pairs, relation_errors, revisit_pairs

FRONT = "FLASER 4 1.0 2.5 81.83 3.0 0.5 -1.0 3.2 9 9 9 12.5 host 0.25\n"
ROBOT = "ROBOTLASER1 0 -1.57 3.14 0.785 30 0.01 0 5 1 2 31 4 5 2 7 7 1 2 0.5 1.1 2.1 0.6 0 0 0 0 0 77.5 host 1\n"


def test_a_front_laser_is_half_a_turn() -> None:
    (logged,) = parse_lines(iter(["# comment\n", "\n", "ODOM 1 2\n", FRONT]))
    scan, pose = logged
    assert scan.stamp == 12.5
    assert scan.angle_min == -math.pi / 2
    assert scan.angle_increment == math.pi / 4
    assert scan.ranges.tolist() == [1.0, 2.5, math.inf, 3.0]
    assert pose == pytest.approx((0.5, -1.0, 3.2 - math.tau))


def test_an_odd_number_of_beams_has_one_at_each_end() -> None:
    line = "FLASER 181 " + "1.0 " * 181 + "0 0 0 0 0 0 1 h 1"
    ((scan, _),) = parse_lines(iter([line]))
    assert scan.angles[[0, 90, 180]] == pytest.approx([-math.pi / 2, 0.0, math.pi / 2])


def test_the_newer_line_names_its_angles() -> None:
    ((scan, pose),) = parse_lines(iter([ROBOT]))
    assert (scan.angle_min, scan.angle_increment, scan.range_max) == (-1.57, 0.785, 30.0)
    assert scan.ranges.tolist() == [1.0, 2.0, math.inf, 4.0, 5.0]
    assert pose == (1.0, 2.0, 0.5)
    assert scan.stamp == 77.5


def test_a_log_may_be_packed(tmp_path: Path) -> None:
    (tmp_path / "a.log").write_text(FRONT + ROBOT)
    (tmp_path / "b.log.gz").write_bytes(gzip.compress((FRONT + ROBOT).encode()))
    for name in ("a.log", "b.log.gz"):
        log = read_log(tmp_path / name)
        assert len(log.scans) == 2
        assert log.poses.shape == (2, 3)


@pytest.mark.parametrize(
    ("line", "why"),
    [
        ("FLASER 4 1.0 2.0", "line 2, FLASER, makes no sense: it has 4 words, expected 15"),
        (FRONT.replace("2.5", "two"), "line 2, FLASER, makes no sense: could not convert"),
        (FRONT.replace("FLASER 4", "FLASER 1"), "1 beam, expected 2 at least"),
        (FRONT.replace("-1.0", "nan"), "is no pose"),
        ("FLASER", "line 2, FLASER"),
    ],
)
def test_a_bad_line_is_named(tmp_path: Path, line: str, why: str) -> None:
    (tmp_path / "bad.log").write_text(f"{FRONT}{line}\n")
    with pytest.raises(LogError, match=why):
        read_log(tmp_path / "bad.log")


def test_a_bad_file_is_named(tmp_path: Path) -> None:
    (tmp_path / "empty.log").write_text("ODOM 1 2 3\n")
    with pytest.raises(LogError, match=r"empty.log: holds no FLASER or ROBOTLASER1 line"):
        read_log(tmp_path / "empty.log")
    (tmp_path / "cut.log.gz").write_bytes(gzip.compress(FRONT.encode() * 500)[:-20])
    with pytest.raises(LogError, match=r"cut.log.gz: cannot be read"):
        read_log(tmp_path / "cut.log.gz")
    with pytest.raises(LogError, match="No such file"):
        read_log(tmp_path / "none.log")


def moves(odometry: np.ndarray) -> np.ndarray:
    return np.diff(odometry, axis=0)


def test_the_wheels_err_as_stated() -> None:
    rng = np.random.default_rng(1)
    ahead = np.column_stack((np.arange(3.0), np.zeros(3), np.zeros(3)))
    ends = np.array([noisy_odometry(ahead, rng)[1] for _ in range(1500)])
    assert ends[:, 0].std() == pytest.approx(0.02, rel=0.1)
    assert ends[:, 1].std() == pytest.approx(0.005, rel=0.1)
    assert ends[:, 2].std() == pytest.approx(0.005 * math.sqrt(2.0), rel=0.1)
    turning = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    ends = np.array([noisy_odometry(turning, rng)[1] for _ in range(1500)])
    assert ends[:, 2].std() == pytest.approx(0.02, rel=0.1)
    assert np.hypot(*ends[:, :2].T).std() < 0.005


def test_backwards_is_no_half_turn() -> None:
    back = np.array([[0.0, 0.0, 0.3], [-math.cos(0.3), -math.sin(0.3), 0.3]])
    ends = np.array([noisy_odometry(back, np.random.default_rng(seed))[1] for seed in range(500)])
    assert ends[:, 0].mean() == pytest.approx(-1.0, abs=0.01)
    assert ends[:, 2].std() < 0.01


def test_odometry_is_seeded_and_begins_at_nought() -> None:
    poses = np.random.default_rng(0).standard_normal((20, 3)).cumsum(axis=0)
    once, twice = (noisy_odometry(poses, np.random.default_rng(5)) for _ in range(2))
    assert (once == twice).all()
    assert (once[0] == 0.0).all()


def circle(count: int = 400) -> np.ndarray:
    angle = np.linspace(0.0, 4.0 * math.pi, count)
    return np.column_stack((5.0 * np.cos(angle), 5.0 * np.sin(angle), angle + math.pi / 2))


def test_relations_do_not_see_where_the_whole_lies() -> None:
    way = circle()
    c, s = math.cos(1.0), math.sin(1.0)
    moved = np.column_stack((way[:, :2] @ np.array([[c, s], [-s, c]]) + 7.0, way[:, 2] + 1.0))
    errors = relation_errors(moved, way, consecutive_pairs(len(way)))
    assert errors.count == 399
    assert errors.shift < 1e-9
    assert errors.turn < 1e-9


def test_one_wrong_relation_counts_once() -> None:
    way = np.column_stack((np.arange(11.0), np.zeros(11), np.zeros(11)))
    bent = way.copy()
    bent[5:, 0] += 0.5
    errors = relation_errors(bent, way, consecutive_pairs(11))
    assert errors.shift == pytest.approx(0.05)
    assert errors.turn == 0.0


def test_revisits_are_near_and_long_ago() -> None:
    way = circle()
    pairs = revisit_pairs(way)
    gaps = pairs[:, 1] - pairs[:, 0]
    apart = np.hypot(*(way[pairs[:, 0], :2] - way[pairs[:, 1], :2]).T)
    assert len(pairs)
    assert gaps.min() > 100
    assert apart.max() <= 3.0
    assert len(revisit_pairs(way[:50])) == 0


def test_what_cannot_be_compared_is_said() -> None:
    with pytest.raises(ValueError, match="10 poses against 9"):
        relation_errors(circle(10), circle(9), consecutive_pairs(9))
    with pytest.raises(ValueError, match="no pairs"):
        relation_errors(circle(10), circle(10), np.empty((0, 2), dtype=np.int64))
