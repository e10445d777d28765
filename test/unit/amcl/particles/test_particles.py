"""Motion, resampling, clusters and the sensor models, each by itself."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from house_run import MOUNT, house_map, scan_at

from rosbot_patrol.amcl.motion_model import MOTION_MODELS, OdometryNoise, move_particles
from rosbot_patrol.amcl.parameters import AmclParams
from rosbot_patrol.amcl.particles import resample_kernels
from rosbot_patrol.amcl.particles.kld import KldRule
from rosbot_patrol.amcl.particles.particle_filter import ParticleFilter
from rosbot_patrol.amcl.scan_model import field_kernels
from rosbot_patrol.amcl.scan_model.likelihood_field import blocked_distances
from rosbot_patrol.amcl.scan_model.sensor_model import MODELS, Weighing, pick_beams
from rosbot_patrol.geometry import Pose2D, compose, invert
from rosbot_patrol.grid import Grid, GridInfo

EXACT = OdometryNoise(alpha1=0.0, alpha2=0.0, alpha3=0.0, alpha4=0.0, alpha5=0.0)


def particle_filter(rule: KldRule = KldRule(least=100, most=2000), **alphas: float) -> ParticleFilter:  # noqa: B008
    options = {"alpha_slow": 0.0, "alpha_fast": 0.0} | alphas
    return ParticleFilter(rule, rng=np.random.default_rng(0), **options)


@pytest.mark.parametrize("name", MOTION_MODELS)
@pytest.mark.parametrize(
    "end", [Pose2D(3.0, 1.0, 2.0), Pose2D(1.9, 2.5, -3.0), Pose2D(1.0, 2.0, 1.5), Pose2D(1, 2, 0.5)]
)
def test_exact_odometry_moves_each_particle_alike(name: str, end: Pose2D) -> None:
    start = Pose2D(1.0, 2.0, 0.5)
    poses = np.array([[0.0, 0.0, 0.0], [5.0, -1.0, 3.0]])
    move_particles(poses, start, end, name, EXACT, rng=np.random.default_rng(0))
    for row, before in zip(poses, [Pose2D(0, 0, 0), Pose2D(5.0, -1.0, 3.0)], strict=True):
        expected = compose(before, compose(invert(start), end))
        np.testing.assert_allclose(row[:2], expected[:2], atol=1e-9)
        assert math.cos(row[2] - expected.yaw) == pytest.approx(1.0)


@pytest.mark.parametrize(("name", "spread"), [("diff-corrected", math.sqrt(0.2) * 0.5), ("diff", 0.2 * 0.25)])
def test_the_spread_of_a_drive(name: str, spread: float) -> None:
    poses = np.zeros((20000, 3))
    noise = OdometryNoise(alpha1=0.0, alpha2=0.0, alpha3=0.2, alpha4=0.0)
    move_particles(poses, Pose2D(), Pose2D(0.5, 0.0, 0.0), name, noise, rng=np.random.default_rng(0))
    assert poses[:, 0].std() == pytest.approx(spread, rel=0.03)
    assert poses[:, 1].std() < 1e-9


def test_driving_backwards_is_no_half_turn() -> None:
    poses = np.zeros((5000, 3))
    noise = OdometryNoise(alpha1=0.2, alpha2=0.0, alpha3=0.0, alpha4=0.0)
    move_particles(poses, Pose2D(), Pose2D(-0.5, 0.0, 0.0), "diff-corrected", noise, rng=np.random.default_rng(0))
    assert np.abs(poses[:, 2]).max() < 1e-6


def test_a_turn_on_the_spot_does_not_move() -> None:
    poses = np.zeros((5000, 3))
    noise = OdometryNoise(alpha1=0.2, alpha2=0.2, alpha3=0.2, alpha4=0.0)
    move_particles(poses, Pose2D(), Pose2D(0.0, 0.0, 1.0), "diff-corrected", noise, rng=np.random.default_rng(0))
    assert np.abs(poses[:, :2]).max() < 1e-9
    assert poses[:, 2].std() == pytest.approx(math.sqrt(0.2), rel=0.05)


def test_kld_sizes() -> None:
    rule = KldRule(least=100, most=5000, error=0.01, z=0.99)
    sizes = [rule.size(k) for k in (1, 2, 10, 40, 100, 1000)]
    assert sizes == sorted(sizes)
    assert sizes[0] == 100
    assert sizes[-1] == 5000
    # Fox 2003, equation 7: (k - 1) / (2 e) (1 - 2 / 9(k - 1) + sqrt(2 / 9(k - 1)) z)^3 for k = 40
    b = 2.0 / (9.0 * 39.0)
    assert rule.size(40) == math.ceil(39.0 / 0.02 * (1.0 - b + math.sqrt(b) * 0.99) ** 3)


def test_draws_follow_the_weights() -> None:
    poses = np.zeros((4, 3))
    poses[:, 0] = [0.0, 1.0, 2.0, 3.0]
    cumulative = np.cumsum([0.1, 0.0, 0.6, 0.3])
    out = np.empty((1000, 3))
    count = resample_kernels.draw(poses, cumulative, 0.3, np.empty((0, 3)), 1e-9, 0.99, 1000, 1000, out)
    assert count == 1000
    np.testing.assert_allclose([(out[:, 0] == x).mean() for x in range(4)], [0.1, 0.0, 0.6, 0.3], atol=0.005)


def test_few_bins_ask_for_few_particles() -> None:
    narrow, wide = particle_filter(), particle_filter()
    narrow.spread_about(Pose2D(0.25, 0.25, 0.08), np.diag([1e-4, 1e-4, 1e-5]))
    wide.spread_about(Pose2D(), np.diag([4.0, 4.0, 3.0]))
    for made in (narrow, wide):
        made.resample(lambda count: np.zeros((count, 3)))
    assert len(narrow.poses) == 100
    assert len(wide.poses) == 2000


def test_the_heavier_of_two_clusters_is_the_pose_but_both_are_the_spread() -> None:
    made = particle_filter()
    rng = np.random.default_rng(0)
    near = rng.normal(0.0, 0.05, (300, 3))
    far = rng.normal(0.0, 0.05, (100, 3)) + np.array([10.0, 0.0, 0.0])
    made.set_particles(np.concatenate([near, far]))
    found = made.estimate()
    assert found.cluster_weight == pytest.approx(0.75)
    assert abs(found.pose.x) < 0.02
    assert found.covariance[0, 0] == pytest.approx(0.75 * 0.25 * 100.0, rel=0.02)


def test_headings_about_half_a_turn_are_one_cluster() -> None:
    made = particle_filter()
    yaw = np.array([math.pi - 0.05, -math.pi + 0.05, math.pi - 0.01, -math.pi + 0.01])
    made.set_particles(np.column_stack([np.zeros(4), np.zeros(4), yaw]))
    found = made.estimate()
    assert found.cluster_weight == 1.0
    assert abs(abs(found.pose.yaw) - math.pi) < 1e-6
    assert found.covariance[2, 2] < 0.01


def test_random_poses_come_in_when_the_fit_falls() -> None:
    made = particle_filter(alpha_slow=0.001, alpha_fast=0.5)
    made.spread_about(Pose2D(), np.diag([0.01, 0.01, 0.001]))
    for fit in (0.8, 0.8, 0.1, 0.1):
        made.weigh(Weighing(np.ones(2000), np.full(2000, fit), np.zeros(2000)))
    assert made.stranger_share > 0.5
    made.resample(lambda count: np.full((count, 3), 50.0))
    assert 0.3 < (made.poses[:, 0] == 50.0).mean() < 0.9
    assert made.stranger_share == 0.0


def test_weights_that_all_vanish_are_levelled() -> None:
    made = particle_filter()
    made.spread_about(Pose2D(), np.eye(3))
    made.weigh(Weighing(np.zeros(2000), np.zeros(2000), np.zeros(2000)))
    np.testing.assert_allclose(made.weights, 1.0 / 2000.0)


def test_a_start_with_a_broken_covariance_is_clipped() -> None:
    made = particle_filter()
    made.spread_about(Pose2D(1.0, 2.0, 0.0), np.diag([-1.0, 0.0, 0.0]))
    np.testing.assert_allclose(made.poses[:, 0], 1.0)


def test_rays_end_at_walls() -> None:
    cells = np.zeros((40, 40), dtype=np.int8)
    cells[:, 30] = 100
    field = blocked_distances(Grid(GridInfo(resolution=0.1, width=40, height=40), cells), 1.0)
    place = (field.values, field.origin_x, field.origin_y, field.resolution, 10.0)
    assert field_kernels.cast_ray(1.0, 2.05, 0.0, *place) == pytest.approx(2.0, abs=0.03)
    assert field_kernels.cast_ray(1.0, 2.05, math.pi, *place) == 10.0
    assert field_kernels.cast_ray(1.0, 1.05, math.pi / 4.0, *place) == pytest.approx(2.0 * math.sqrt(2.0), abs=0.05)


@pytest.mark.parametrize("name", MODELS)
def test_the_true_pose_is_the_likeliest(name: str) -> None:
    parameters = AmclParams(laser_model_type=name, laser_max_beams=60)
    model = MODELS[name](house_map(), parameters)
    beams = pick_beams(scan_at(Pose2D(), np.random.default_rng(0)), MOUNT, parameters)
    poses = np.array([[0.0, 0.0, 0.0], [0.3, 0.0, 0.0], [0.0, -0.3, 0.0], [0.0, 0.0, 0.3], [-3.5, 0.3, 0.0]])
    weighing = model.weigh(poses, beams)
    assert weighing is not None
    assert weighing.likelihood.argmax() == 0
    assert weighing.fit.argmax() == 0
    assert (weighing.fit > 0.0).all()
    assert (weighing.fit <= 1.2).all()


def test_beams_are_spread_evenly_and_readings_sorted() -> None:
    scan = scan_at(Pose2D(), np.random.default_rng(0), beams=9)
    ranges = np.array([1.0, 0.1, np.nan, np.inf, 13.0, -1.0, 2.0, 12.0, 3.0])
    beams = pick_beams(type(scan)(**{**scan.__dict__, "ranges": ranges}), MOUNT, AmclParams(laser_max_beams=9))
    assert len(beams.xs) == 3
    assert beams.ranges.tolist() == [1.0, 12.0, 12.0, 12.0, 12.0, 2.0, 12.0, 3.0]
    assert len(pick_beams(scan_at(Pose2D(), np.random.default_rng(0), beams=720), MOUNT, AmclParams()).ranges) == 30


@pytest.mark.parametrize("limit", [math.inf, float(np.finfo(np.float32).max)])
@pytest.mark.parametrize("name", MODELS)
def test_a_scan_without_an_upper_limit_finds_the_true_pose(name: str, limit: float) -> None:
    parameters = AmclParams(laser_model_type=name, laser_max_beams=60)
    scan = replace(scan_at(Pose2D(), np.random.default_rng(0)), range_max=limit)
    beams = pick_beams(scan, MOUNT, parameters)
    assert beams.reach == 100.0
    assert pick_beams(scan, MOUNT, replace(parameters, laser_max_range=9.0)).reach == 9.0
    weighing = MODELS[name](house_map(), parameters).weigh(np.array([[0.0, 0.0, 0.0], [0.3, 0.0, 0.0]]), beams)
    assert weighing is not None
    assert weighing.likelihood.argmax() == 0
    assert np.isfinite(weighing.likelihood).all()
    assert (weighing.likelihood > 0.0).all()


def test_upstreams_range_parameters() -> None:
    scan = scan_at(Pose2D(), np.random.default_rng(0), beams=5)
    short = pick_beams(
        type(scan)(**{**scan.__dict__, "ranges": np.array([0.5, 1.0, 2.0, 3.0, 4.0])}),
        MOUNT,
        AmclParams(laser_min_range=0.7, laser_max_range=3.5),
    )
    assert short.reach == 3.5
    assert len(short.xs) == 3
