"""The local planner on small costmaps, and in a closed loop with a unicycle."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rosbot_patrol.costmap.footprint import Footprint, padded
from rosbot_patrol.errors import ControlError, ParamError
from rosbot_patrol.geometry import STOP, Pose2D, Twist2D, wrap_angle
from rosbot_patrol.grid import Grid, GridInfo
from rosbot_patrol.params import load
from rosbot_patrol.planning.global_planners.navfn import with_headings
from rosbot_patrol.planning.interfaces import LocalView
from rosbot_patrol.planning.local_planners.trajectory_params import TrajectoryPlannerParams
from rosbot_patrol.planning.local_planners.trajectory_planner import TrajectoryPlanner

CORNERS = np.array([[0.12, 0.14], [0.12, -0.14], [-0.12, -0.14], [-0.12, 0.14]])
ORIGIN = Pose2D()
INFO = GridInfo(resolution=0.05, width=80, height=80, origin_x=-2.0, origin_y=-2.0)


def make(**changes):
    values = {
        "max_vel_x": 0.36,
        "min_vel_x": 0.04,
        "meter_scoring": True,
        "vx_samples": 8,
        "vtheta_samples": 12,
        "path_distance_bias": 0.6,
        "occdist_scale": 0.002,
        "controller_frequency": 10.0,
        "latch_xy_goal_tolerance": True,
        "rot_stopped_velocity": 0.05,
        "trans_stopped_velocity": 0.03,
        "holonomic_robot": False,
        **changes,
    }
    return TrajectoryPlanner(
        TrajectoryPlannerParams(**values), Footprint(padded(CORNERS, 0.03), CORNERS), resolution=0.05
    )


def line(x0, y0, x1, y1, yaw=0.0):
    t = np.linspace(0.0, 1.0, max(2, round(math.dist((x0, y0), (x1, y1)) / 0.05)))[:, None]
    return with_headings(np.array([x0, y0]) * (1 - t) + np.array([x1, y1]) * t, yaw)


def view(pose=ORIGIN, velocity=STOP, cells=None, now=0.0):
    cells = np.zeros(INFO.shape, np.uint8) if cells is None else cells.copy()
    return LocalView(now=now, pose=pose, velocity=velocity, costmap=Grid(INFO, cells))


def block(cells, x0, y0, x1, y1):
    a, b = INFO.cell_of(x0, y0), INFO.cell_of(x1, y1)
    cells[a[1] : b[1] + 1, a[0] : b[0] + 1] = 254
    return cells


def empty():
    return np.zeros(INFO.shape, np.uint8)


def drive(planner, pose, cells=None, seconds=30.0):
    """Where it is after driving to the goal, and the poses on the way."""
    velocity, poses = STOP, [pose]
    for _ in range(round(seconds / 0.1)):
        seen = view(pose, velocity, cells)
        if planner.is_goal_reached(seen):
            break
        try:
            twist = planner.compute(seen)
        except ControlError:
            twist = STOP  # as the navigator does
        velocity = Twist2D(twist.vx, 0.0, twist.wz)
        middle = pose.yaw + twist.wz * 0.05
        pose = Pose2D(
            pose.x + twist.vx * math.cos(middle) * 0.1,
            pose.y + twist.vx * math.sin(middle) * 0.1,
            wrap_angle(pose.yaw + twist.wz * 0.1),
        )
        poses.append(pose)
    return pose, poses


def test_a_straight_plan_is_driven_fast():
    planner = make()
    planner.set_plan(line(0, 0, 5, 0))
    twist = planner.compute(view(velocity=Twist2D(0.36)))
    assert twist.vx == pytest.approx(0.36)
    assert abs(twist.wz) < 0.1
    assert len(planner.local_plan) > 3


def test_a_plan_behind_begins_with_a_turn():
    planner = make()
    planner.set_plan(line(0, 0, -1.5, 0.05))
    twist = planner.compute(view())
    assert twist.vx < 0.05
    assert abs(twist.wz) >= 0.4


@pytest.mark.parametrize(("goal", "yaw"), [((1.0, 0.0), 2.0), ((0.0, 0.8), 0.0), ((-0.7, -0.6), -3.0)])
def test_goals_around_are_reached_with_their_heading(goal, yaw):
    planner = make()
    planner.set_plan(line(0, 0, *goal, yaw))
    pose, _ = drive(planner, Pose2D())
    assert math.dist(pose[:2], goal) <= 0.12
    assert abs(wrap_angle(pose.yaw - yaw)) <= 0.06


def test_a_wall_across_the_plan_stops_it():
    cells = block(empty(), 0.3, -2.0, 0.4, 1.95)
    planner = make()
    planner.set_plan(line(0, 0, 1.5, 0))
    with pytest.raises(ControlError, match="stands on the plan"):
        planner.compute(view(cells=cells))


def test_boxed_in_it_moves_nowhere():
    cells = np.full(INFO.shape, 254, np.uint8)
    a, b = INFO.cell_of(-0.14, -0.16), INFO.cell_of(0.14, 0.16)
    cells[a[1] : b[1] + 1, a[0] : b[0] + 1] = 0
    planner = make()
    planner.set_plan(line(0, 0, 1.5, 0))
    with pytest.raises(ControlError):
        planner.compute(view(cells=cells))


def test_a_robot_that_touches_something_moves_away_and_not_into_it():
    cells = block(empty(), 0.11, -0.5, 0.3, 0.5)
    planner = make(escape_vel=-0.1)
    planner.set_plan(line(0, 0, -1.5, 0))
    twist = planner.compute(view(cells=cells))
    assert twist.vx <= 0.0


def test_out_of_a_corner_that_leaves_its_padding_no_room_it_goes_by_its_bare_outline():
    cells = empty()
    block(cells, -0.28, -1.5, -0.22, 0.28)  # a wall beside the padding, to which the robot turns its back a little
    block(cells, -0.28, 0.22, 1.2, 0.28)  # another one ahead
    start = Pose2D(0.0, 0.0, math.radians(77.0))
    planner = make()
    planner.set_plan(line(0, 0, 0.15, -1.2, -1.5))
    pose, poses = drive(planner, start, cells)
    assert math.dist(pose[:2], (0.15, -1.2)) <= 0.12
    body = Footprint(CORNERS, CORNERS).outline(0.0125)
    for x, y, yaw in poses:
        c, s = math.cos(yaw), math.sin(yaw)
        assert not any(
            cells[iy, ix] for ix, iy in (INFO.cell_of(x + c * a - s * b, y + s * a + c * b) for a, b in body)
        )


def test_unknown_space_and_the_edge_of_the_map_are_not_driven_into():
    cells = empty()
    cells[:, INFO.cell_of(0.2, 0)[0] :] = 255
    planner = make(escape_vel=0.0)
    planner.set_plan(line(0, 0, 0.1, 0))
    pose, poses = Pose2D(), []
    for _ in range(30):
        try:
            twist = planner.compute(view(pose, cells=cells))
        except ControlError:
            break
        pose = Pose2D(pose.x + 0.1 * twist.vx, pose.y, pose.yaw)
        poses.append(pose)
    assert pose.x < 0.1


def test_no_plan_no_velocity():
    with pytest.raises(ControlError):
        make().compute(view())
    with pytest.raises(ControlError):
        make().set_plan(np.empty((0, 3)))


def test_a_plan_that_is_elsewhere_is_refused():
    planner = make()
    planner.set_plan(line(10, 10, 12, 10))
    with pytest.raises(ControlError, match="local costmap"):
        planner.compute(view())


def test_the_goal_is_not_reached_while_moving():
    planner = make()
    planner.set_plan(line(0, 0, 0.05, 0))
    assert planner.is_goal_reached(view())
    assert not planner.is_goal_reached(view(velocity=Twist2D(0.2)))


def test_a_dynamic_window_is_what_a_cycle_can_reach():
    planner = make(dwa=True, acc_lim_x=1.0, acc_lim_theta=2.0)
    planner.set_plan(line(0, 0, 1.5, 1.0))
    twist = planner.compute(view(velocity=Twist2D(0.2, 0.0, 0.1)))
    assert 0.1 - 1e-9 <= twist.vx <= 0.3 + 1e-9
    assert twist.vx == 0.0 or -0.1 - 1e-9 <= twist.wz <= 0.3 + 1e-9


def test_a_simple_attractor_cuts_the_corner_of_a_plan():
    """The plan leads up and then right; its end lies ahead."""
    corner = np.concatenate((line(0, 0, 0, 0.8), line(0, 0.8, 1.2, 0.8), line(1.2, 0.8, 1.2, 0.0)))
    planner = make(simple_attractor=True)
    planner.set_plan(corner)
    twist = planner.compute(view(velocity=Twist2D(0.3)))
    assert twist.vx > 0.3
    assert abs(twist.wz) < 0.1
    planner = make()
    planner.set_plan(corner)
    assert planner.compute(view(velocity=Twist2D(0.3))).wz > 0.3


def test_heading_scoring_turns_towards_the_plan():
    planner = make(heading_scoring=True, heading_scoring_timestep=0.8)
    planner.set_plan(line(0, 0, 1.2, 1.2))
    assert planner.compute(view()).wz > 0.3
    pose, _ = drive(planner, Pose2D())
    assert math.dist(pose[:2], (1.2, 1.2)) <= 0.12


def test_a_holonomic_base_goes_sideways_where_nothing_else_is_free():
    cells = block(block(empty(), 0.16, -0.6, 0.3, 0.6), -0.3, -0.6, -0.21, 0.6)  # between two walls, no room to turn
    here = Pose2D(-0.03, 0.0, 0.0)
    plan = line(-0.03, 0, -0.03, 1.5)
    tight = {"escape_vel": 0.0, "min_vel_x": 0.1, "min_in_place_vel_theta": 1.5, "max_vel_theta": 1.5}
    stuck = make(**tight)
    stuck.set_plan(plan)
    with pytest.raises(ControlError):
        stuck.compute(view(here, cells=cells))
    planner = make(holonomic_robot=True, y_vels=[-0.2, 0.2], **tight)
    planner.set_plan(plan)
    assert planner.compute(view(here, cells=cells)) == Twist2D(0.0, 0.2, 0.0)


def test_wrong_sideways_speeds_are_named():
    with pytest.raises(ParamError, match="y_vels"):
        load(TrajectoryPlannerParams, {"y_vels": "0.1,fast"})
    assert load(TrajectoryPlannerParams, {"y_vels": "0.1, -0.1"}).y_vels == "0.1, -0.1"


def test_once_it_backs_up_it_does_so_for_its_distance():
    """A box right ahead, no room to turn: back, and no forward motion before escape_reset_dist."""
    cells = block(empty(), 0.2, -0.6, 0.4, 0.6)
    cells = block(cells, -0.6, 0.2, 0.2, 0.3)
    cells = block(cells, -0.6, -0.3, 0.2, -0.2)
    planner = make(escape_reset_dist=0.15, min_in_place_vel_theta=1.0, vtheta_samples=3, max_vel_theta=1.0)
    planner.set_plan(line(-0.5, 0.0, -1.5, 0.0))
    pose = Pose2D()
    for _ in range(8):
        twist = planner.compute(view(pose, cells=cells))
        if math.hypot(pose.x, pose.y) < 0.15:
            assert twist.vx <= 0.0
        pose = Pose2D(pose.x + 0.1 * twist.vx, 0.0, 0.0)
    assert pose.x < 0.0


def test_pruning_only_shows():
    """Without it the plan behind still counts, and the local goal is the same."""
    found = []
    for prune in (True, False):
        planner = make(prune_plan=prune)
        planner.set_plan(line(-1.5, 0, 1.5, 0))
        planner.compute(view())
        found.append(planner.visible_plan)
    assert found[0][0, 0] == pytest.approx(0.0, abs=0.05)
    assert found[1][0, 0] == pytest.approx(-1.5, abs=0.05)
    assert found[0][-1].tolist() == found[1][-1].tolist()


def test_a_larger_footprint_keeps_farther_from_what_stands_on_the_plan():
    """Set while it drives: ways round things are looked for with the new radius."""
    cells = block(empty(), 0.7, -0.3, 0.8, 0.3)
    grown = CORNERS * 2.0
    planner = make()
    planner.fit(Footprint(padded(grown, 0.03), grown), resolution=0.05)
    fresh = TrajectoryPlanner(planner.params, Footprint(padded(grown, 0.03), grown), resolution=0.05)
    for each in (planner, fresh):
        each.set_plan(line(0, 0, 1.8, 0))
    seen = view(velocity=Twist2D(0.2), cells=cells)
    assert planner.compute(seen) == fresh.compute(seen)
    assert np.array_equal(planner.local_plan, fresh.local_plan)
