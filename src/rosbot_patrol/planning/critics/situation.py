"""What all critics of one control cycle look at."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.costmap.costs import CostCells
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.grid import Grid, GridInfo

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Situation:
    """One control cycle.

    Attributes:
        pose: where the robot is.
        trajectories: simulated poses in the local costmap's frame, shape (K, T, 3).
        costmap: the local costs.
        coarse, coarse_cells: the same in cells of about 5 cm, for distance fields.
        plan: the part of the plan inside, shape (N, 3).
        nose: how far ahead of the last pose alignment is judged [m].
    """

    pose: Pose2D
    trajectories: Array
    costmap: Grid
    coarse: GridInfo
    coarse_cells: CostCells
    plan: Array
    nose: float
