"""What one picture says about one place: how likely it is with a person there, with nobody, and with a look-alike.

The score, or the lack of a box, tells a person from nobody. It does not tell a person from a pet, a poster or a statue:
networks take those for persons. Size tells a person from a pet, depth from a picture. Let q be the probability that a
person, and not such a look-alike, has what was measured: it contributes log(q / (1 - q)). A box without a measure, or
so near that a pet looks like a person, contributes nothing and needs a second look.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.patrol.belief.calibration import Calibration, Condition, outcome
from rosbot_patrol.patrol.belief.params import BeliefParams
from rosbot_patrol.patrol.records.inputs import Box, Eye, Measured

Array = NDArray[np.float64]

_LEAST = 0.02  # smallest q, and 1 less the largest: no single measurement is sure
_PART = 0.7  # largest q of what a pet or a picture may show, too: short legs; a size without knowing if it is flat
_FLAT_WITHIN = 4.0  # [m] nearer than this depth cameras see pictures; what they do not see is dark clothes
_DOGS_LEG, _LEG_SPREAD = 0.5, 0.05  # [m] length of the longest legs of dogs, and its spread
_NEAR_ERROR = 0.35  # [m] error of a place by the floor up to which it tells the size
_LOWEST = 16  # [px] height below which a box shows nothing
_SHAPES = 0.15, 8.0  # height over width that a box of an object can have
_EDGE = 3  # [px] distance from the image border at which a box counts as cut


class Veto(Enum):
    """Reason why something is no intruder; the value is the sentence."""

    KNOWN = "it is a known object"
    OUTSIDE = "it is outside of the floor that the map shows"
    FLAT = "it is flat, a picture or a screen"
    LARGE = "it is too large for a person"
    PET = "it is as low as a pet"
    SMALL = "it is too small for a person"


@dataclass(frozen=True)
class Evidence:
    """What a picture says about a place.

    Attributes:
        outcome: 0 for no box, else the bin of its score.
        person, nobody: probability of each outcome, shape (N,).
        size: log-likelihood ratios of size and depth, of a person against a pet and against a picture, shape (2,); None
            where there is no box, or it is too near or too far off to be measured.
        weight: probability that the place was in view.
        is_near: only a part of the object is in view, for which any network takes a pet's as well.
        veto: why it is likely no person, None if it may be one.
    """

    outcome: int
    person: Array
    nobody: Array
    size: Array | None = None
    weight: float = 1.0
    is_near: bool = False
    veto: Veto | None = None

    def with_false_boxes(self, chance: float) -> Evidence:
        """The same where nobody gives a box with a probability of at least `chance`."""
        boxes = float(self.nobody[1:].sum())
        if chance <= boxes:
            return self
        raised = np.concatenate(([1.0 - chance], self.nobody[1:] / boxes * chance))
        return replace(self, nobody=raised)


class Likelihoods:
    """Judges boxes, and the lack of them.

    Args:
        calibration: of the network.
        params: sizes of persons.
        threshold: of the detector; lower boxes never arrive.
    """

    def __init__(self, calibration: Calibration, params: BeliefParams, threshold: float) -> None:
        self.calibration, self.params, self.threshold = calibration, params, threshold

    def box(self, box: Box, eye: Eye, *, is_dark: bool = False) -> Evidence:
        """Judge a box of a picture that was taken from `eye`."""
        at = Condition(box.height / eye.columns, is_cut(box, eye), is_dark)
        size, is_near, veto = self._size(box)
        return Evidence(outcome(box.probability), *self.chances(at), size=size, is_near=is_near, veto=veto)

    def miss(self, at: Condition, seen: float, *, is_near: bool = False) -> Evidence:
        """Judge a picture without a box at a place.

        Args:
            at: condition under which a person there would have been seen.
            seen: probability that the place was in view.
            is_near: so near that only a part of somebody there would have been in view.
        """
        return Evidence(0, *self.chances(at), weight=seen, is_near=is_near)

    def chances(self, at: Condition) -> tuple[Array, Array]:
        """Probability of each outcome with a person and with nobody; their ratio is bounded by `picture_most`."""
        person, nobody = (self.calibration.chances(at, self.threshold, is_person=each) for each in (True, False))
        least = math.exp(-self.params.picture_most)
        return _raised(person, least * nobody), _raised(nobody, least * person)

    def _size(self, box: Box) -> tuple[Array | None, bool, Veto | None]:
        m = box.measured
        if self.is_near(box) and not (m is not None and m.is_flat):
            return None, True, None
        found = possibility(box, self.params)
        if m is None or found is None:
            return None, False, None
        _, veto = found
        against = _against_each(box, m, self.params).clip(_LEAST, 1.0 - _LEAST)
        return np.log(against / (1.0 - against)), bool(m.has_legs), veto

    def is_near(self, box: Box) -> bool:
        """Whether so little of it is in the picture that a person and a pet look alike: legs, or a part at its side."""
        m, p = box.measured, self.params
        if (
            box.label != "person"
            or m is None
            or m.has_legs
            or not _has_size(m)
            or not (goes_on(box, m) or m.is_cut_aside)
        ):
            return False
        return m.top < p.person_top_min and m.width < p.lying_length


def _raised(chances: Array, least: Array) -> Array:
    """Probabilities of boxes of at least so much; the rest is that of none."""
    boxes = np.maximum(chances[1:], least[1:])
    return np.concatenate(([1.0 - boxes.sum()], boxes))


def is_plausible(box: Box) -> bool:
    """Whether a box has a score and a shape that an object can have."""
    if not 0.0 < box.probability <= 1.0 or box.width <= 0 or box.height < _LOWEST:
        return False
    return _SHAPES[0] <= box.height / box.width <= _SHAPES[1]


def is_cut(box: Box, eye: Eye) -> bool:
    """Whether the left or right image border cuts a box."""
    return box.xmin <= _EDGE or box.xmax >= eye.columns - _EDGE


def possibility(box: Box, params: BeliefParams) -> tuple[float, Veto | None] | None:
    """Probability that a person has a box's size and depth, and what speaks against it; None if it is not measured."""
    m = box.measured
    if m is None:
        return None
    if m.is_flat:
        return _LEAST, Veto.FLAT
    if box.label != "person":  # things come in all sizes
        return None if m.is_cut_aside else (1.0 - _LEAST, None)
    if not _has_size(m):
        return None
    shares = _shares(box, m, params)
    veto = min(shares, key=lambda each: shares[each])
    q = min(max(shares[veto], _LEAST), 1.0 - _LEAST)
    return q, veto if q < 0.5 else None


