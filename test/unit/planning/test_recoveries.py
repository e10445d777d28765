"""Recovery behaviours and the registry of plug-in names."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rosbot_patrol.costmap.layered import LayeredCostmap
from rosbot_patrol.costmap.layers.obstacle import observe
from rosbot_patrol.costmap.params import read_costmap
from rosbot_patrol.errors import ParamError
from rosbot_patrol.geometry import Pose2D, Twist2D, wrap_angle
from rosbot_patrol.planning.interfaces import LocalView, RecoveryView
from rosbot_patrol.planning.recoveries import (
    ClearCostmap,
    ClearCostmapParams,
    MoveSlowAndClear,
    MoveSlowParams,
    Rotate,
    RotateParams,
)
from rosbot_patrol.planning.registry import make_global_planner, make_local_planner, make_recoveries
from rosbot_patrol.scan import LaserScan


def costmap(**shape):
    tree = {"rolling_window": True, "width": 4.0, "height": 4.0, "resolution": 0.05, **(shape or {"robot_radius": 0.2})}
    made = LayeredCostmap(read_costmap(tree))
    made.update(0.0, Pose2D())
    return made


def view(pose, now, local):
    return RecoveryView(now=now, pose_global=pose, pose_local=pose, global_costmap=local, local_costmap=local)


def turn(rotate, local, seconds=60.0):
    pose, now, total = Pose2D(), 0.0, 0.0
    rotate.start(view(pose, now, local))
    while now < seconds:
        twist = rotate.step(view(pose, now, local))
        if twist is None:
            return total, now
        assert twist.vx == 0.0
        total += twist.wz * 0.1
        pose, now = Pose2D(0.0, 0.0, wrap_angle(pose.yaw + twist.wz * 0.1)), now + 0.1
    raise AssertionError("it never ended")


def test_a_rotation_turns_once():
    total, _ = turn(Rotate(RotateParams(), name="r"), costmap())
    assert total == pytest.approx(math.tau, abs=0.2)


def test_a_rotation_ends_where_something_is_in_the_way():
    local = costmap(footprint=[[0.2, 0.1], [-0.2, 0.1], [-0.2, -0.1], [0.2, -0.1]])
    local.cells[local.info.cell_of(0.0, 0.17)[1], local.info.cell_of(0.0, 0.17)[0]] = 254  # a corner would hit it
    rotate = Rotate(RotateParams(), name="r")
    rotate.start(view(Pose2D(), 0.0, local))
    assert rotate.step(view(Pose2D(), 0.0, local)) is None
    assert "in the way" in rotate.last_words


def test_a_rotation_of_a_base_that_does_not_move_ends():
    rotate, local = Rotate(RotateParams(), name="r"), costmap()
    rotate.start(view(Pose2D(), 0.0, local))
    assert rotate.step(view(Pose2D(), 10.0, local)) is not None
    assert rotate.step(view(Pose2D(), 100.0, local)) is None
    assert "does not follow" in rotate.last_words


def test_clearing_is_done_at_once():
    clear, local = ClearCostmap(ClearCostmapParams(), name="c"), costmap()
    clear.start(view(Pose2D(), 0.0, local))
    assert clear.step(view(Pose2D(), 0.0, local)) is None


def recoveries(tree, **given):
    return make_recoveries(tree, conservative=3.0, clearing_radius=0.46, clearing_rotation=True, **given)


def test_upstreams_four_behaviours():
    made = recoveries({})
    assert [r.name for r in made] == ["conservative_reset", "rotate_recovery", "aggressive_reset", "rotate_recovery"]
    assert made[0].params.reset_distance == 3.0
    assert made[2].params.reset_distance == pytest.approx(1.84)


def test_listed_behaviours_with_their_parameters():
    made = recoveries(
        {
            "recovery_behaviors": [{"name": "clear", "type": "clear_costmap_recovery/ClearCostmapRecovery"}],
            "clear": {"reset_distance": 1.5},
        }
    )
    assert [(r.name, r.params.reset_distance) for r in made] == [("clear", 1.5)]


@pytest.mark.parametrize("listed", [3, [3], [{"name": "a"}], [{"name": "a", "type": "x/Jump"}]])
def test_a_wrong_list_is_named(listed):
    with pytest.raises(ParamError, match="recovery_behaviors"):
        recoveries({"recovery_behaviors": listed})


def test_unknown_plugins_are_named():
    with pytest.raises(ParamError, match="carrot"):
        make_global_planner("carrot_planner/CarrotPlanner", {})
    with pytest.raises(ParamError, match="teb"):
        make_local_planner("teb_local_planner/TebLocalPlannerROS", {}, costmap(), controller_frequency=10.0)
    with pytest.raises(ParamError, match="NavfnROS"):
        make_global_planner("navfn/NavfnROS", {"NavfnROS": 3})


def obstructed():
    """A costmap whose obstacle layer has seen something at 0.5 m and at 1.5 m."""
    tree = {
        "rolling_window": True,
        "width": 4.0,
        "height": 4.0,
        "resolution": 0.05,
        "robot_radius": 0.2,
        "plugins": [
            {"name": "obstacle_layer", "type": "costmap_2d::ObstacleLayer"},
            {"name": "inflation_layer", "type": "costmap_2d::InflationLayer"},
        ],
        "obstacle_layer": {"observation_sources": "scan", "scan": {"data_type": "LaserScan", "marking": True}},
    }
    made = LayeredCostmap(read_costmap(tree))
    scan = LaserScan(
        stamp=0.0,
        frame_id="laser",
        angle_min=0.0,
        angle_increment=math.pi / 2,
        range_min=0.1,
        range_max=10.0,
        ranges=np.array([0.5, 1.5]),
    )
    made.obstacle_layers[0].buffers["scan"].add(observe(scan, Pose2D()))
    made.update(0.0, Pose2D())
    made.obstacle_layers[0].buffers["scan"].clear()
    return made


def lethal(local):
    return [bool(local.grid.at(0.5, 0.001) == 254), bool(local.grid.at(0.001, 1.5) == 254)]


@pytest.mark.parametrize(("invert", "left"), [(False, [True, False]), (True, [False, True])])
@pytest.mark.parametrize("force", [True, False])
def test_clearing_outside_and_inside_a_square(invert, left, force):
    local = obstructed()
    assert lethal(local) == [True, True]
    params = ClearCostmapParams(reset_distance=2.0, invert_area_to_clear=invert, force_updating=force)
    ClearCostmap(params, name="c").start(view(Pose2D(), 0.0, local))
    assert lethal(local) == (left if force else [True, True])
    written = local.update(0.1, Pose2D())
    assert lethal(local) == left
    assert sum(area.size for area in written) == 80 * 80  # whoever shows it gets all of it


def test_only_the_layers_named_are_cleared(caplog):
    local = obstructed()
    params = ClearCostmapParams(reset_distance=0.0, layer_names=["obstacles"])
    ClearCostmap(params, name="c").start(view(Pose2D(), 0.0, local))
    local.update(0.1, Pose2D())
    assert lethal(local) == [True, True]
    assert "Cannot clear layer obstacles because it does not exist" in caplog.text
    params = ClearCostmapParams(reset_distance=0.0, layer_names=["obstacle_layer"])
    ClearCostmap(params, name="c").start(view(Pose2D(), 0.0, local))
    local.update(0.1, Pose2D())
    assert lethal(local) == [False, False]


def test_move_slow_and_clear():
    local = obstructed()
    planner = make_local_planner("DWAPlannerROS", {}, local, controller_frequency=10.0)
    params = MoveSlowParams(clearing_distance=0.6, limited_trans_speed=0.12, limited_distance=0.3)
    slow = MoveSlowAndClear(params, name="m", planner=planner)
    slow.start(view(Pose2D(), 0.0, local))
    assert slow.step(view(Pose2D(), 0.0, local)) is None
    local.update(0.1, Pose2D())
    assert lethal(local) == [False, True]
    planner.set_plan(np.column_stack((np.linspace(0, 1.5, 31), np.zeros((31, 2)))))
    seen = LocalView(now=0.0, pose=Pose2D(), velocity=Twist2D(0.12), costmap=local.grid)
    assert planner.compute(seen).vx <= 0.12
    seen = LocalView(now=0.0, pose=Pose2D(0.35, 0.0, 0.0), velocity=Twist2D(0.12), costmap=local.grid)
    assert planner.compute(seen).vx > 0.12
    assert "0.12 m/s" in slow.last_words


def test_listed_move_slow_and_clear_gets_the_planner():
    listed = {
        "recovery_behaviors": [{"name": "m", "type": "move_slow_and_clear/MoveSlowAndClear"}],
        "m": {"limited_trans_speed": 0.12},
    }
    local = costmap()
    planner = make_local_planner("DWAPlannerROS", {}, local, controller_frequency=10.0)
    (slow,) = recoveries(listed, planner=planner)
    planner.set_plan(np.column_stack((np.linspace(0, 1.5, 31), np.zeros((31, 2)))))
    seen = LocalView(now=0.0, pose=Pose2D(), velocity=Twist2D(0.12), costmap=local.grid)
    assert planner.compute(seen).vx > 0.12
    slow.start(view(Pose2D(), 0.0, local))
    assert 0.0 < planner.compute(seen).vx <= 0.12


def test_a_rotation_takes_its_limits_from_the_local_planner():
    dwa = {"base_local_planner": "dwa_local_planner/DWAPlannerROS", "DWAPlannerROS": {"max_vel_theta": 0.7}}
    assert recoveries(dwa)[1].params.max_rotational_vel == 0.7
    own = {"TrajectoryPlannerROS": {"max_vel_theta": 0.9, "yaw_goal_tolerance": 0.2, "acc_lim_th": 1.5}}
    params = recoveries(own)[1].params
    assert (params.max_rotational_vel, params.yaw_goal_tolerance, params.acc_lim_th) == (0.9, 0.2, 1.5)
