"""The whole of amcl without ROS, on drives through the house."""

from __future__ import annotations

import logging
import math
from dataclasses import replace

import numpy as np
import pytest
import yaml
from house_run import MOUNT, ROOT, drive, error, house_map, scan_at

from rosbot_patrol import params
from rosbot_patrol.amcl.localizer import Localizer
from rosbot_patrol.amcl.parameters import AmclParams
from rosbot_patrol.errors import MapError
from rosbot_patrol.geometry import Pose2D, Transform, compose
from rosbot_patrol.grid import Grid, GridInfo
from rosbot_patrol.scan import level_scan, scan_problem

CORRIDOR = [(-0.6, 2.5), (-1.2, 4.8)]


def tuned(**changes: object) -> AmclParams:
    with (ROOT / "config" / "tuned" / "amcl.yaml").open() as file:
        return params.load(AmclParams, yaml.safe_load(file) | changes)


def localizer(parameters: AmclParams | None = None, *, seed: int = 0, grid: Grid | None = None) -> Localizer:
    made = Localizer(parameters or tuned(), np.random.default_rng(seed))
    made.set_map(grid or house_map())
    return made


def follow(made: Localizer, **options: object) -> np.ndarray:
    """Errors in place and heading at each scan, shape (N, 2)."""
    rows = []
    for moment in drive(**options):  # type: ignore[arg-type]
        made.update(moment.scan, moment.odometry, MOUNT)
        assert made.map_from_odom is not None
        rows.append(error(compose(made.map_from_odom, moment.odometry), moment.truth))
    return np.array(rows)


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def test_the_tuned_profile_names_only_known_parameters(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING):
        assert tuned().laser_max_beams == 60
    assert not caplog.records


def test_a_patrol_stays_within_five_centimetres() -> None:
    errors = follow(localizer())
    assert rms(errors[:, 0]) < 0.03
    assert errors[:, 0].max() < 0.15
    assert math.degrees(rms(errors[:, 1])) < 1.0


@pytest.mark.parametrize(
    ("changes", "limit"),
    [
        ({"laser_model_type": "likelihood_field_prob", "laser_sigma_hit": 0.2}, 0.03),
        ({"laser_model_type": "likelihood_field_prob", "laser_sigma_hit": 0.2, "do_beamskip": True}, 0.03),
        ({"laser_model_type": "beam", "laser_max_beams": 30, "max_particles": 500}, 0.06),
        ({"odom_model_type": "omni-corrected"}, 0.06),
        ({"odom_model_type": "diff"}, 0.06),
        ({"odom_model_type": "omni"}, 0.15),
        ({"selective_resampling": True}, 0.06),
        ({"resample_interval": 2, "laser_max_beams": 30}, 0.08),
    ],
)
def test_every_model_finds_its_way(changes: dict[str, object], limit: float) -> None:
    assert rms(follow(localizer(tuned(**changes)), points=CORRIDOR)[:, 0]) < limit


def test_the_tutorials_parameters_stay_in_the_room() -> None:
    tutorial = AmclParams(odom_model_type="diff-corrected", update_min_d=0.5, update_min_a=1.0)
    assert rms(follow(localizer(tutorial))[:, 0]) < 0.15


def test_a_wrong_start_is_mended() -> None:
    made = localizer()
    made.set_pose(Pose2D(0.4, -0.3, 0.2), np.diag([0.25, 0.25, 0.07]))
    assert follow(made, points=CORRIDOR)[-10:, 0].max() < 0.1


def test_people_in_the_way_do_not_lead_astray() -> None:
    made, rng = localizer(), np.random.default_rng(3)
    worst = 0.0
    for moment in drive(CORRIDOR):
        ranges = moment.scan.ranges.copy()
        first = int(rng.integers(0, 90))
        ranges[first : first + 30] = np.minimum(ranges[first : first + 30], 0.8)
        made.update(replace(moment.scan, ranges=ranges), moment.odometry, MOUNT)
        assert made.map_from_odom is not None
        worst = max(worst, error(compose(made.map_from_odom, moment.odometry), moment.truth)[0])
    assert worst < 0.3


