"""dynamic_reconfigure of move_base: parameters that can be changed at run time, in upstream's namespaces and names.

Differs: `base_global_planner` and `base_local_planner` cannot be changed (upstream loads another plug-in); the goal
tolerances of TrajectoryPlannerROS can. Changes of `conservative_reset_dist` and `clearing_rotation_allowed` apply from
the next recovery on (upstream: from the next start on). A resized costmap keeps its map.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from functools import partial
from typing import Any

from rosbot_patrol.costmap.fed import FedCostmap
from rosbot_patrol.costmap.layers.layer import Layer
from rosbot_patrol.costmap.params import (
    CostmapParams,
    InflationParams,
    ObstacleParams,
    VoxelParams,
)
from rosbot_patrol.navigation.params import MoveBaseParams
from rosbot_patrol.planning.interfaces import GlobalPlanner, LocalPlanner
from rosbot_patrol.ros.move_base.costmap import CostmapNode
from rosbot_patrol.ros.runtime.reconfigure import ReconfigureServer
from rosbot_patrol.tunable import changed

MOVE_BASE = (
    "planner_frequency",
    "controller_frequency",
    "planner_patience",
    "controller_patience",
    "max_planning_retries",
    "conservative_reset_dist",
    "recovery_behavior_enabled",
    "clearing_rotation_allowed",
    "shutdown_costmaps",
    "oscillation_timeout",
    "oscillation_distance",
    "make_plan_clear_costmap",
    "make_plan_add_unreachable_goal",
    "odom_timeout",
    "stop_without_map",
)
COSTMAP = (
    "transform_tolerance",
    "update_frequency",
    "publish_frequency",
    "width",
    "height",
    "resolution",
    "origin_x",
    "origin_y",
    "footprint",
    "robot_radius",
    "footprint_padding",
)
_OBSTACLES = (
    "enabled",
    "footprint_clearing_enabled",
    "max_obstacle_height",
    "combination_method",
)
LAYERS: dict[type, tuple[str, ...]] = {
    InflationParams: ("enabled", "cost_scaling_factor", "inflation_radius", "inflate_unknown"),
    VoxelParams: (*_OBSTACLES, "origin_z", "z_resolution", "z_voxels", "mark_threshold"),
    ObstacleParams: _OBSTACLES,
}


class Tuning:
    """dynamic_reconfigure servers of move_base.

    Args:
        prefix: move_base's name and a slash, for messages.
        cycle: lock held during a control cycle.
    """

    def __init__(self, prefix: str, cycle: threading.RLock) -> None:
        self._prefix = prefix
        self._cycle = cycle
        self._servers: list[ReconfigureServer] = []

    def offer_node(self, params: MoveBaseParams, take: Callable[[MoveBaseParams], None]) -> None:
        """Offer move_base's own parameters; `take` receives them after a change."""
        now = params

        def apply(changes: dict[str, Any]) -> MoveBaseParams:
            nonlocal now
            wanted = changed(now, changes, MOVE_BASE, name=self._prefix)
            with self._cycle:
                take(wanted)
            now = wanted
            return now

        self._servers.append(ReconfigureServer("", params, MOVE_BASE, apply))

    def offer_planner(self, space: str, planner: GlobalPlanner | LocalPlanner) -> None:
        """Offer a planner's parameters, if it supports changes; a plan in progress uses the old ones."""
        names, params = getattr(planner, "tunable", ()), getattr(planner, "params", None)
        if not names or params is None:
            return

        def apply(changes: dict[str, Any]) -> Any:
            with self._cycle:
                return planner.reconfigure(changes, name=f"{self._prefix}{space}/")  # type: ignore[union-attr]

        self._servers.append(ReconfigureServer(space, params, names, apply))

    def offer_costmap(self, node: CostmapNode, after: Callable[[], None]) -> None:
        """Offer the parameters of a costmap and its layers; `after` is called after a change of its own."""
        costmap = node.costmap

        def apply(changes: dict[str, Any]) -> CostmapParams:
            wanted = changed(costmap.params, changes, COSTMAP, name=f"{self._prefix}{costmap.name}/")
            with self._cycle, costmap.lock:
                node.configure(wanted)
                after()
            return wanted

        self._servers.append(ReconfigureServer(costmap.name, costmap.params, COSTMAP, apply))
        for layer in costmap.costmap.layers:
            names = next((names for kind, names in LAYERS.items() if isinstance(layer.params, kind)), ("enabled",))
            apply_to_layer = partial(self._apply_to_layer, costmap, layer, names)
            self._servers.append(ReconfigureServer(f"{costmap.name}/{layer.name}", layer.params, names, apply_to_layer))

    def _apply_to_layer(
        self, costmap: FedCostmap, layer: Layer, names: tuple[str, ...], changes: dict[str, Any]
    ) -> Any:
        wanted = changed(layer.params, changes, names, name=f"{self._prefix}{costmap.name}/{layer.name}/")
        with costmap.lock:
            costmap.costmap.configure_layer(layer, wanted)
        return wanted
