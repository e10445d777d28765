"""Parameters of move_base itself; names and defaults as upstream."""

from __future__ import annotations

from dataclasses import dataclass, field

from rosbot_patrol.control.give_way import GiveWayParams
from rosbot_patrol.control.movers import MoverParams
from rosbot_patrol.params import param


@dataclass(frozen=True, kw_only=True)
class MoveBaseParams:
    """Parameters of the node move_base."""

    base_global_planner: str = param("navfn/NavfnROS", doc="global planner plug-in")
    base_local_planner: str = param("base_local_planner/TrajectoryPlannerROS", doc="local planner plug-in")
    controller_frequency: float = param(
        20.0, unit="Hz", lo=0.1, hi=100.0, clamps="above", doc="control cycles per second"
    )
    planner_frequency: float = param(
        0.0, unit="Hz", lo=0.0, hi=100.0, clamps="both", doc="plans per second; 0: plan on demand"
    )
    planner_patience: float = param(
        5.0, unit="s", lo=0.0, clamps="both", doc="longest time without a valid plan before recovery"
    )
    controller_patience: float = param(
        15.0, unit="s", lo=0.0, clamps="both", doc="longest time without a valid velocity before recovery"
    )
    max_planning_retries: int = param(-1, lo=-1, clamps="both", doc="failed plans before recovery; -1: no limit")
    oscillation_timeout: float = param(
        0.0, unit="s", lo=0.0, clamps="both", doc="longest time without progress before recovery; 0: no limit"
    )
    oscillation_distance: float = param(0.5, unit="m", lo=0.0, clamps="both", doc="distance that counts as progress")
    conservative_reset_dist: float = param(
        3.0, unit="m", lo=0.0, clamps="both", doc="side of the square that the first clearing keeps"
    )
    clearing_radius: float = param(
        -1.0, unit="m", doc="the second clearing keeps a square of four times this; default: circumscribed_radius"
    )
    circumscribed_radius: float = param(0.46, unit="m", lo=0.0, doc="default of clearing_radius")
    inscribed_radius: float = param(0.325, unit="m", lo=0.0, doc="accepted, has no effect")
    clearing_rotation_allowed: bool = param(True, doc="turn on the spot to recover")
    recovery_behavior_enabled: bool = param(True, doc="run recovery behaviours at all")
    shutdown_costmaps: bool = param(False, doc="accepted; the costmaps always stay up to date")
    make_plan_clear_costmap: bool = param(True, doc="accepted, has no effect")
    make_plan_add_unreachable_goal: bool = param(True, doc="end make_plan's path at the requested goal")
    odom_topic: str = param("odom", doc="topic with the velocities")
    odom_timeout: float = param(
        0.5, unit="s", lo=0.0, doc="ours: maximum age of odometry; older stops the robot; 0: never"
    )
    stop_without_map: bool = param(
        False, doc="ours: stop while nobody publishes the map; false: drive on with the last one, as upstream"
    )
    zones_file: str = param(
        "",
        doc="ours: file of keep-out zones, read again when it changes; state: house/zones.yaml in the guard's state"
        " folder; empty: none",
    )
    give_way: GiveWayParams = field(default_factory=GiveWayParams)
    movers: MoverParams = field(default_factory=MoverParams)

    @property
    def aggressive_radius(self) -> float:
        """Radius of the second clearing: `clearing_radius`, or by default the circumscribed radius."""
        return self.clearing_radius if self.clearing_radius >= 0.0 else self.circumscribed_radius
