"""Scans that come late, twice or from two lasers, and odometry that begins anew, with the tutorial's few updates."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from house_run import MOUNT, Moment, drive, error, house_map, scan_at

from rosbot_patrol.amcl.localizer import Localizer
from rosbot_patrol.amcl.parameters import AmclParams
from rosbot_patrol.amcl.particles.odometry_track import OdometryTrack, Reading
from rosbot_patrol.geometry import Pose2D, compose, invert

TUTORIAL = AmclParams(odom_model_type="diff-corrected", update_min_d=0.5, update_min_a=1.0)
ALLEY = [(-0.6, 2.5), (-1.2, 4.8), (2.7, 7.35)]


def localizer(parameters: AmclParams = TUTORIAL, seed: int = 0) -> Localizer:
    made = Localizer(parameters, np.random.default_rng(seed))
    made.set_map(house_map())
    return made


def shuffled(moments: list[Moment], share: float, rng: np.random.Generator) -> list[Moment]:
    """Neighbours swapped."""
    found, i = list(moments), 0
    while i + 1 < len(found):
        if rng.random() < share:
            found[i], found[i + 1] = found[i + 1], found[i]
            i += 1
        i += 1
    return found


@pytest.mark.parametrize("seed", [1, 2])
def test_scans_out_of_order_do_not_lead_astray(seed: int) -> None:
    """The robot once was lost by metres: a late scan passed for a clock set back, and the way since the last update
    was forgotten.
    """
    made = localizer(seed=seed)
    worst = np.zeros(2)
    for moment in shuffled(list(drive(ALLEY)), 0.2, np.random.default_rng(seed)):
        made.update(moment.scan, moment.odometry, MOUNT)
        assert made.map_from_odom is not None
        worst = np.maximum(worst, error(compose(made.map_from_odom, moment.odometry), moment.truth))
    assert worst[0] < 0.25
    assert math.degrees(worst[1]) < 15.0


@pytest.mark.parametrize("seed", [0, 1])
def test_somebody_beside_the_robot_does_not_lead_the_tutorials_parameters_astray(seed: int) -> None:
    made, rng = localizer(replace(TUTORIAL, seek="never"), seed), np.random.default_rng(seed)
    first, worst = 0.0, 0.0
    for moment in drive([*ALLEY, (-2.5, 6.5), (-4.0, 4.0)]):
        first += rng.normal(0.0, 6.0)
        seen, ranges = (int(first) + np.arange(36)) % 120, moment.scan.ranges.copy()
        ranges[seen] = np.minimum(ranges[seen], 0.7)
        made.update(replace(moment.scan, ranges=ranges), moment.odometry, MOUNT)
        assert made.map_from_odom is not None
        worst = max(worst, error(compose(made.map_from_odom, moment.odometry), moment.truth)[0])
    assert worst < 0.3


def test_a_late_scan_changes_nothing() -> None:
    made = localizer()
    moments = list(drive(ALLEY[:1]))[:6]
    for moment in moments[:3] + moments[4:]:
        made.update(moment.scan, moment.odometry, MOUNT)
    before, correction = made.filter.poses.copy(), made.map_from_odom
    outcome = made.update(moments[3].scan, moments[3].odometry, MOUNT)
    assert outcome.is_late
    assert not outcome.updated
    np.testing.assert_array_equal(made.filter.poses, before)
    assert made.map_from_odom == correction


def test_a_restart_of_the_odometry_in_mid_drive_keeps_the_way_until_then() -> None:
    made = localizer()
    begun_anew: Pose2D | None = None
    for i, moment in enumerate(drive(ALLEY)):
        if i == 47:
            begun_anew = moment.odometry
        told = moment.odometry if begun_anew is None else compose(invert(begun_anew), moment.odometry)
        made.update(moment.scan, told, MOUNT)
        assert made.map_from_odom is not None
        assert error(compose(made.map_from_odom, told), moment.truth)[0] < 0.35


def test_what_a_stamp_and_an_odometry_are() -> None:
    track = OdometryTrack()
    assert track.classify(10.0, Pose2D(50.0, 0.0, 0.0)) is Reading.USUAL
    track.follow(10.0, Pose2D())
    assert track.classify(10.0, Pose2D()) is Reading.USUAL  # two lasers
    assert track.classify(9.9, Pose2D()) is Reading.LATE
    assert track.classify(9.0, Pose2D()) is Reading.LATE
    assert track.classify(8.9, Pose2D(0.5, 0.0, 0.0)) is Reading.USUAL  # the clock was set, the odometry goes on
    assert track.classify(8.9, Pose2D(3.0, 0.0, 0.0)) is Reading.RESTART
    assert track.classify(10.1, Pose2D(1.4, 0.0, 0.0)) is Reading.USUAL
    assert track.classify(10.1, Pose2D(1.6, 0.0, 0.0)) is Reading.RESTART
    assert track.classify(20.0, Pose2D(30.0, 0.0, 0.0)) is Reading.USUAL  # ten seconds without a scan


def test_each_of_two_lasers_weighs_a_motion_once() -> None:
    made = localizer(AmclParams(update_min_d=0.2, resample_interval=1))
    front = scan_at(Pose2D(), np.random.default_rng(0))
    back = replace(front, frame_id="laser_back")

    def updates(x: float) -> list[bool]:
        odometry = Pose2D(x, 0.0, 0.0)
        return [made.update(scan, odometry, MOUNT).updated for scan in (front, back, front, back)]

    assert updates(0.0) == [True, False, False, False]  # of the second one nothing was known at the start
    assert updates(0.25) == [True, True, False, False]
    assert updates(0.3) == [False, False, False, False]


def test_the_way_between_a_click_and_the_next_scan_is_not_lost() -> None:
    made = localizer()
    moments = list(drive(ALLEY))
    made.update(moments[0].scan, moments[0].odometry, MOUNT)
    clicked, later = moments[10], moments[16]
    made.set_pose(clicked.truth, np.diag([0.01, 0.01, 0.003]), clicked.odometry)
    made.update(later.scan, later.odometry, MOUNT)
    assert made.map_from_odom is not None
    assert error(compose(made.map_from_odom, later.odometry), later.truth)[0] < 0.15
