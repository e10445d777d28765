"""Global planner under the name global_planner/GlobalPlanner (matches global_planner 1.17 of the navigation stack).

As upstream, a cell costs neutral_cost + cost_factor * its cost, but no more than lethal_cost - 1. Cells of at least
lethal_cost - 1 are impassable, unknown ones without `allow_unknown`, too. The outermost cells of the costmap are
obstacles unless `outline_map` is false. Headings come from the orientation filter.

Differs (besides what `base` lists):
    - The field is the same exact one as navfn's, whatever `use_dijkstra`, `use_quadratic` and `old_navfn_behavior`:
      these choose between coarser computations and upstream's rounding to cells.
    - `default_tolerance` works, also for a goal off the costmap; upstream reads it and does not use it.
    - Interpolated headings before the goal run from the path's direction to the goal's heading; upstream's start too
      late by their index.
    - A path over the grid (`use_grid_path`) does not cut the corners of obstacles.
    - The potential is not published, because most of it is not computed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.costmap.costs import LETHAL, UNKNOWN
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.params import param
from rosbot_patrol.planning.global_planners.base import PotentialPlanner, Settings
from rosbot_patrol.planning.global_planners.orientation import OrientationMode, with_orientations
from rosbot_patrol.planning.global_planners.search import descend_by_cells, descend_smoothly
from rosbot_patrol.planning.interfaces import Array

_NO_EFFECT = "accepted, has no effect"


@dataclass(frozen=True, kw_only=True)
class GlobalPlannerParams:
    """Parameters of GlobalPlanner."""

    allow_unknown: bool = param(True, doc="plan through unknown cells")
    default_tolerance: float = param(0.0, unit="m", lo=0.0, doc="maximum distance of the plan's end from the goal")
    lethal_cost: int = param(
        253, lo=2, hi=255, clamps="both", doc="cells with at least this cost minus one are impassable"
    )
    neutral_cost: int = param(50, lo=1, hi=255, clamps="both", doc="cost of crossing a free cell")
    cost_factor: float = param(
        3.0, lo=0.01, hi=5.0, clamps="both", doc="weight of a cell's cost, added to neutral_cost"
    )
    use_grid_path: bool = param(False, doc="plan from cell to cell, in eight directions")
    outline_map: bool = param(True, doc="treat the outermost cells as obstacles; false for a rolling window")
    orientation_mode: int = param(
        1,
        lo=0,
        hi=6,
        clamps="both",
        doc="headings: 0 none, 1 along the path, 2 interpolated, 3 along it and interpolated at the end, 4 backwards, "
        "5 leftwards, 6 rightwards",
    )
    orientation_window_size: int = param(
        1, lo=1, hi=255, clamps="both", doc="number of points on each side from which a heading is computed"
    )
    use_dijkstra: bool = param(True, doc=_NO_EFFECT)
    use_quadratic: bool = param(True, doc=_NO_EFFECT)
    old_navfn_behavior: bool = param(False, doc=_NO_EFFECT)
    publish_potential: bool = param(True, doc=_NO_EFFECT)
    visualize_potential: bool = param(False, doc=_NO_EFFECT)
    publish_scale: int = param(100, doc=_NO_EFFECT)
    planner_window_x: float = param(0.0, unit="m", doc=_NO_EFFECT + " (upstream's neither)")
    planner_window_y: float = param(0.0, unit="m", doc=_NO_EFFECT + " (upstream's neither)")
    planner_costmap_publish_frequency: float = param(0.0, unit="Hz", doc=_NO_EFFECT + " (upstream's neither)")
    escape_radius: float = param(
        0.4, unit="m", lo=0.0, doc="ours: maximum distance that a start close to an obstacle may lead out"
    )


def crossing_costs(params: GlobalPlannerParams) -> NDArray[np.float32]:
    """Price of crossing a cell, by its cost; inf if impassable; shape (256,)."""
    costs = np.arange(256)
    limit = params.lethal_cost - 1
    table = (params.neutral_cost + params.cost_factor * costs).clip(max=limit).astype(np.float32)
    closed = costs >= limit
    closed[LETHAL] = True
    closed[UNKNOWN] = not params.allow_unknown
    table[closed] = np.inf
    return table


class PotentialFieldPlanner(PotentialPlanner[GlobalPlannerParams]):
    """Cheapest paths over the costs, with a choice of path types and headings."""

    tunable = (
        "lethal_cost",
        "neutral_cost",
        "cost_factor",
        "publish_potential",
        "orientation_mode",
        "orientation_window_size",
        "outline_map",
    )

    def __init__(self, params: GlobalPlannerParams | None = None) -> None:
        super().__init__(params or GlobalPlannerParams())

    def _settings_of(self, params: GlobalPlannerParams) -> Settings:
        return Settings(
            prices=crossing_costs(params),
            tolerance=params.default_tolerance,
            escape_radius=params.escape_radius,
            outline=params.outline_map,
            descend=descend_by_cells if params.use_grid_path else descend_smoothly,
        )

    def _poses(self, points: Array, start: Pose2D, goal: Pose2D) -> Array:
        mode = OrientationMode(self.params.orientation_mode)
        return with_orientations(points, start.yaw, goal.yaw, mode, self.params.orientation_window_size)
