"""The critics one by one, and the kernels below them against slow and simple ways to the same figures."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from rosbot_patrol.costmap.footprint import Footprint, padded
from rosbot_patrol.geometry import STOP, Pose2D, Twist2D
from rosbot_patrol.grid import Grid, GridInfo
from rosbot_patrol.planning.critics import (
    SUDDEN,
    AlignmentCritic,
    AttractionCritic,
    FacingGoalCritic,
    GoalDistanceCritic,
    GoalFrontCritic,
    HeadingCritic,
    Motion,
    ObstacleCritic,
    OscillationCritic,
    PathDistanceCritic,
    Situation,
    TwirlingCritic,
    critic_kernels,
    distances_from,
    shrink,
    sweep_kernels,
)

CORNERS = np.array([[0.12, 0.14], [0.12, -0.14], [-0.12, -0.14], [-0.12, 0.14]])
INFO = GridInfo(resolution=0.05, width=60, height=60, origin_x=-1.5, origin_y=-1.5)


def free():
    return np.zeros(INFO.shape, np.uint8)


def situation(ends, *, cells=None, goal=(1.0, 0.0), nose=0.3, samples=None):
    coarse = Grid(INFO, free() if cells is None else cells)
    x = np.linspace(0.0, goal[0], 21)
    plan = np.column_stack((x, np.linspace(0.0, goal[1], 21), np.zeros(21)))
    return Situation(
        pose=Pose2D(),
        samples=np.zeros((len(ends), 3)) if samples is None else samples,
        ends=np.array(ends, dtype=np.float64),
        coarse=coarse,
        plan=plan,
        nose=nose,
        goal_field=distances_from(coarse, plan[-1:, :2]),
    )


def test_distance_to_the_plan():
    found = PathDistanceCritic().score(situation([(0.5, 0.0, 0.0), (0.5, 0.3, 1.0), (0.2, -0.5, 0.0)]))
    assert found == pytest.approx([0.0, 0.3, 0.5], abs=0.04)


def test_alignment_looks_ahead_of_the_end():
    found = AlignmentCritic().score(situation([(0.3, 0.0, 0.0), (0.3, 0.0, math.pi / 2)]))
    assert found == pytest.approx([0.0, 0.3], abs=0.04)


def test_distance_to_the_goal_is_exact_near_it():
    found = GoalDistanceCritic().score(situation([(0.0, 0.0, 0.0), (0.99, 0.0, 0.0), (1.0, 0.03, 0.0)]))
    assert found == pytest.approx([1.0, 0.01, 0.03], abs=0.02)
    assert found[1:] == pytest.approx([0.01, 0.03], abs=1e-6)


def test_distance_to_the_goal_leads_round_a_wall():
    cells = free()
    cells[: INFO.cell_of(0.0, 0.75)[1], INFO.cell_of(0.5, 0.0)[0]] = 254
    assert GoalDistanceCritic().score(situation([(0.0, 0.0, 0.0)], cells=cells))[0] == pytest.approx(1.9, abs=0.1)
    cells[:, INFO.cell_of(0.5, 0.0)[0]] = 254
    assert np.isinf(GoalDistanceCritic().score(situation([(0.0, 0.0, 0.0)], cells=cells))[0])


def test_facing_the_goal():
    ends = [(0.3, 0.0, 0.0), (0.3, 0.0, math.pi)]
    assert FacingGoalCritic().score(situation(ends)) == pytest.approx([0.4, 1.0], abs=0.03)
    # upstream moves the goal away by as much as the nose is ahead, so that facing it costs no more than being there
    assert GoalFrontCritic().score(situation(ends)) == pytest.approx([0.7, 1.3], abs=0.03)


def test_the_goal_is_not_moved_into_a_wall():
    cells = free()
    cells[:, INFO.cell_of(1.12, 0.0)[0]] = 254
    found = GoalFrontCritic().score(situation([(0.3, 0.0, 0.0)], cells=cells))
    assert found[0] == pytest.approx(1.1 - 0.6, abs=0.06)


def test_attraction_is_the_square_of_the_distance():
    assert AttractionCritic().score(situation([(0.5, 0.0, 0.0), (1.0, 1.0, 0.0)])) == pytest.approx([0.25, 1.0])


def test_heading_for_what_is_seen_of_the_plan():
    ends = [(0.0, 0.0, 0.0), (0.0, 0.0, 0.5), (0.5, 0.5, 0.0)]
    assert HeadingCritic().score(situation(ends)) == pytest.approx([0.0, 0.5, math.pi / 4], abs=0.02)
    cells = free()
    cells[:, INFO.cell_of(0.6, 0.0)[0]] = 254  # the end of the plan is hidden: what lies before it counts
    assert HeadingCritic().score(situation([(0.3, 0.4, 0.0)], cells=cells))[0] > 0.9


def test_twirling_is_the_turning_speed():
    samples = np.array([[0.1, 0.0, -0.7], [0.0, 0.1, 0.2]])
    assert TwirlingCritic().score(situation([(0, 0, 0), (0, 0, 0)], samples=samples)).tolist() == [0.7, 0.2]


def test_a_direction_given_up_is_forbidden_until_the_robot_has_moved():
    critic, limits = OscillationCritic(), {"still": 0.05, "distance": 0.1, "angle": 0.5}
    left, right = Twist2D(0.0, 0.0, 0.5), Twist2D(0.0, 0.0, -0.5)
    samples = np.array([left, right, Twist2D(0.2, 0.0, 0.5)])
    critic.remember(Pose2D(), left, **limits)
    assert not critic.forbidden(samples).any()
    critic.remember(Pose2D(), right, **limits)
    assert critic.forbidden(samples).tolist() == [True, False, True]
    critic.remember(Pose2D(0.05, 0.0, 0.0), right, **limits)
    assert critic.forbidden(samples).any()
    critic.remember(Pose2D(0.2, 0.0, 0.0), right, **limits)
    assert not critic.forbidden(samples).any()


def test_turns_while_driving_are_no_oscillation():
    critic, limits = OscillationCritic(), {"still": 0.05, "distance": 0.1, "angle": 0.5}
    for sign in (1.0, -1.0, 1.0, -1.0):
        critic.remember(Pose2D(), Twist2D(0.2, 0.0, sign), **limits)
    assert not critic.forbidden(np.array([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]])).any()


# ---- obstacles


def obstacles(padding=0.01, resolution=0.05):
    return ObstacleCritic(Footprint(padded(CORNERS, padding), CORNERS), resolution=resolution)


def cost(critic, cells, twist, pose=Pose2D(), velocity=STOP, **changes):  # noqa: B008 - a tuple
    motion = replace(Motion(horizon=1.0, accelerations=SUDDEN), **changes)
    samples = np.array([twist], dtype=np.float64)
    grid = Grid(INFO, cells)
    around = critic.survey(grid, pose, motion.reach(samples, velocity))
    return critic.drive(around, velocity, samples, motion)[0]


def test_the_highest_cost_on_the_way_counts():
    cells = free()
    cells[:, INFO.cell_of(0.2, 0.0)[0]] = 77
    cells[:, INFO.cell_of(0.8, 0.0)[0]] = 99
    assert cost(obstacles(), cells, (0.5, 0.0, 0.0)) == 77.0
    assert cost(obstacles(), cells, (0.1, 0.0, 0.0)) == 0.0


def test_a_thin_thing_between_two_steps_is_seen():
    """A single cell that the front edge jumps over from step to step, off the centre's way."""
    for x in np.arange(0.2, 0.6, 0.05):
        cells = free()
        ix, iy = INFO.cell_of(float(x) + 0.01, 0.11)
        cells[iy, ix] = 254
        assert np.isinf(cost(obstacles(), cells, (0.6, 0.0, 0.0), granularity=0.5)), x


