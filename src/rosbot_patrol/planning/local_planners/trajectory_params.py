"""Parameters of TrajectoryPlannerROS (base_local_planner 1.17)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from rosbot_patrol.params import param


def read_speeds(value: Any) -> list[float]:
    """Speeds from a list, or from upstream's text "-0.3,-0.1,0.1,0.3".

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
        -1.0, unit="rad/s", lo=-20.0, hi=0.0, clamps="both", doc="top turning speed to the right, below 0"
    )
    min_in_place_vel_theta: float = param(
        0.4, unit="rad/s", lo=0.0, hi=20.0, clamps="both", doc="slowest turn on the spot that moves the base"
    )
    max_rotational_vel: float = param(1.0, unit="rad/s", lo=0.0, doc="top speed when turning to the goal's heading")
    acc_lim_x: float = param(2.5, unit="m/s^2", lo=0.0, hi=20.0, clamps="both", doc="maximum forward acceleration")
    acc_lim_y: float = param(
        2.5, unit="m/s^2", lo=0.0, hi=20.0, clamps="both", doc="maximum sideways acceleration (holonomic_robot)"
    )
    acc_lim_theta: float = param(
        3.2, unit="rad/s^2", lo=0.0, hi=20.0, clamps="both", doc="maximum turning acceleration"
    )
    sim_time: float = param(1.7, unit="s", lo=0.1, hi=10.0, clamps="both", doc="duration of the simulated trajectories")
    sim_granularity: float = param(
        0.025, unit="m", lo=0.001, hi=5.0, clamps="both", doc="longest step of the simulation"
    )
    angular_sim_granularity: float = param(
        0.025, unit="rad", lo=0.001, hi=1.5708, clamps="both", doc="largest turn in one step of the simulation"
    )
    vx_samples: int = param(20, lo=1, hi=300, clamps="both", doc="number of forward speeds tried")
    vtheta_samples: int = param(20, lo=1, hi=300, clamps="both", doc="number of turning speeds tried")
    path_distance_bias: float = param(0.6, lo=0.0, hi=5.0, clamps="both", doc="weight of the distance from the plan")
    goal_distance_bias: float = param(
        0.8, lo=0.0, hi=5.0, clamps="both", doc="weight of the distance to the local goal"
    )
    occdist_scale: float = param(0.01, lo=0.0, hi=5.0, clamps="both", doc="weight of the cost of obstacles")
    meter_scoring: bool = param(False, doc="distances in metres instead of cells")
    heading_lookahead: float = param(
        0.325, unit="m", lo=0.0, hi=5.0, clamps="both", doc="distance ahead of the robot at which alignment is scored"
    )
    oscillation_reset_dist: float = param(
        0.05, unit="m", lo=0.0, hi=5.0, clamps="both", doc="distance moved after which the direction may change again"
    )
    escape_vel: float = param(-0.1, unit="m/s", lo=-2.0, hi=0.0, clamps="both", doc="speed of backing up; 0: never")
    escape_reset_dist: float = param(
        0.1, unit="m", lo=0.0, hi=5.0, clamps="both", doc="distance after which backing up ends"
    )
    escape_reset_theta: float = param(
        math.pi / 2, unit="rad", lo=0.0, hi=5.0, clamps="both", doc="turn after which backing up ends"
    )
    xy_goal_tolerance: float = param(0.10, unit="m", lo=0.0, doc="distance from the goal at which it counts as reached")
    yaw_goal_tolerance: float = param(0.05, unit="rad", lo=0.0, doc="tolerance of the heading at the goal")
    latch_xy_goal_tolerance: bool = param(False, doc="after the goal position is reached, only turn")
    rot_stopped_velocity: float = param(
        0.01, unit="rad/s", lo=0.0, doc="turning speed below which the robot counts as stopped"
    )
    trans_stopped_velocity: float = param(0.01, unit="m/s", lo=0.0, doc="speed below which the robot counts as stopped")
    prune_plan: bool = param(True, doc="drop the part of the plan behind the robot")
    holonomic_robot: bool = param(True, doc="the base can go sideways: try sideways speeds, too")
    y_vels: Any = param(
        "-0.3,-0.1,0.1,0.3", check=_wrong_speeds, doc="sideways speeds tried if no trajectory ahead is free"
    )
    dwa: bool = param(False, doc="sample only speeds that can be reached in one control cycle")
    heading_scoring: bool = param(False, doc="score the heading towards the plan instead of the trajectory's end")
    heading_scoring_timestep: float = param(
        0.1, unit="s", lo=0.0, hi=1.0, clamps="both", doc="time along the trajectory at which heading_scoring looks"
    )
    simple_attractor: bool = param(False, doc="head straight for the local goal and ignore the plan")
    stop_time_buffer: float = param(0.2, unit="s", lo=0.0, doc="time reserve for braking before an obstacle")
    publish_cost_grid_pc: bool = param(False, doc="accepted, has no effect")
    global_frame_id: str = param("odom", doc="accepted, has no effect: the local costmap's frame is used")
    sim_period: float = param(0.1, doc="accepted, has no effect, as upstream: controller_frequency counts")
    y_samples: int = param(0, doc="accepted, has no effect, as upstream: y_vels counts")
    controller_frequency: float = param(
        20.0, unit="Hz", lo=0.1, doc="control cycles per second, for accelerations; default: move_base's own"
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
