"""Parameters of move_base itself; names and defaults as upstream."""

from __future__ import annotations

from dataclasses import dataclass, field

from rosbot_patrol.control.give_way import GiveWayParams
from rosbot_patrol.control.movers import MoverParams
from rosbot_patrol.params import param


@dataclass(frozen=True, kw_only=True)
class MoveBaseParams:
    """Parameters of the node move_base."""

    base_global_planner: str = param("navfn/NavfnROS", doc="plug-in that plans")
    base_local_planner: str = param("base_local_planner/TrajectoryPlannerROS", doc="plug-in that drives")
    controller_frequency: float = param(
        20.0, unit="Hz", lo=0.1, hi=100.0, clamps="above", doc="control cycles a second"
    )
    planner_frequency: float = param(
        0.0, unit="Hz", lo=0.0, hi=100.0, clamps="both", doc="plans a second; 0 plans on demand"
    )
    planner_patience: float = param(
        5.0, unit="s", lo=0.0, clamps="both", doc="how long to try for a plan before recovering"
    )
    controller_patience: float = param(15.0, unit="s", lo=0.0, clamps="both", doc="the same for a velocity")
    max_planning_retries: int = param(-1, lo=-1, clamps="both", doc="failures before recovering, -1 is no limit")
    oscillation_timeout: float = param(
        0.0, unit="s", lo=0.0, clamps="both", doc="how long to move on the spot, 0 is for ever"
    )
    oscillation_distance: float = param(0.5, unit="m", lo=0.0, clamps="both", doc="motion that counts as progress")
    conservative_reset_dist: float = param(
        3.0, unit="m", lo=0.0, clamps="both", doc="square kept by the first clearing"
    )
    clearing_radius: float = param(
        -1.0, unit="m", doc="the second clearing keeps four times this; circumscribed_radius where not given"
    )
    circumscribed_radius: float = param(0.46, unit="m", lo=0.0)
    inscribed_radius: float = param(0.325, unit="m", lo=0.0, doc="accepted, has no effect")
    clearing_rotation_allowed: bool = param(True, doc="turn on the spot to recover")
    recovery_behavior_enabled: bool = param(True, doc="recover at all")
    shutdown_costmaps: bool = param(False, doc="accepted; the costmaps are always kept up to date")
    make_plan_clear_costmap: bool = param(True, doc="accepted, has no effect")
    make_plan_add_unreachable_goal: bool = param(True, doc="end make_plan at the goal asked for")
    odom_topic: str = param("odom", doc="where velocities come from")
    odom_timeout: float = param(0.5, unit="s", lo=0.0, doc="older odometry stops the robot, 0 is never; ours")
    stop_without_map: bool = param(
        False, doc="ours: stand while nobody publishes the map any more; false drives on by what it has, as upstream"
    )
    give_way: GiveWayParams = field(default_factory=GiveWayParams)
    movers: MoverParams = field(default_factory=MoverParams)

    @property
    def aggressive_radius(self) -> float:
        """What `clearing_radius` says, or the circumscribed radius."""
        return self.clearing_radius if self.clearing_radius >= 0.0 else self.circumscribed_radius