def test_global_localisation_finds_the_room() -> None:
    made = localizer(
        AmclParams(odom_model_type="diff-corrected", laser_max_beams=60, update_min_d=0.1, max_particles=20000)
    )
    assert made.localize_globally()
    assert len(made.filter.poses) == 20000
    errors = follow(made)
    assert errors[-20:, 0].max() < 0.3


def test_the_same_drive_twice_is_the_same_bit_for_bit() -> None:
    np.testing.assert_array_equal(follow(localizer(), points=CORRIDOR), follow(localizer(), points=CORRIDOR))


def test_updates_wait_for_motion_along_one_axis_or_a_turn() -> None:
    made = localizer(AmclParams(update_min_d=0.2, update_min_a=0.5))
    scan = scan_at(Pose2D(), np.random.default_rng(0))
    assert made.update(scan, Pose2D(), MOUNT).estimate is not None
    assert not made.update(scan, Pose2D(0.19, 0.19, 0.4), MOUNT).updated  # 0.27 m, but less on each axis
    assert made.update(scan, Pose2D(0.21, 0.0, 0.0), MOUNT).updated
    assert made.update(scan, Pose2D(0.21, 0.0, 0.6), MOUNT).updated


def test_a_pose_comes_with_each_second_update() -> None:
    made = localizer(AmclParams(update_min_d=0.1, resample_interval=2))
    scan = scan_at(Pose2D(), np.random.default_rng(0))
    told = [made.update(scan, Pose2D(0.11 * i, 0.0, 0.0), MOUNT).estimate is not None for i in range(6)]
    assert told == [True, True, False, True, False, True]


def test_a_requested_update_needs_no_motion() -> None:
    made = localizer()
    scan = scan_at(Pose2D(), np.random.default_rng(0))
    made.update(scan, Pose2D(), MOUNT)
    assert not made.update(scan, Pose2D(), MOUNT).updated
    made.request_update()
    assert made.update(scan, Pose2D(), MOUNT).updated
    assert not made.update(scan, Pose2D(), MOUNT).updated


def test_without_a_map_nothing_happens() -> None:
    made = Localizer(AmclParams(), np.random.default_rng(0))
    outcome = made.update(scan_at(Pose2D(), np.random.default_rng(0)), Pose2D(), MOUNT)
    assert not outcome.updated
    assert not made.localize_globally()


def test_a_turned_map_is_refused_and_the_old_one_stays() -> None:
    made, grid = localizer(), house_map()
    with pytest.raises(MapError, match="turned"):
        made.set_map(Grid(replace(grid.info, yaw=0.3), grid.cells))
    assert made.update(scan_at(Pose2D(), np.random.default_rng(0)), Pose2D(), MOUNT).updated


@pytest.mark.parametrize(
    "info",
    [
        GridInfo(resolution=0.0, width=1, height=1),
        GridInfo(resolution=math.nan, width=1, height=1),
        GridInfo(resolution=0.05, width=0, height=0),
        GridInfo(resolution=0.05, width=1, height=1, origin_x=math.nan),
    ],
)
def test_a_map_that_makes_no_sense_is_refused(info: GridInfo) -> None:
    with pytest.raises(MapError, match="is invalid"):
        localizer().set_map(Grid(info, np.zeros(info.shape, dtype=np.int8)))


@pytest.mark.parametrize("value", [-1, 0, 100])
@pytest.mark.parametrize("model", ["likelihood_field", "likelihood_field_prob", "beam"])
def test_a_map_of_one_cell(value: int, model: str) -> None:
    cell = Grid(GridInfo(resolution=0.05, width=1, height=1), np.full((1, 1), value, dtype=np.int8))
    made = localizer(AmclParams(laser_model_type=model, max_particles=200), grid=cell)
    for i in range(4):
        made.update(scan_at(Pose2D(), np.random.default_rng(0)), Pose2D(0.3 * i, 0.0, 0.0), MOUNT)
    assert np.isfinite(made.filter.poses).all()
    assert made.localize_globally() == (value == 0)


