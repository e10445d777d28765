"""Whether the estimate is to be believed, and the search where it is not."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
import yaml
from house_run import MOUNT, ROOT, Moment, drive, error, house_map, scan_at

from rosbot_patrol import params
from rosbot_patrol.amcl.localizer import Localizer
from rosbot_patrol.amcl.parameters import AmclParams
from rosbot_patrol.amcl.particles.particle_filter import Estimate
from rosbot_patrol.amcl.scan_model.floor import Floor
from rosbot_patrol.amcl.scan_model.known_map import KnownMap
from rosbot_patrol.amcl.scan_model.sensor_model import pick_beams
from rosbot_patrol.amcl.trust import State, Witness, agreement
from rosbot_patrol.geometry import Pose2D, compose, invert
from rosbot_patrol.grid import Grid

AWAY = [(-0.6, 2.5), (-1.2, 4.8)]
SURE = Estimate(
    pose=Pose2D(), covariance=np.diag([1e-3, 1e-3, 1e-3]), cluster_weight=1.0, cluster_spread=0.05, particles=100
)


@lru_cache(maxsize=1)
def corridor_drive() -> list[Moment]:
    return list(drive(AWAY))


def tuned(**changes: object) -> AmclParams:
    with (ROOT / "config" / "tuned" / "amcl.yaml").open() as file:
        return params.load(AmclParams, yaml.safe_load(file) | changes)


def localizer(parameters: AmclParams | None = None, *, seed: int = 0) -> Localizer:
    made = Localizer(parameters or tuned(), np.random.default_rng(seed))
    made.set_map(house_map())
    return made


def off(made: Localizer, moment: Moment) -> float:
    assert made.map_from_odom is not None
    return error(compose(made.map_from_odom, moment.odometry), moment.truth)[0]


def agreement_of(true: Pose2D, believed: Pose2D, *, short: float = 0.0) -> float | None:
    rng = np.random.default_rng(0)
    scan = scan_at(true, rng)
    blocked = rng.random(len(scan.ranges)) < short
    scan = replace(scan, ranges=np.where(blocked, np.minimum(scan.ranges, 0.5), scan.ranges))
    known = KnownMap(house_map(), tuned(), rng)
    return agreement(believed, pick_beams(scan, MOUNT, tuned()), known.obstacles)


@pytest.mark.parametrize("place", [(0.0, 0.0), (-1.2, 4.8), (2.7, 7.35), (-4.0, 4.0), (14.75, 11.48)])
def test_right_poses_agree_and_wrong_ones_do_not(place: tuple[float, float]) -> None:
    true = Pose2D(*place, 0.7)
    right = agreement_of(true, true)
    assert right is not None
    assert right > 0.9
    for wrong in (compose(true, Pose2D(1.5, 0.5, 0.0)), compose(true, Pose2D(0.0, 0.0, 2.0))):
        found = agreement_of(true, wrong)
        assert found is not None
        assert found < 0.45


def test_people_about_it_do_not_make_it_lost() -> None:
    found = agreement_of(Pose2D(), Pose2D(), short=0.5)
    assert found is not None
    assert 0.55 < found < 0.8


def test_a_scan_without_beams_is_no_witness() -> None:
    rng = np.random.default_rng(0)
    scan = scan_at(Pose2D(), rng)
    known = KnownMap(house_map(), tuned(), rng)
    nothing = pick_beams(replace(scan, ranges=np.full(120, np.nan)), MOUNT, tuned())
    assert agreement(Pose2D(), nothing, known.obstacles) is None


def test_states_and_their_hysteresis() -> None:
    witness = Witness(lost_below=0.45, sure_above=0.6)
    assert witness.trust.state is State.UNKNOWN
    assert witness.hear(0.0, None, SURE).state is State.UNKNOWN
    assert witness.hear(0.2, 0.9, SURE).state is State.LOCALISED
    assert witness.hear(0.4, 0.1, SURE).state is State.LOCALISED  # one scan does not decide
    said = [witness.hear(0.4 + 0.2 * i, 0.1, SURE).state for i in range(1, 20)]
    assert said[-1] is State.LOST
    assert "contradict the map" in witness.trust.reason
    assert witness.hear(60.0, 0.5, SURE).state is State.LOST  # above lost_below, but not sure yet
    assert witness.hear(120.0, 0.7, SURE).state is State.LOCALISED
    for doubt in ({"cluster_spread": 1.5}, {"cluster_weight": 0.4}):
        assert witness.hear(121.0, 0.7, replace(SURE, **doubt)).state is State.UNSURE
    witness.forget()
    assert witness.trust.state is State.UNKNOWN


def test_a_patrol_is_believed_and_nothing_is_searched() -> None:
    made = localizer()
    for moment in corridor_drive():
        made.update(moment.scan, moment.odometry, MOUNT)
        assert made.trust.state is State.LOCALISED
        assert not made.is_seeking
    assert made.trust.belief > 0.9


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_wrong_start_is_noticed_and_the_robot_found(seed: int) -> None:
    made = localizer(seed=seed)
    made.set_pose(Pose2D(14.75, 11.48, 1.0), np.diag([0.01, 0.01, 0.005]))
    states, found = set(), 0
    for moment in corridor_drive():
        found += made.update(moment.scan, moment.odometry, MOUNT).is_found
        states.add(made.trust.state)
    assert State.LOST in states
    assert found == 1
    assert off(made, moment) < 0.1
    assert made.trust.state is State.LOCALISED
    assert not made.is_seeking


def kidnapped() -> list[Moment]:
    """Carried in mid-drive to the other end and turned about, while clock and odometry notice nothing."""
    before, after = corridor_drive()[:40], list(drive([(2.7, 7.35)], start=Pose2D(-4.0, 4.0, 2.2), seed=3))
    shift = compose(before[-1].odometry, invert(after[0].odometry))
    stamp = before[-1].scan.stamp + 0.2
    return before + [
        Moment(m.truth, compose(shift, m.odometry), replace(m.scan, stamp=m.scan.stamp + stamp)) for m in after
    ]


@pytest.mark.parametrize(
    "parameters", [tuned(), AmclParams(odom_model_type="diff-corrected", update_min_d=0.5, update_min_a=1.0)]
)
def test_a_kidnapped_robot_is_found(parameters: AmclParams) -> None:
    made = localizer(parameters)
    for moment in kidnapped():
        made.update(moment.scan, moment.odometry, MOUNT)
    assert off(made, moment) < 0.2
    assert made.trust.state is State.LOCALISED


def slipping(start: Pose2D, rate: tuple[float, float]) -> list[Moment]:
    """Wheels that turn for six seconds while the robot stands, jammed [m/s, rad/s], and then a drive."""
    rng, found, odometry = np.random.default_rng(5), [], Pose2D()
    for i in range(30):
        found.append(Moment(start, odometry, scan_at(start, rng, stamp=0.2 * i)))
        odometry = compose(odometry, Pose2D(0.2 * rate[0], 0.0, 0.2 * rate[1]))
    after = list(drive(AWAY, start=start, seed=3))
    shift = compose(odometry, invert(after[0].odometry))
    return found + [
        Moment(m.truth, compose(shift, m.odometry), replace(m.scan, stamp=m.scan.stamp + 6.0)) for m in after
    ]


@pytest.mark.parametrize("rate", [(0.0, 1.0), (0.2, 0.0), (0.1, 0.6)])
@pytest.mark.parametrize("seed", [0, 1])
def test_wheels_that_slip_do_not_make_the_estimate_jump_about(rate: tuple[float, float], seed: int) -> None:
    made = localizer(seed=seed)
    made.set_pose(Pose2D(), np.diag([0.001, 0.001, 0.001]))
    worst = 0.0
    for moment in slipping(Pose2D(), rate):
        made.update(moment.scan, moment.odometry, MOUNT)
        worst = max(worst, off(made, moment))
    assert worst < 0.6 + 6.0 * rate[0]  # as far as the wheels went, at most
    assert off(made, moment) < 0.1
    assert made.trust.state is State.LOCALISED


def test_a_search_repeats_bit_for_bit() -> None:
    ways = []
    for _ in range(2):
        made = localizer()
        for moment in kidnapped():
            made.update(moment.scan, moment.odometry, MOUNT)
        ways.append(made.filter.poses)
    np.testing.assert_array_equal(*ways)


def test_global_localisation_is_quick_with_few_particles() -> None:
    made = localizer(tuned(max_particles=500, min_particles=100))
    assert made.localize_globally()
    assert made.is_seeking
    for moment in corridor_drive():
        made.update(moment.scan, moment.odometry, MOUNT)
    assert off(made, moment) < 0.1


@pytest.mark.parametrize("seek", ["never", "asked", "lost"])
def test_when_to_search_is_a_parameter(seek: str) -> None:
    made = localizer(tuned(seek=seek))
    assert made.seek() == (seek != "never")
    made.set_pose(Pose2D(14.75, 11.48, 1.0), np.diag([0.01, 0.01, 0.005]))
    searched = False
    for moment in corridor_drive()[:30]:
        made.update(moment.scan, moment.odometry, MOUNT)
        searched |= made.is_seeking
    assert searched == (seek == "lost")


def test_a_search_that_was_asked_for_ends_where_the_robot_is() -> None:
    made = localizer()
    found = []
    for i, moment in enumerate(corridor_drive()):
        if i == 10:
            assert made.seek()
        if made.update(moment.scan, moment.odometry, MOUNT).is_found:
            found.append(off(made, moment))
    assert len(found) == 1
    assert found[0] < 0.2


def test_without_free_floor_nothing_is_searched() -> None:
    made, grid = localizer(), house_map()
    assert not Localizer(tuned(), np.random.default_rng(0)).seek()
    made.set_map(Grid(grid.info, np.where(grid.cells == 0, -1, grid.cells).astype(np.int8)))
    assert not made.seek()
    for moment in corridor_drive()[:10]:
        made.update(moment.scan, moment.odometry, MOUNT)
    assert not made.is_seeking


def test_random_poses_are_on_free_floor() -> None:
    grid = house_map()
    floor = Floor(grid, np.random.default_rng(0))
    poses = floor.random_poses(500)
    cells = [grid.cells[grid.info.cell_of(x, y)[::-1]] for x, y in poses[:, :2].tolist()]
    assert set(cells) == {0}
    assert np.abs(poses[:, 2]).max() <= math.pi
    assert floor.area == pytest.approx((grid.cells == 0).sum() * 0.0025)


def test_the_likely_poses_are_near_the_true_one() -> None:
    rng = np.random.default_rng(0)
    true = Pose2D(14.75, 11.48, 1.0)
    known = KnownMap(house_map(), tuned(), rng)
    beams = pick_beams(scan_at(true, rng), MOUNT, tuned())
    poses = known.floor.likely_poses(known.wide, beams, tried=50_000, count=1000)
    assert poses.shape == (1000, 3)
    assert (np.hypot(poses[:, 0] - true.x, poses[:, 1] - true.y) < 0.7).mean() > 0.2


def test_parameters_change_while_it_runs() -> None:
    made = localizer()
    for i, moment in enumerate(corridor_drive()):
        if i == 20:
            made.reconfigure(tuned(laser_model_type="likelihood_field_prob", laser_sigma_hit=0.2, max_particles=800))
        made.update(moment.scan, moment.odometry, MOUNT)
    assert len(made.filter.poses) <= 800
    assert off(made, moment) < 0.1
