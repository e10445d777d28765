"""All parameters of the belief: one table. What depends on the network is not here but in its calibration."""

from __future__ import annotations

import math
from dataclasses import dataclass

from rosbot_patrol.params import param


@dataclass(frozen=True, kw_only=True)
class BeliefParams:
    """Parameters of the belief."""

    prior: float = param(0.01, lo=1e-6, hi=0.5, doc="probability of a person at any one place, before anything is seen")
    confirmed_above: float = param(0.95, lo=0.5, hi=1.0, doc="posterior above which a person is confirmed")
    clear_below: float = param(0.05, lo=0.0, hi=0.5, doc="posterior below which a place counts as empty")
    pets: float = param(0.004, lo=1e-6, hi=0.2, doc="probability of a pet at any one place")
    pictures: float = param(
        0.002, lo=1e-6, hi=0.2, doc="probability of a picture of a person, or the like, at any one place"
    )
    side_rho: float = param(
        0.3, lo=0.0, hi=1.0, doc="correlation of false boxes at one place from two sides: a lamp is one from everywhere"
    )
    size_rho: float = param(0.7, lo=0.0, hi=1.0, doc="correlation of the sizes measured in two images from one side")
    motion_ratio: float = param(20.0, lo=1.0, doc="likelihood ratio of an object that the lidar sees move")
    picture_most: float = param(6.0, lo=0.5, doc="maximum log-likelihood ratio of one picture")
    side_angle: float = param(
        0.6, unit="rad", lo=0.05, hi=3.1, doc="viewing directions this far apart count as separate sides"
    )
    side_nearer: float = param(
        0.7, lo=0.1, hi=1.0, doc="ratio of distances below which a view from the same direction is another side"
    )
    gate: float = param(3.0, lo=0.5, doc="maximum distance of a box from its hypothesis, in standard deviations")
    speed: float = param(1.0, unit="m/s", lo=0.0, doc="maximum speed of a person, three standard deviations")
    walked_most: float = param(4.0, unit="m", lo=0.0, doc="limit of the distance walked since the last sighting")
    merge: float = param(0.7, unit="m", lo=0.0, doc="closer hypotheses are one, unless pictures show them side by side")
    whole_from: float = param(1.7, unit="m", lo=0.3, doc="distance from which a standing person shows whole")
    view_range: float = param(8.0, unit="m", lo=0.5, doc="range within which a missing box is evidence")
    person_top_min: float = param(
        0.9, unit="m", lo=0.0, doc="height of a top at which person and pet are equally likely"
    )
    size_spread: float = param(
        0.15, unit="m", lo=0.01, doc="standard deviation of the tops of large pets and of persons who crouch"
    )
    person_top_max: float = param(2.3, unit="m", lo=0.5, doc="maximum height of a person's top")
    person_height_min: float = param(0.3, unit="m", lo=0.0, doc="minimum visible height of a person")
    person_width_max: float = param(2.2, unit="m", lo=0.5, doc="maximum width of a person")
    lying_length: float = param(
        1.25, unit="m", lo=0.3, doc="minimum width at which something low may be a person who lies or crawls"
    )
    outside_after: float = param(
        1.0, unit="m", lo=0.0, doc="distance from the map's free floor beyond which a place is outside the house"
    )
    gain_least: float = param(0.02, unit="nat", lo=0.0, doc="minimum expected gain of a second look")

    @property
    def prior_log_odds(self) -> float:
        """Log-odds of the prior."""
        return math.log(self.prior / (1.0 - self.prior))