@pytest.mark.parametrize(("acceleration", "is_free"), [(5.0, True), (0.1, False)])
def test_a_velocity_needs_room_to_brake(acceleration, is_free):
    cells = free()
    cells[:, INFO.cell_of(0.52, 0.0)[0]] = 254
    found = cost(obstacles(), cells, (0.3, 0.0, 0.0), accelerations=(acceleration, 0.0, 3.0), is_held=True)
    assert np.isfinite(found) == is_free


def test_time_to_spare_when_braking():
    cells = free()
    cells[:, INFO.cell_of(0.7, 0.0)[0]] = 254
    assert np.isfinite(cost(obstacles(), cells, (0.3, 0.0, 0.0), stop_time_buffer=0.2))
    assert np.isinf(cost(obstacles(), cells, (0.3, 0.0, 0.0), stop_time_buffer=2.0))


def test_a_fast_robot_is_broader():
    cells = free()
    cells[INFO.cell_of(0.0, 0.171)[1]] = 254
    growing = (0.25, 0.5, 0.5)
    assert np.isfinite(cost(obstacles(), cells, (0.2, 0.0, 0.0), growing=growing))
    assert np.isinf(cost(obstacles(), cells, (0.5, 0.0, 0.0), growing=growing))


def test_sideways_is_checked_sideways():
    cells = free()
    cells[INFO.cell_of(0.0, 0.3)[1]] = 254
    assert np.isinf(cost(obstacles(), cells, (0.0, 0.3, 0.0)))
    assert np.isfinite(cost(obstacles(), cells, (0.0, -0.3, 0.0)))
    assert np.isfinite(cost(obstacles(), cells, (0.3, 0.0, 0.0)))


