"""Is the estimate to be believed? Judged by the scans against the map, not by how sure the particles are of themselves.

A beam that ends where the map has an obstacle is explained. One that ends early may have met a chair or somebody, which
the map does not know: it counts little. One that went through a wall of the map counts twice, for walls stay. The share
of what is explained, averaged over a few seconds, is the agreement. In our three houses it is 0.93 to 1 at the right
pose and mostly below 0.3 a metre off; with half of the beams cut short at the right pose it would be 0.67.
"""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass

import numpy as np

from rosbot_patrol.amcl.particles.particle_filter import Estimate
from rosbot_patrol.amcl.scan_model import agreement_kernels as kernels
from rosbot_patrol.amcl.scan_model.likelihood_field import Field
from rosbot_patrol.amcl.scan_model.sensor_model import Beams
from rosbot_patrol.geometry import Pose2D, compose

NEAR_M = 0.2  # from an obstacle: a beam that ends there is explained
FEWEST = 8  # beams that say something, or the scan is no witness
SHORT_COUNTS, THROUGH_COUNTS, UNRETURNED_COUNTS = 0.5, 2.0, 0.5
MEMORY_S = 2.0  # of the average
WIDE_M = 1.0  # spread of the best cluster from which on the estimate is unsure
FEW = 0.5  # share of the weight below which a cluster is one guess among others


class State(enum.Enum):
    """What to think of the estimate."""

    UNKNOWN = "nothing is known yet"
    LOCALISED = "localised"
    UNSURE = "unsure"
    LOST = "lost"


@dataclass(frozen=True)
class Trust:
    """The figure and what it is made of.

    Attributes:
        state: in a word.
        belief: 0 to 1: the agreement times the share of the particles' weight that stands behind the estimate.
        agreement: of scans and map at the estimate, 0 to 1, nan before there is one.
        reason: why the state is what it is, in a sentence, "" where all is well.
    """

    state: State = State.UNKNOWN
    belief: float = 0.0
    agreement: float = math.nan
    reason: str = "no scan has been compared with the map yet"


def agreement(pose: Pose2D, beams: Beams, obstacles: Field) -> float | None:
    """How well a scan agrees with the map at a pose of the robot, 0 to 1; None where it says too little.

    Args:
        pose: map_from_base.
        beams: of the scan.
        obstacles: distance to the nearest obstacle [m].
    """
    counts = np.empty(5, dtype=np.int64)
    sensor = np.array(compose(pose, beams.mount))
    kernels.count_beams(
        sensor,
        beams.angles,
        beams.ranges,
        obstacles.values,
        obstacles.origin_x,
        obstacles.origin_y,
        obstacles.resolution,
        beams.reach,
        NEAR_M,
        counts,
    )
    explained, short, through, unreturned = counts[:4].tolist()
    against = SHORT_COUNTS * short + THROUGH_COUNTS * through + UNRETURNED_COUNTS * unreturned
    if explained + short + through + unreturned < FEWEST:
        return None
    return float(explained / (explained + against))


class Witness:
    """Averages the agreement over time and says what to think of the estimate.

    Args:
        lost_below: an agreement below this is lost.
        sure_above: one above this is localised again.
    """

    def __init__(self, *, lost_below: float, sure_above: float) -> None:
        self._lost_below, self._sure_above = lost_below, max(sure_above, lost_below)
        self._average = math.nan
        self._stamp = -math.inf
        self.trust = Trust()

    def forget(self) -> None:
        """Begin anew: the pose has been set."""
        self._average = math.nan
        self.trust = Trust()

    def hear(self, stamp: float, found: float | None, estimate: Estimate) -> Trust:
        """Take in what one scan says.

        Args:
            stamp: of the scan [s].
            found: its agreement, None where it says nothing.
            estimate: the newest.
        """
        if found is not None:
            gain = 1.0 - math.exp(-max(stamp - self._stamp, 0.0) / MEMORY_S)
            self._average = found if math.isnan(self._average) else self._average + gain * (found - self._average)
        self._stamp = stamp
        self.trust = self._judged(estimate)
        return self.trust

    def _judged(self, estimate: Estimate) -> Trust:
        average = self._average
        if math.isnan(average):
            return Trust(reason="too few beams of the scans measured anything")
        belief = average * estimate.cluster_weight
        limit = self._sure_above if self.trust.state is State.LOST else self._lost_below
        if average < limit:
            reason = f"the scans contradict the map at the estimate (they agree by {100.0 * average:.0f} %)"
            return Trust(State.LOST, belief, average, reason)
        if estimate.cluster_spread > WIDE_M:
            reason = f"the particles are spread by {estimate.cluster_spread:.2f} m"
            return Trust(State.UNSURE, belief, average, reason)
        if estimate.cluster_weight < FEW:
            reason = f"no more than {100.0 * estimate.cluster_weight:.0f} % of the particles' weight stand behind it"
            return Trust(State.UNSURE, belief, average, reason)
        if average < self._sure_above:
            reason = f"the scans agree with the map by no more than {100.0 * average:.0f} %"
            return Trust(State.UNSURE, belief, average, reason)
        return Trust(State.LOCALISED, belief, average, "")
