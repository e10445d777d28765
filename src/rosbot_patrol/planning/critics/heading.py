"""Critic: does the robot head for the visible part of the plan?"""

from __future__ import annotations

import numpy as np

from rosbot_patrol.planning.critics import critic_kernels as kernels
from rosbot_patrol.planning.critics.situation import Array, Situation


class HeadingCritic:
    """Angle between the robot's heading and the farthest pose of the plan in its line of sight.

    As TrajectoryPlannerROS with `heading_scoring`. Differs: if nothing of the plan is visible, the angle is pi;
    upstream uses the largest number.
    """

    def score(self, situation: Situation) -> Array:
        """Angles [rad], shape (K,), 0 to pi."""
        info = situation.coarse.info
        place = (info.resolution, info.origin_x, info.origin_y)
        step = max(1, len(situation.plan) // 60)
        plan = np.ascontiguousarray(situation.plan[::-1][::step])
        return kernels.headings_off(situation.ends, plan, situation.coarse.cells, *place)
