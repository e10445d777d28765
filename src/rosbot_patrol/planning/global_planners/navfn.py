"""Global planner under the name navfn/NavfnROS (matches navfn 1.17 of the navigation stack).

As upstream, a cell costs COST_NEUTRAL + COST_FACTOR * its cost. Inscribed and lethal cells are impassable, and unknown
ones need `allow_unknown` (at the highest cost). The robot's own cell counts as free. A goal that is unreachable or off
the costmap is replaced by the nearest point within `default_tolerance`.

Differs (besides what `base` lists):
    - The field is an exact upwind solution of the relevant part of the costmap, so plans are smoother and come sooner.
    - `default_tolerance` is a radius; upstream searches a square.
    - Poses carry the heading of the path; upstream leaves all but the last at zero.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.costmap.costs import INSCRIBED, LETHAL, UNKNOWN
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.params import param
from rosbot_patrol.planning.global_planners.base import PotentialPlanner, Settings, with_headings
from rosbot_patrol.planning.interfaces import Array

COST_NEUTRAL = 50.0
COST_FACTOR = 0.8
COST_HIGHEST = 253.0


@dataclass(frozen=True, kw_only=True)
class NavfnParams:
    """Parameters of NavfnROS."""

    allow_unknown: bool = param(True, doc="plan through unknown cells")
    default_tolerance: float = param(0.0, unit="m", lo=0.0, doc="maximum distance of the plan's end from the goal")
    visualize_potential: bool = param(False, doc="accepted, has no effect")
    planner_window_x: float = param(0.0, unit="m", doc="accepted, has no effect, as upstream")
    planner_window_y: float = param(0.0, unit="m", doc="accepted, has no effect, as upstream")
    escape_radius: float = param(
        0.4, unit="m", lo=0.0, doc="ours: maximum distance that a start close to an obstacle may lead out"
    )


def crossing_costs(allow_unknown: bool) -> NDArray[np.float32]:
    """Price of crossing a cell, by its cost; inf if impassable; shape (256,)."""
    table = (COST_NEUTRAL + COST_FACTOR * np.arange(256)).clip(max=COST_HIGHEST).astype(np.float32)
    table[[INSCRIBED, LETHAL]] = np.inf
    table[UNKNOWN] = COST_HIGHEST if allow_unknown else np.inf
    return table


class NavfnPlanner(PotentialPlanner[NavfnParams]):
    """Cheapest paths over the costs."""

    tunable = ("allow_unknown", "default_tolerance")

    def __init__(self, params: NavfnParams | None = None) -> None:
        super().__init__(params or NavfnParams())

    def _settings_of(self, params: NavfnParams) -> Settings:
        return Settings(
            prices=crossing_costs(params.allow_unknown),
            tolerance=params.default_tolerance,
            escape_radius=params.escape_radius,
        )

    def _poses(self, points: Array, start: Pose2D, goal: Pose2D) -> Array:
        return with_headings(points, goal.yaw)
