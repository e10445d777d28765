"""Critic: turning speed."""

from __future__ import annotations

import numpy as np

from rosbot_patrol.planning.critics.situation import Array, Situation


class TwirlingCritic:
    """Turning speed, so that a base which can go sideways does not spin on its way (TwirlingCostFunction)."""

    def score(self, situation: Situation) -> Array:
        """Turning speeds [rad/s], shape (K,)."""
        speeds: Array = np.abs(situation.samples[:, 2])
        return speeds