@pytest.mark.parametrize("model", ["likelihood_field", "likelihood_field_prob", "beam"])
@pytest.mark.parametrize(
    "ranges", [[math.nan] * 9, [math.inf] * 9, [-math.inf] * 9, [0.0] * 9, [], [1.0], [1.0, math.nan]]
)
def test_scans_that_say_nothing_are_survived(model: str, ranges: list[float]) -> None:
    made = localizer(AmclParams(laser_model_type=model, max_particles=200))
    good = scan_at(Pose2D(), np.random.default_rng(0))
    for i in range(4):
        outcome = made.update(replace(good, ranges=np.array(ranges)), Pose2D(0.3 * i, 0.0, 0.0), MOUNT)
    numbers = [r for r in ranges if not math.isnan(r)]
    telling = numbers if model == "beam" else [r for r in numbers if 0.0 < r < math.inf]
    assert outcome.is_blind == (not telling)  # the beam model knows what it means that nothing was hit
    assert np.isfinite(made.filter.poses).all()
    assert made.update(good, Pose2D(1.2, 0.0, 0.0), MOUNT).updated


def test_the_number_of_beams_may_change() -> None:
    made, rng = localizer(), np.random.default_rng(0)
    for i, beams in enumerate([720, 90, 31, 2, 360]):
        at = Pose2D(0.25 * i, 0.0, 0.0)
        assert made.update(scan_at(at, rng, beams=beams), at, MOUNT).updated
    assert made.map_from_odom is not None
    away, turned = error(compose(made.map_from_odom, at), at)
    assert away < 0.05
    assert turned < 0.02


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"ranges": np.empty(0)}, "no beams"),
        ({"angle_increment": math.nan}, "angles make no sense"),
        ({"range_max": 0.0}, "bounds make no sense"),
        ({"range_max": math.nan}, "bounds make no sense"),
        ({}, ""),
    ],
)
def test_what_is_wrong_with_a_scan(changes: dict[str, object], says: str) -> None:
    scan = replace(scan_at(Pose2D(), np.random.default_rng(0)), **changes)  # type: ignore[arg-type]
    problem = scan_problem(scan)
    assert says in problem
    assert bool(problem) == bool(says)


def test_time_that_goes_back_is_no_motion(caplog: pytest.LogCaptureFixture) -> None:
    made, rng = localizer(), np.random.default_rng(0)
    made.update(scan_at(Pose2D(), rng, stamp=100.0), Pose2D(3.0, 0.0, 0.0), MOUNT)
    before = made.filter.poses.copy()
    with caplog.at_level(logging.WARNING, logger="rosbot_patrol"):
        outcome = made.update(scan_at(Pose2D(), rng, stamp=1.0), Pose2D(), MOUNT)
    assert "time went back by 99.000 s" in caplog.text
    assert not outcome.updated
    np.testing.assert_array_equal(made.filter.poses, before)
    assert made.map_from_odom is not None
    assert error(made.map_from_odom, Pose2D())[0] < 0.3  # the odometry began anew, the robot stayed


def test_an_odometry_that_jumps_is_no_motion(caplog: pytest.LogCaptureFixture) -> None:
    made, rng = localizer(), np.random.default_rng(0)
    made.update(scan_at(Pose2D(), rng, stamp=1.0), Pose2D(30.0, 0.0, 1.0), MOUNT)
    with caplog.at_level(logging.WARNING, logger="rosbot_patrol"):
        made.update(scan_at(Pose2D(), rng, stamp=1.1), Pose2D(), MOUNT)
    assert "the odometry jumped by 30.00 m" in caplog.text
    assert made.estimate is not None
    assert error(made.estimate.pose, Pose2D())[0] < 0.3


def test_a_laser_upside_down() -> None:
    made, rng = localizer(), np.random.default_rng(0)
    upright = scan_at(Pose2D(), rng)
    scan = replace(upright, ranges=upright.ranges[::-1].copy())
    pitched_over = Transform(MOUNT.x, MOUNT.y, 0.2, 0.0, 1.0, 0.0, 0.0)  # upside down, and backwards as MOUNT
    made.set_pose(Pose2D(), np.diag([0.04, 0.04, 0.01]))
    for i in range(20):
        made.request_update()
        level = level_scan(replace(scan, stamp=0.1 * i), pitched_over, "base_link")
        made.update(level.scan, Pose2D(), level.pose)
    assert made.estimate is not None
    assert error(made.estimate.pose, Pose2D())[0] < 0.05