def test_the_edge_of_the_costmap_is_an_obstacle():
    assert np.isinf(cost(obstacles(), free(), (0.5, 0.0, 0.0), pose=Pose2D(1.1, 0.0, 0.0)))
    assert np.isfinite(cost(obstacles(), free(), (-0.3, 0.0, 0.0), pose=Pose2D(1.1, 0.0, 0.0)))


@pytest.mark.parametrize("seed", range(5))
def test_clearances_are_exact(seed):
    random = np.random.default_rng(seed)
    cells = np.where(random.random((40, 50)) < 0.01, 254 + random.integers(0, 2, (40, 50)), 100).astype(np.uint8)
    x0, y0, x1, y1 = 7, 5, 45, 40
    found = sweep_kernels.clearances(cells, x0, y0, x1, y1, 9)
    iy, ix = np.nonzero(cells[y0:y1, x0:x1] >= 254)
    y, x = np.mgrid[y0:y1, x0:x1]
    far = np.full(found.shape, 9.0)
    for a, b in zip(ix + x0, iy + y0, strict=True):
        far = np.minimum(far, np.hypot(x - a, y - b))
    far = np.minimum(far, np.minimum(np.minimum(x + 1, 50 - x), np.minimum(y + 1, 40 - y)))
    assert found == pytest.approx(far, abs=1e-5)


@pytest.mark.parametrize("factor", [2, 3, 5])
def test_blocks_have_their_highest_cost(factor):
    cells = np.random.default_rng(factor).integers(0, 256, (31, 42)).astype(np.uint8)
    found = critic_kernels.shrink(cells, factor)
    assert found.shape == (math.ceil(31 / factor), math.ceil(42 / factor))
    for iy, ix in np.ndindex(*found.shape):
        assert found[iy, ix] == cells[iy * factor : (iy + 1) * factor, ix * factor : (ix + 1) * factor].max()
    grid = shrink(Grid(GridInfo(resolution=0.01, width=42, height=31), cells))
    assert grid.info.resolution == pytest.approx(0.05)


def test_the_field_spreads_evenly_from_a_point():
    field = distances_from(Grid(INFO, free()), np.array([[0.013, -0.021]]))
    y, x = np.mgrid[:60, :60]
    true = np.hypot(-1.475 + 0.05 * x - 0.013, -1.475 + 0.05 * y + 0.021) / 0.05
    assert np.abs(field - true).max() < 1.5  # first-order differences, over 42 cells
    assert np.abs(field - true)[28:32, 28:32].max() < 0.4
