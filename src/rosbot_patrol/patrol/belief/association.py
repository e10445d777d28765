"""Which box belongs to which hypothesis: the likeliest by its place in the map, one box each, within a gate.

A hypothesis has a normal distribution (Blackman and Popoli, Design and Analysis of Modern Tracking Systems, 1999, 6.2).
The Mahalanobis distance alone would give one whose place is unsure the boxes of others.

Every box has a place with a covariance. One that was not measured lies somewhere along its bearing: about as far off as
a person of its height would be, with an error of half that distance. So a bearing alone is a long, thin covariance.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.patrol.belief.hypothesis import Hypothesis
from rosbot_patrol.patrol.belief.params import BeliefParams
from rosbot_patrol.patrol.records.inputs import Box, Eye
from rosbot_patrol.patrol.visibility.coverage import Sight

Array = NDArray[np.float64]

_TALL = 1.6  # [m] assumed height of an object that was not measured
_FAR_ERROR = 1.5  # [m] error along the bearing of what the lidar and the map only bound
_ASIDE = 0.04  # error across the bearing for each metre: half a body at 4 m
_PART = 0.5  # [m] added for an object that the image border cuts: only a part of it was measured
_BODY = 0.2  # [m] from the front of a body, where it ends a beam, to its middle
_INSIDE = 0.85  # share of the smaller box that lies in the larger one if it is a part of its object
_OVERLAP = 0.5  # share of the narrower box's columns that two boxes of one object have in common


@dataclass(frozen=True)
class Located:
    """A box with its place in map [m], shape (2,), and covariance [m2], shape (2, 2)."""

    box: Box
    place: Array
    spread: Array


def locate(box: Box, eye: Eye, sight: Sight | None = None) -> Located:
    """Give a box a place and a covariance; what was not measured stands before the end of the free way."""
    m = box.measured
    if m is not None:
        error = math.hypot(m.error, _PART if m.is_cut_aside else 0.0)
        return Located(box, np.array([m.x, m.y]), np.eye(2) * error**2)
    bearing = eye.pose.yaw + eye.bearing((box.xmin + box.xmax) / 2.0)
    if box.doubt is not None:
        place, along = np.array(box.doubt), _FAR_ERROR
        away = math.hypot(place[0] - eye.pose.x, place[1] - eye.pose.y)
    else:
        focal = 0.5 * eye.columns / math.tan(0.5 * eye.width)
        away = max(min(focal * _TALL / max(box.height, 1), _reach(sight, bearing)), 0.5)
        along = 0.5 * away
        place = np.array([eye.pose.x + away * math.cos(bearing), eye.pose.y + away * math.sin(bearing)])
    turn = np.array([[math.cos(bearing), -math.sin(bearing)], [math.sin(bearing), math.cos(bearing)]])
    return Located(box, place, turn @ np.diag([along**2, (0.1 + _ASIDE * away) ** 2]) @ turn.T)


def _reach(sight: Sight | None, bearing: float) -> float:
    """Free way along a bearing and a body more [m], inf where nobody knows."""
    if sight is None:
        return math.inf
    turn = (bearing - sight.first) * math.copysign(1.0, sight.step) % math.tau
    beam = round(turn / abs(sight.step))
    return float(sight.lengths[beam]) + _BODY if beam < len(sight.lengths) else math.inf


def distinct(located: Sequence[Located], params: BeliefParams) -> list[Located]:
    """The boxes of one picture, of several boxes around one object only the surest.

    A box that was not measured may stand where any other stands that it overlaps: then the measured one counts. A box
    inside another is a part of its object, whatever is measured there.
    """
    kept: list[Located] = []
    for each in sorted(located, key=lambda item: (item.box.measured is None, -item.box.probability)):
        if not any(_is_same(each, other, params) for other in kept):
            kept.append(each)
    return kept


def overlap(a: Box, b: Box) -> bool:
    """Whether two boxes share so many columns that they may be of one object."""
    return min(a.xmax, b.xmax) - max(a.xmin, b.xmin) > _OVERLAP * min(a.width, b.width)


def _is_same(a: Located, b: Located, params: BeliefParams) -> bool:
    apart = a.place - b.place
    gap = math.sqrt(float(apart @ np.linalg.solve(a.spread + b.spread, apart)))
    is_near = float(np.hypot(*apart)) < params.merge or gap <= params.gate
    return _is_inside(a.box, b.box) or (overlap(a.box, b.box) and is_near)


def _is_inside(a: Box, b: Box) -> bool:
    wide, high = min(a.xmax, b.xmax) - max(a.xmin, b.xmin), min(a.ymax, b.ymax) - max(a.ymin, b.ymin)
    smaller = min(a.width * a.height, b.width * b.height)
    return wide > 0 and high > 0 and wide * high > _INSIDE * smaller


def assign(
    hypotheses: Sequence[Hypothesis], located: Sequence[Located], now: float, params: BeliefParams
) -> list[Hypothesis | None]:
    """The hypothesis of each box, None for a new one; greedy by likelihood, each hypothesis once.

    Args:
        hypotheses: that exist.
        located: boxes of one picture.
        now: time of the picture [s], steady.
        params: gate and speed.
    """
    pairs = []
    for i, each in enumerate(located):
        for k, hypothesis in enumerate(hypotheses):
            gap, size = _distance(each, hypothesis, now, params)
            if gap <= params.gate:
                pairs.append((gap**2 + 2.0 * math.log(size), i, k))
    found: list[Hypothesis | None] = [None] * len(located)
    taken: set[int] = set()
    for _, i, k in sorted(pairs):
        if found[i] is None and k not in taken:
            found[i] = hypotheses[k]
            taken.add(k)
    return found


def _distance(each: Located, hypothesis: Hypothesis, now: float, params: BeliefParams) -> tuple[float, float]:
    """Distance of a box from a hypothesis in standard deviations, and the size of these [m2]."""
    apart = each.place - hypothesis.place
    spread = hypothesis.spread_at(now, params) + each.spread
    return math.sqrt(float(apart @ np.linalg.solve(spread, apart))), math.sqrt(float(np.linalg.det(spread)))