def _against_each(box: Box, m: Measured, params: BeliefParams) -> Array:
    """Probability that a person has a box's size and depth, and no pet, and no picture, shape (2,)."""
    if m.is_flat:
        return np.array([0.5, _LEAST])
    if box.label != "person":
        return np.full(2, 1.0)
    shares = _shares(box, m, params)
    body = min(shares[veto] for veto in shares if veto is not Veto.PET)
    pet, picture = min(body, shares.get(Veto.PET, 1.0)), body
    if m.has_legs:
        pet = min(pet, max(_PART, _taller_than_a_leg(m)))
    elif m.is_flat is None and m.away > _FLAT_WITHIN and m.source != "lidar":  # what the lidar sees stands out
        picture = min(picture, _PART)
    return np.array([pet, picture])


def _shares(box: Box, m: Measured, p: BeliefParams) -> dict[Veto, float]:
    """Probability of the size under each limit, by the spread of bodies and the error of the distance."""
    error = math.hypot(p.size_spread, m.error / max(m.away, 0.5) * max(m.top, 0.5))
    shares = {
        Veto.LARGE: min(_normal((p.person_top_max - m.top) / error), _normal((p.person_width_max - m.width) / error))
    }
    lying = _normal((m.width - p.lying_length) / error)
    if not m.has_legs:  # of legs right before the camera only the lowest part is in the picture
        shares[Veto.PET] = max(_normal((m.top - p.person_top_min) / error), lying)
    if not (goes_on(box, m) or m.is_cut_aside):  # else it is larger than what the picture shows
        shares[Veto.SMALL] = max(_normal((m.height - p.person_height_min) / error), lying)
    return shares


def _taller_than_a_leg(m: Measured) -> float:
    """Probability that what stands straight up to a height is no leg of a large dog."""
    error = math.hypot(_LEG_SPREAD, m.error / max(m.away, 0.5) * max(m.top, 0.5))
    return _normal((m.top - _DOGS_LEG) / error)


def _normal(z: float) -> float:
    """Cumulative standard normal distribution."""
    return 0.5 * (1.0 + math.erf(z / math.sqrt(2.0)))


def _has_size(m: Measured) -> bool:
    """Whether the distance is known well enough to know the size."""
    return m.source != "floor" or m.error <= _NEAR_ERROR


def goes_on(box: Box, m: Measured) -> bool:
    """Whether the object may go on above the picture."""
    return m.is_cut_above or (m.is_cut and box.ymin <= box.slack)
