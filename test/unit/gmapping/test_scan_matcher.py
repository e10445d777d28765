"""Where a scan fits, and which beams of it count."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from mapped_room import CORRIDOR, scan_at, small

from rosbot_patrol.geometry import Pose2D, Transform
from rosbot_patrol.gmapping.beams import Beams, pick_beams
from rosbot_patrol.gmapping.motion_model import move_deviation, move_poses
from rosbot_patrol.gmapping.parameters import GmappingParams
from rosbot_patrol.gmapping.particle_map import ParticleMaps
from rosbot_patrol.gmapping.scan_matcher import Matches, ScanMatcher
from rosbot_patrol.scan import LaserScan, level_scan

SIGMAS = np.array([0.1, 0.1, 0.1])


def matched(guess: Pose2D, *, truth: Pose2D | None = None, **changes: object) -> Matches:
    """A map of the room made at the origin, and a scan at `truth` matched into it from a guess."""
    params = small(**changes)
    maps = ParticleMaps((-8.0, -8.0), (8.0, 8.0), 0.05, 1)
    for x in (0.0, 0.1):
        maps.register(np.array([[x, 0.0, 0.0]]), pick_beams(scan_at(Pose2D(x), beams=360), Pose2D(), params))
    seen = pick_beams(scan_at(truth or Pose2D(), beams=360), Pose2D(), params)
    return ScanMatcher(params).match(maps, np.array([guess]), np.zeros(1), seen, SIGMAS, best=0, noise=np.zeros((1, 3)))


@pytest.mark.parametrize("off", [(0.06, -0.04, 0.0), (-0.12, 0.1, 0.08), (0.0, 0.0, -0.12)])
def test_a_scan_is_found_again(off: tuple[float, float, float]) -> None:
    truth = Pose2D(0.3, -0.2, 0.4)
    found = matched(Pose2D(*(np.array(truth) + off)), truth=truth).modes[0]
    assert math.hypot(found[0] - truth.x, found[1] - truth.y) < 0.01
    assert abs(found[2] - truth.yaw) < math.radians(0.3)


@pytest.fixture
def corridor() -> ParticleMaps:
    """Seen from several places, so that its walls are closed."""
    maps = ParticleMaps((-20.0, -4.0), (20.0, 4.0), 0.05, 1)
    for x in np.arange(-1.0, 1.01, 0.1):
        maps.register(np.array([[x, 0.0, 0.0]]), pick_beams(scan_at(Pose2D(x), walls=CORRIDOR), Pose2D(), small()))
    return maps


def test_along_a_corridor_the_odometry_is_believed(corridor: ParticleMaps) -> None:
    seen = pick_beams(scan_at(Pose2D(0.23, 0.0, 0.0), walls=CORRIDOR), Pose2D(), small())
    guesses = np.array([(0.31, 0.08, 0.03)])
    found = (
        ScanMatcher(small())
        .match(corridor, guesses, np.zeros(1), seen, SIGMAS, best=0, noise=np.zeros((1, 3)))
        .modes[0]
    )
    assert abs(found[1]) < 0.03  # within the kernel: a map from few places has gaps between far ends
    assert abs(found[2]) < math.radians(0.3)
    assert abs(found[0] - 0.31) < 0.03


def test_the_proposal_is_wide_along_a_corridor_and_narrow_across(corridor: ParticleMaps) -> None:
    seen = pick_beams(scan_at(Pose2D(0.02), walls=CORRIDOR), Pose2D(), small())
    matcher, still = ScanMatcher(small()), np.zeros((1, 3))

    def drawn(*noise: float) -> np.ndarray:
        found = matcher.match(corridor, still, np.zeros(1), seen, SIGMAS, best=0, noise=np.array([noise]))
        return found.poses[0] - found.modes[0]

    assert 0.03 < abs(drawn(1.0, 0.0, 0.0)[0]) < 0.11  # a few lone far ends hold it, too
    assert abs(drawn(0.0, 1.0, 0.0)[1]) < 0.01
    assert abs(drawn(0.0, 0.0, 1.0)[2]) < 0.02


@pytest.mark.parametrize(("noise", "low", "high"), [(0.0, 0.2, 0.2), (0.02, 0.3, 0.5), (0.05, 0.5, 1.0)])
def test_the_better_the_beams_the_narrower_the_proposal(noise: float, low: float, high: float) -> None:
    """`low` and `high`: of what it learns of the beams [cells], 0.05 m each."""
    rng = np.random.default_rng(3)
    params = small()
    maps = ParticleMaps((-8.0, -8.0), (8.0, 8.0), 0.05, 1)
    matcher, still = ScanMatcher(params), np.zeros((1, 3))

    def seen() -> Beams:
        scan = scan_at(Pose2D(), beams=360)
        return pick_beams(replace(scan, ranges=scan.ranges + rng.normal(0.0, noise, 360)), Pose2D(), params)

    for _ in range(20):
        maps.register(still, seen())
    drawn = [
        matcher.match(maps, still, np.zeros(1), seen(), SIGMAS, best=0, noise=np.array([(0.0, 0.0, 1.0)]))
        for _ in range(30)
    ]
    learned = math.sqrt(matcher.variance)
    assert low - 1e-9 <= learned <= high
    turned = abs(drawn[-1].poses[0] - drawn[-1].modes[0])[2]
    assert 0.0 < turned < 0.0042 * learned  # of 90 beams with arms of 2 m, and of odometry that is right


def test_a_match_that_is_not_believed_follows_the_odometry() -> None:
    found = matched(Pose2D(0.05, 0.0, 0.0), minimumScore=1e6)
    assert found.scores[0] == 0.0
    assert found.poses[0] == pytest.approx((0.05, 0.0, 0.0))


def test_a_better_fit_is_more_likely() -> None:
    right = matched(Pose2D()).log_likelihoods[0]
    wrong = matched(Pose2D(2.0, 1.0, 0.5)).log_likelihoods[0]
    assert wrong < right - 100.0


def scan_of(*ranges: float) -> LaserScan:
    return LaserScan(
        stamp=0.0,
        frame_id="laser",
        angle_min=0.0,
        angle_increment=0.1,
        range_min=0.2,
        range_max=10.0,
        ranges=np.array(ranges),
    )


def test_beams_that_measured_nothing_say_nothing() -> None:
    beams = pick_beams(scan_of(math.nan, 0.1, -math.inf, math.inf, 10.0, 9.995, 5.0, 0.0), Pose2D(), GmappingParams())
    assert beams.is_hit.tolist() == [True]
    assert np.hypot(*beams.ends[0]) == pytest.approx(5.0)


def test_misses_free_the_floor_where_max_range_asks_for_it() -> None:
    params = GmappingParams(maxRange=10.0, maxUrange=8.0)
    beams = pick_beams(scan_of(5.0, math.inf, 10.0, 9.0), Pose2D(), params)
    assert beams.is_hit.tolist() == [True, False, False, False]
    assert np.hypot(*beams.ends.T) == pytest.approx([5.0, 8.0, 8.0, 8.0])


@pytest.mark.parametrize("limit", [math.inf, float(np.finfo(np.float32).max)])
def test_a_scan_without_an_upper_limit_is_used_up_to_100_m(limit: float) -> None:
    scan = replace(scan_of(5.0, math.inf, 30.0, 300.0), range_max=limit)
    beams = pick_beams(scan, Pose2D(), GmappingParams(maxUrange=16.0))
    assert beams.is_hit.tolist() == [True, False]
    assert np.hypot(*beams.ends.T) == pytest.approx([5.0, 16.0])
    beams = pick_beams(scan, Pose2D(), GmappingParams())
    assert np.hypot(*beams.ends[beams.is_hit].T) == pytest.approx([5.0, 30.0])
    free = pick_beams(scan, Pose2D(), GmappingParams(maxRange=100.0, maxUrange=8.0))
    assert np.hypot(*free.ends.T) == pytest.approx([5.0, 8.0, 8.0, 8.0])


def test_a_scan_tells_how_its_walls_run() -> None:
    scan = scan_at(Pose2D(), beams=360)
    hits = pick_beams(scan, Pose2D(), small()).hits
    on_right = np.abs(hits[:, 0] - 4.0) < 1e-6
    across = np.abs(hits[on_right, 4])
    assert np.mean(across > 0.999) > 0.9
    alone = pick_beams(scan_of(3.0, 1.0, 4.0, 2.0), Pose2D(), GmappingParams()).hits
    assert (alone[:, 4:] == 0.0).all()


def test_lasers_upside_down_and_backwards_see_the_same_room() -> None:
    pose, params = Pose2D(0.4, 0.3, 0.7), small()
    mounts = (
        Transform(0.1, 0.05, 0.2, 0.0, 0.0, 1.0, 0.0),
        Transform(-0.1, 0.0, 0.2, math.cos(0.15), math.sin(0.15), 0.0, 0.0),
    )
    for mount in mounts:
        level = level_scan(scan_at(pose, mount=mount), mount, "base_link")
        beams = pick_beams(level.scan, level.pose, params)
        c, s = math.cos(pose.yaw), math.sin(pose.yaw)
        world = beams.ends @ np.array([[c, s], [-s, c]]) + (pose.x, pose.y)
        on_outer = (np.abs(np.abs(world[:, 0]) - 4.0) < 1e-6) | (np.abs(world[:, 1] + 3.0) < 1e-6)
        assert on_outer.mean() > 0.4


def test_a_move_errs_as_the_parameters_say() -> None:
    params = GmappingParams(srr=0.1, srt=0.2, str_=0.3, stt=0.4)
    ahead = move_deviation(Pose2D(2.0, 0.0, 0.0), params)
    assert ahead == pytest.approx([0.2, 0.06, 0.4], rel=0.01)
    turned = move_deviation(Pose2D(0.0, 0.0, -1.0), params)
    assert turned == pytest.approx([0.3, 0.3, 0.4], rel=0.01)
    assert (move_deviation(Pose2D(), params) > 0.0).all()


def test_poses_move_in_their_own_frames() -> None:
    moved = move_poses(np.array([[1.0, 2.0, math.pi / 2], [0.0, 0.0, 0.0]]), Pose2D(1.0, 0.5, 0.1))
    assert moved == pytest.approx(np.array([[0.5, 3.0, math.pi / 2 + 0.1], [1.0, 0.5, 0.1]]))
