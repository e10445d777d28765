"""Parameters of TrajectoryPlannerROS (base_local_planner 1.17)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from rosbot_patrol.params import param


def read_speeds(value: Any) -> list[float]:
    """Speeds of a list, or of upstream's text "-0.3,-0.1,0.1,0.3".

    Raises:
        ValueError: it is neither.
    """
    if isinstance(value, str):
        return [float(item) for item in value.split(",") if item.strip()]
    if isinstance(value, Sequence) and all(isinstance(v, (int, float)) and not isinstance(v, bool) for v in value):
        return [float(v) for v in value]
    raise ValueError(value)


def _wrong_speeds(value: Any) -> str | None:
    try:
        speeds = read_speeds(value)
    except ValueError:
        return f'expected speeds such as "-0.3,-0.1,0.1,0.3", got {value!r}'
    return None if all(math.isfinite(v) for v in speeds) else f"expected finite speeds, got {value!r}"


@dataclass(frozen=True, kw_only=True)
class TrajectoryPlannerParams:
    """Parameters of TrajectoryPlannerROS; names and defaults as upstream."""

    max_vel_x: float = param(0.55, unit="m/s", lo=0.0, hi=20.0, clamps="both", doc="top forward speed")
    min_vel_x: float = param(
        0.0, unit="m/s", lo=0.0, hi=20.0, clamps="both", doc="slowest forward speed that moves the base"
    )
    max_vel_theta: float = param(1.0, unit="rad/s", lo=0.0, hi=20.0, clamps="both", doc="top turning speed")
    min_vel_theta: float = param(
        -1.0, unit="rad/s", lo=-20.0, hi=0.0, clamps="both", doc="top turning speed to the right"
    )
    min_in_place_vel_theta: float = param(
        0.4, unit="rad/s", lo=0.0, hi=20.0, clamps="both", doc="slowest turn on the spot that moves the base"
    )
    max_rotational_vel: float = param(1.0, unit="rad/s", lo=0.0, doc="top speed when turning to the goal's heading")
    acc_lim_x: float = param(2.5, unit="m/s^2", lo=0.0, hi=20.0, clamps="both", doc="forward acceleration")
    acc_lim_y: float = param(
        2.5, unit="m/s^2", lo=0.0, hi=20.0, clamps="both", doc="sideways acceleration (holonomic_robot)"
    )
    acc_lim_theta: float = param(3.2, unit="rad/s^2", lo=0.0, hi=20.0, clamps="both", doc="turning acceleration")
    sim_time: float = param(1.7, unit="s", lo=0.1, hi=10.0, clamps="both", doc="how far ahead is simulated")
    sim_granularity: float = param(
        0.025, unit="m", lo=0.001, hi=5.0, clamps="both", doc="longest step of the simulation"
    )
    angular_sim_granularity: float = param(
        0.025, unit="rad", lo=0.001, hi=1.5708, clamps="both", doc="the same for turning"
    )
    vx_samples: int = param(20, lo=1, hi=300, clamps="both", doc="forward speeds tried")
    vtheta_samples: int = param(20, lo=1, hi=300, clamps="both", doc="turning speeds tried")
    path_distance_bias: float = param(0.6, lo=0.0, hi=5.0, clamps="both", doc="weight of staying on the plan")
    goal_distance_bias: float = param(0.8, lo=0.0, hi=5.0, clamps="both", doc="weight of getting on")
    occdist_scale: float = param(0.01, lo=0.0, hi=5.0, clamps="both", doc="weight of staying away from obstacles")
    meter_scoring: bool = param(False, doc="distances in metres instead of cells")
    heading_lookahead: float = param(
        0.325, unit="m", lo=0.0, hi=5.0, clamps="both", doc="point ahead at which alignment is judged"
    )
    oscillation_reset_dist: float = param(
        0.05, unit="m", lo=0.0, hi=5.0, clamps="both", doc="motion after which directions may change again"
    )
    escape_vel: float = param(-0.1, unit="m/s", lo=-2.0, hi=0.0, clamps="both", doc="speed of backing up; 0: never")
    escape_reset_dist: float = param(0.1, unit="m", lo=0.0, hi=5.0, clamps="both", doc="how far it backs up")
    escape_reset_theta: float = param(
        math.pi / 2, unit="rad", lo=0.0, hi=5.0, clamps="both", doc="or how far it turns meanwhile"
    )
    xy_goal_tolerance: float = param(0.10, unit="m", lo=0.0, doc="how near to the goal is there")
    yaw_goal_tolerance: float = param(0.05, unit="rad", lo=0.0, doc="how near to its heading is right")
    latch_xy_goal_tolerance: bool = param(False, doc="once there, only turn")
    rot_stopped_velocity: float = param(0.01, unit="rad/s", lo=0.0, doc="slower is standing")
    trans_stopped_velocity: float = param(0.01, unit="m/s", lo=0.0, doc="slower is standing")
    prune_plan: bool = param(True, doc="drop the part of the plan that is behind")
    holonomic_robot: bool = param(True, doc="the base can go sideways: try that as well")
    y_vels: Any = param(
        "-0.3,-0.1,0.1,0.3", check=_wrong_speeds, doc="sideways speeds tried where nothing else is free"
    )
    dwa: bool = param(False, doc="sample only speeds that one control cycle can reach")
    heading_scoring: bool = param(False, doc="judge the heading towards the plan instead of the end of the trajectory")
    heading_scoring_timestep: float = param(
        0.1, unit="s", lo=0.0, hi=1.0, clamps="both", doc="when it is judged, with heading_scoring"
    )
    simple_attractor: bool = param(False, doc="head straight for the local goal, whatever the plan")
    stop_time_buffer: float = param(0.2, unit="s", lo=0.0, doc="time to spare when braking before an obstacle")
    publish_cost_grid_pc: bool = param(False, doc="accepted, has no effect")
    global_frame_id: str = param("odom", doc="accepted, has no effect: the local costmap's frame is used")
    sim_period: float = param(0.1, doc="accepted, has no effect, as upstream: controller_frequency tells")
    y_samples: int = param(0, doc="accepted, has no effect, as upstream: y_vels tells")
    controller_frequency: float = param(
        20.0, unit="Hz", lo=0.1, doc="cycles a second, for accelerations; move_base's own where not given"
    )


TUNABLE = (  # as in upstream's BaseLocalPlanner.cfg, the tolerances besides
    "acc_lim_x",
    "acc_lim_y",
    "acc_lim_theta",
    "max_vel_x",
    "min_vel_x",
    "max_vel_theta",
    "min_vel_theta",
    "min_in_place_vel_theta",
    "sim_time",
    "sim_granularity",
    "angular_sim_granularity",
    "path_distance_bias",
    "goal_distance_bias",
    "occdist_scale",
    "oscillation_reset_dist",
    "escape_reset_dist",
    "escape_reset_theta",
    "vx_samples",
    "vtheta_samples",
    "heading_lookahead",
    "holonomic_robot",
    "escape_vel",
    "dwa",
    "heading_scoring",
    "heading_scoring_timestep",
    "simple_attractor",
    "y_vels",
    "xy_goal_tolerance",
    "yaw_goal_tolerance",
    "latch_xy_goal_tolerance",
    "max_rotational_vel",
)
