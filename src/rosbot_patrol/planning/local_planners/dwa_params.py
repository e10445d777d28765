"""Parameters of DWAPlannerROS (dwa_local_planner 1.17)."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from typing import Any

from rosbot_patrol.params import param

log = logging.getLogger(__name__)


@dataclass(frozen=True, kw_only=True)
class DWAPlannerParams:
    """Parameters of DWAPlannerROS; names and defaults as upstream."""

    max_vel_trans: float = param(
        0.55, unit="m/s", lo=0.0, clamps="both", doc="top speed, forward and sideways combined"
    )
    min_vel_trans: float = param(0.1, unit="m/s", lo=0.0, clamps="both", doc="slowest speed that moves the base")
    max_vel_x: float = param(0.55, unit="m/s", doc="top forward speed")
    min_vel_x: float = param(0.0, unit="m/s", doc="minimum forward speed; below 0: backwards")
    max_vel_y: float = param(0.1, unit="m/s", doc="top speed to the left; 0 for a base that cannot go sideways")
    min_vel_y: float = param(-0.1, unit="m/s", doc="top speed to the right, below 0")
    max_vel_theta: float = param(1.0, unit="rad/s", lo=0.0, clamps="both", doc="top turning speed")
    min_vel_theta: float = param(
        0.4, unit="rad/s", lo=0.0, clamps="both", doc="slowest turning speed that moves the base"
    )
    acc_lim_x: float = param(2.5, unit="m/s^2", lo=0.0, hi=20.0, clamps="both", doc="maximum forward acceleration")
    acc_lim_y: float = param(2.5, unit="m/s^2", lo=0.0, hi=20.0, clamps="both", doc="maximum sideways acceleration")
    acc_lim_theta: float = param(
        3.2, unit="rad/s^2", lo=0.0, hi=20.0, clamps="both", doc="maximum turning acceleration"
    )
    acc_lim_trans: float = param(0.1, unit="m/s^2", lo=0.0, clamps="both", doc="accepted, has no effect, as upstream")
    sim_time: float = param(1.7, unit="s", lo=0.1, clamps="both", doc="duration of the simulated trajectories")
    sim_granularity: float = param(0.025, unit="m", lo=0.001, clamps="both", doc="longest step of the simulation")
    angular_sim_granularity: float = param(
        0.1, unit="rad", lo=0.001, clamps="both", doc="largest turn in one step of the simulation"
    )
    path_distance_bias: float = param(
        32.0, lo=0.0, clamps="both", doc="weight of the distance from the plan, per metre"
    )
    goal_distance_bias: float = param(
        24.0, lo=0.0, clamps="both", doc="weight of the distance to the local goal, per metre"
    )
    occdist_scale: float = param(0.01, lo=0.0, clamps="both", doc="weight of the cost of obstacles")
    twirling_scale: float = param(0.0, lo=0.0, clamps="both", doc="weight of turning")
    stop_time_buffer: float = param(
        0.2, unit="s", lo=0.0, clamps="both", doc="time reserve for braking before an obstacle"
    )
    oscillation_reset_dist: float = param(
        0.05, unit="m", lo=0.0, clamps="both", doc="distance moved after which the direction may change again"
    )
    oscillation_reset_angle: float = param(
        0.2, unit="rad", lo=0.0, clamps="both", doc="angle turned after which the direction may change again"
    )
    forward_point_distance: float = param(
        0.325, unit="m", lo=0.0, doc="distance ahead of the robot at which alignment is scored"
    )
    cheat_factor: float = param(
        1.0,
        lo=0.0,
        doc="scale of the zone around the goal without alignment: forward_point_distance * sqrt(cheat_factor)",
    )
    scaling_speed: float = param(
        0.25, unit="m/s", lo=0.0, clamps="both", doc="speed above which the footprint is enlarged"
    )
    max_scaling_factor: float = param(0.2, lo=0.0, clamps="both", doc="enlargement of the footprint at max_vel_trans")
    vx_samples: int = param(3, lo=1, clamps="both", doc="number of forward speeds tried")
    vy_samples: int = param(10, lo=1, clamps="both", doc="number of sideways speeds tried")
    vth_samples: int = param(20, lo=1, clamps="both", doc="number of turning speeds tried")
    use_dwa: bool = param(True, doc="sample only speeds that can be reached in one control cycle")
    xy_goal_tolerance: float = param(0.1, unit="m", lo=0.0, doc="distance from the goal at which it counts as reached")
    yaw_goal_tolerance: float = param(0.1, unit="rad", lo=0.0, doc="tolerance of the heading at the goal")
    latch_xy_goal_tolerance: bool = param(False, doc="after the goal position is reached, only turn")
    trans_stopped_vel: float = param(0.1, unit="m/s", lo=0.0, doc="speed below which the robot counts as stopped")
    theta_stopped_vel: float = param(
        0.1, unit="rad/s", lo=0.0, doc="turning speed below which the robot counts as stopped"
    )
    prune_plan: bool = param(False, doc="drop the part of the plan behind the robot")
    restore_defaults: bool = param(False, doc="setting it restores the values of the start")
    sum_scores: bool = param(False, doc="accepted, has no effect: the highest cost counts")
    publish_traj_pc: bool = param(False, doc="accepted, has no effect")
    publish_cost_grid_pc: bool = param(False, doc="accepted, has no effect")
    global_frame_id: str = param("odom", doc="accepted, has no effect: the local costmap's frame is used")
    odom_topic: str = param("odom", doc="accepted, has no effect: move_base's own odom_topic is used")
    controller_frequency: float = param(
        20.0, unit="Hz", lo=0.1, doc="control cycles per second, for accelerations; default: move_base's own"
    )


TUNABLE = (  # as in upstream's DWAPlanner.cfg, and the latch
    "max_vel_trans",
    "min_vel_trans",
    "max_vel_x",
    "min_vel_x",
    "max_vel_y",
    "min_vel_y",
    "max_vel_theta",
    "min_vel_theta",
    "acc_lim_x",
    "acc_lim_y",
    "acc_lim_theta",
    "acc_lim_trans",
    "prune_plan",
    "xy_goal_tolerance",
    "yaw_goal_tolerance",
    "trans_stopped_vel",
    "theta_stopped_vel",
    "sim_time",
    "sim_granularity",
    "angular_sim_granularity",
    "path_distance_bias",
    "goal_distance_bias",
    "occdist_scale",
    "twirling_scale",
    "stop_time_buffer",
    "oscillation_reset_dist",
    "oscillation_reset_angle",
    "forward_point_distance",
    "scaling_speed",
    "max_scaling_factor",
    "vx_samples",
    "vy_samples",
    "vth_samples",
    "use_dwa",
    "latch_xy_goal_tolerance",
    "restore_defaults",
)

RENAMED = {  # upstream's spelling before Noetic -> now
    "max_trans_vel": "max_vel_trans",
    "min_trans_vel": "min_vel_trans",
    "max_rot_vel": "max_vel_theta",
    "min_rot_vel": "min_vel_theta",
    "acc_limit_trans": "acc_lim_trans",
    "acc_limit_x": "acc_lim_x",
    "acc_limit_y": "acc_lim_y",
    "acc_limit_th": "acc_lim_theta",
    "acc_limit_theta": "acc_lim_theta",
    "acc_lim_th": "acc_lim_theta",
    "trans_stopped_velocity": "trans_stopped_vel",
    "rot_stopped_vel": "theta_stopped_vel",
    "rot_stopped_velocity": "theta_stopped_vel",
    "pdist_scale": "path_distance_bias",
    "gdist_scale": "goal_distance_bias",
    "vtheta_samples": "vth_samples",
}


def with_new_names(values: dict[str, Any], renamed: dict[str, str], name: str) -> dict[str, Any]:
    """Values under the present names; each old name is logged, and used if the new one is not given."""
    found = {key: value for key, value in values.items() if key not in renamed}
    for old, new in renamed.items():
        if old in values:
            log.warning("%s%s is now called %s", name, old, new)
            found.setdefault(new, values[old])
    return found
