"""Values beyond the bounds of upstream's .cfg files: at start they become the bound, as dynamic_reconfigure does."""

import math

import pytest

from rosbot_patrol.amcl.parameters import AmclParams
from rosbot_patrol.costmap.layered import LayeredCostmap
from rosbot_patrol.costmap.params import read_costmap
from rosbot_patrol.errors import ParamError
from rosbot_patrol.navigation.params import MoveBaseParams
from rosbot_patrol.params import load
from rosbot_patrol.planning.registry import make_global_planner, make_local_planner
from rosbot_patrol.rosserial.server.settings import SerialNodeParams


def local_planner(plugin, **values):
    costmap = LayeredCostmap(read_costmap({"plugins": [], "width": 1.0, "height": 1.0, "robot_radius": 0.1}))
    tree = {plugin.rsplit("/", 1)[-1]: values}
    return make_local_planner(plugin, tree, costmap, controller_frequency=10.0, name="/move_base/").params


def layer(kind, **values):
    tree = {"plugins": [{"name": "it", "type": kind}], "it": values}
    (found,) = read_costmap(tree, name="/move_base/local_costmap/").layers
    return found.params


@pytest.mark.parametrize(
    ("name", "given", "used"),
    [
        ("max_vel_x", 25.0, 20.0),
        ("min_vel_theta", 0.4, 0.0),
        ("min_vel_theta", -30.0, -20.0),
        ("path_distance_bias", 20.0, 5.0),  # as the ROSbot's own file of 2023 has it
        ("goal_distance_bias", 15.0, 5.0),
        ("sim_time", 12.0, 10.0),
        ("angular_sim_granularity", 3.0, 1.5708),
        ("vx_samples", 0, 1),
        ("vtheta_samples", 1000, 300),
        ("acc_lim_x", -1.0, 0.0),
        ("heading_lookahead", 6.0, 5.0),
        ("escape_vel", 0.1, 0.0),
    ],
)
def test_trajectory_planner(name, given, used, caplog):
    found = local_planner("base_local_planner/TrajectoryPlannerROS", **{name: given})
    assert getattr(found, name) == used
    assert [m for m in caplog.messages if f"/move_base/TrajectoryPlannerROS/{name} is {given}" in m]


@pytest.mark.parametrize(
    ("name", "given", "new", "used"),
    [
        ("min_rot_vel", -0.3, "min_vel_theta", 0.0),
        ("acc_lim_theta", 25.0, "acc_lim_theta", 20.0),
        ("vy_samples", 0, "vy_samples", 1),
        ("occdist_scale", -1.0, "occdist_scale", 0.0),
        ("min_trans_vel", -0.1, "min_vel_trans", 0.0),
    ],
)
def test_dwa_planner(name, given, new, used, caplog):
    found = local_planner("dwa_local_planner/DWAPlannerROS", **{name: given})
    assert getattr(found, new) == used
    assert [m for m in caplog.messages if f"/move_base/DWAPlannerROS/{new} is {given}" in m]


def test_global_planner(caplog):
    values = {"cost_factor": 50.0, "neutral_cost": 0, "orientation_window_size": 0, "orientation_mode": -1}
    found = make_global_planner("GlobalPlanner", {"GlobalPlanner": values}, name="/move_base/").params
    assert (found.cost_factor, found.neutral_cost) == (5.0, 1)
    assert (found.orientation_window_size, found.orientation_mode) == (1, 0)
    assert "/move_base/GlobalPlanner/cost_factor is 50.0, which is out of bounds: 5.0 is taken" in caplog.messages


@pytest.mark.parametrize(
    ("kind", "name", "given", "used"),
    [
        ("costmap_2d::VoxelLayer", "z_voxels", 32, 16),
        ("costmap_2d::VoxelLayer", "mark_threshold", 17, 16),
        ("costmap_2d::VoxelLayer", "unknown_threshold", -1, 0),
        ("costmap_2d::VoxelLayer", "origin_z", -0.1, 0.0),
        ("costmap_2d::VoxelLayer", "z_resolution", 60.0, 50.0),
        ("costmap_2d::InflationLayer", "inflation_radius", 60, 50.0),
        ("costmap_2d::InflationLayer", "inflation_radius", -1.0, 0.0),
        ("costmap_2d::InflationLayer", "cost_scaling_factor", 258.0, 100.0),
        ("costmap_2d::ObstacleLayer", "max_obstacle_height", 100.0, 50.0),
        ("costmap_2d::StaticLayer", "lethal_cost_threshold", 254, 100),
        ("range_sensor_layer::RangeSensorLayer", "inflate_cone", 2.0, 1.0),
        ("range_sensor_layer::RangeSensorLayer", "mark_threshold", 1.5, 1.0),
    ],
)
def test_layers(kind, name, given, used, caplog):
    assert getattr(layer(kind, **{name: given}), name) == used
    assert [m for m in caplog.messages if m.startswith(f"/move_base/local_costmap/it/{name} is ")]


@pytest.mark.parametrize(
    ("name", "given", "used"),
    [
        ("update_frequency", 200.0, 100.0),
        ("publish_frequency", -1.0, 0.0),
        ("transform_tolerance", 30.0, 10.0),
        ("robot_radius", 15.0, 10.0),
        ("resolution", 60.0, 50.0),
    ],
)
def test_costmap(name, given, used):
    assert getattr(read_costmap({name: given, "plugins": []}).params, name) == used


def test_a_costmap_without_cells_is_an_error():
    for resolution in (0.0, -1.0):
        with pytest.raises(ParamError, match=r"resolution: is .*, expected at least 0.001"):
            read_costmap({"resolution": resolution, "plugins": []})


def test_move_base():
    found = load(MoveBaseParams, {"planner_frequency": 500, "controller_patience": -1.0, "max_planning_retries": -7})
    assert (found.planner_frequency, found.controller_patience, found.max_planning_retries) == (100.0, 0.0, -1)
    with pytest.raises(ParamError, match="controller_frequency"):
        load(MoveBaseParams, {"controller_frequency": 0.0})


def test_amcl(caplog):
    given = {"min_particles": 0, "laser_max_beams": 1, "odom_alpha1": -0.1, "recovery_alpha_fast": 2.0}
    found = load(AmclParams, {**given, "initial_pose_x": math.nan, "initial_cov_aa": math.nan}, name="/amcl/")
    assert (found.min_particles, found.laser_max_beams, found.odom_alpha1) == (1, 2, 0.0)
    assert (found.recovery_alpha_fast, found.initial_pose_x) == (1.0, 0.0)
    assert found.initial_cov_aa == AmclParams().initial_cov_aa
    assert "/amcl/initial_pose_x is NaN, its default 0.0 is taken" in caplog.messages
    with pytest.raises(ParamError, match="initial_pose_y: expected a finite number"):
        load(AmclParams, {"initial_pose_y": -math.inf})
    with pytest.raises(ParamError, match="odom_alpha1"):
        load(AmclParams, {"odom_alpha1": math.nan})


def test_serial_node():
    found = load(SerialNodeParams, {"baud": "115200", "tcp_port": "11412"})
    assert (found.baud, found.tcp_port) == (115200, 11412)
