"""From where to look again: the viewpoint with the greatest expected gain for each metre of way.

The gain is the expected fall of the entropy of the most open hypothesis. What a look will say is not known, so each
outcome (no box, or a score in one of the bins) counts with its probability under the present belief.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.patrol.belief.belief import Belief
from rosbot_patrol.patrol.belief.calibration import Condition
from rosbot_patrol.patrol.belief.hypothesis import Hypothesis, Side, entropy, posterior, urn
from rosbot_patrol.patrol.belief.likelihoods import Evidence
from rosbot_patrol.patrol.belief.params import BeliefParams
from rosbot_patrol.patrol.visibility.viewpoints import Viewpoint

Array = NDArray[np.float64]

_PICTURES = 12  # of a look
_SIZE = 3.0  # log-likelihood ratio of a first size, for a person
_TURN = 1.5  # [m] cost of one look, as additional driving distance


def best_second_look(
    belief: Belief, hypothesis: Hypothesis, candidates: Iterable[Viewpoint], columns_over_focal: float = 1.155
) -> Viewpoint | None:
    """The candidate with the greatest expected gain for its way; None if none is worth it.

    Args:
        belief: present.
        hypothesis: to be looked at.
        candidates: viewpoints with a free line to it.
        columns_over_focal: width of the picture over the focal length.
    """
    priced = [
        (expected_gain(belief, hypothesis, view.pose, columns_over_focal) / (view.way + _TURN), view)
        for view in candidates
    ]
    priced = [(worth, view) for worth, view in priced if worth * (view.way + _TURN) >= belief.params.gain_least]
    return max(priced, key=lambda pair: pair[0], default=(0.0, None))[1]


def expected_gain(belief: Belief, hypothesis: Hypothesis, eye: Pose2D, columns_over_focal: float = 1.155) -> float:
    """Expected fall of a hypothesis's entropy by a look from a place [nat]."""
    calibration, p = belief.likelihoods.calibration, belief.params
    _, away = hypothesis.from_place(eye)
    if away > p.view_range or (away < p.whole_from and hypothesis.is_near_only):
        return 0.0
    at = Condition(hypothesis.height / max(away, 0.3) / columns_over_focal)
    person, nobody = belief.likelihoods.chances(at)
    side = hypothesis.find_side(eye, p) or Side(eye)
    is_near = away < p.whole_from
    size, more = hypothesis.size(p), _size_of_another_side(hypothesis, p)
    if is_near or side.sizes:
        more = np.zeros(2)
    now = belief.posterior(hypothesis)
    after = 0.0
    for k in np.flatnonzero(person > 0.0):
        one, none = (
            urn(side.counts, int(k), chances, rho)
            for chances, rho in ((person, calibration.rho_person), (nobody, calibration.rho_nobody))
        )
        imagined = Side(eye, side.counts.copy())
        for _ in range(_PICTURES):
            imagined.add(Evidence(int(k), person, nobody, is_near=is_near), calibration)
        then = posterior(
            hypothesis.near + imagined.near,
            _wholes(hypothesis, side, imagined),
            size + more if k else size,
            p,
            calibration.fooled,
        )
        after += (now * one + (1.0 - now) * none) * entropy(then)
    return entropy(now) - after


def _wholes(hypothesis: Hypothesis, side: Side, imagined: Side) -> Array:
    """What each side says of the whole after a look from one of them, or from a new one, shape (S,)."""
    known = [each.whole + imagined.whole if each is side else each.whole for each in hypothesis.sides]
    is_new = not any(each is side for each in hypothesis.sides)
    return np.array([*known, imagined.whole] if is_new else known)


def _size_of_another_side(hypothesis: Hypothesis, params: BeliefParams) -> Array:
    """Log-likelihood ratios of size that a new side will likely give, shape (2,): those of the known ones."""
    known = [side.size(params) for side in hypothesis.sides if side.sizes]
    return np.mean(known, axis=0) if known else np.full(2, _SIZE)
