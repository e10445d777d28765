"""Fit of a network's calibration to pictures with boxes and truth, real or simulated.

P(score | person) is counted over the pictures that show a person, no box included. P(score | nobody) is counted over
the places of a picture where nobody is: as many as boxes of a size fit side by side. Few data are smoothed towards
coarser tables (Dirichlet), in the end towards the cautious one; correlated pictures count as fewer. The ratio of both
is made to rise with the score (isotonic regression). The correlations are those under which the sides of the pictures
are most likely, by the urn of `hypothesis.Side`.
"""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Hashable, Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.errors import DetectorError
from rosbot_patrol.patrol.belief.calibration import CAUTIOUS, SHAPE, Calibration, Condition, outcome

Array = NDArray[np.float64]

_TYPICAL = (0.08, 0.18, 0.37, 0.75)  # height of a box of each size class over the longer side of the picture
_ASPECT = 0.4  # width of a person over the height
_PRIOR = 2.0  # boxes that a coarser table's shares of the bins are worth
_PRIOR_BOXES = 0.5  # boxes that its rate of boxes is worth
_RHOS = tuple(k / 50.0 for k in range(1, 50))
_RHO_LEAST = 0.3  # with nobody: few boxes are persistent, and those are too few to show in some hundred sides
_BOX = 0.1  # score from which a box around a pet counts
_FOOLED_LEAST, _FOOLED_MOST = 0.01, 0.95  # no network is surely fooled, or never
_FEWEST_GROUPS = 8  # sides with several pictures, to fit rho


@dataclass
class Samples:
    """Counted pictures.

    Attributes:
        persons: condition and score (0: no box) of each picture of a person, by side; sides are any hashable key.
        false: likewise of boxes where nobody is.
        silent: pictures of a part of the view without a false box, by side.
        pets: score (0: no box) of each picture of a pet, by side.
        pictures: number of pictures by light (bright, dark).
    """

    persons: dict[Hashable, list[tuple[Condition, float]]] = field(default_factory=lambda: defaultdict(list))
    false: dict[Hashable, list[tuple[Condition, float]]] = field(default_factory=lambda: defaultdict(list))
    silent: dict[Hashable, int] = field(default_factory=lambda: defaultdict(int))
    pets: dict[Hashable, list[float]] = field(default_factory=lambda: defaultdict(list))
    pictures: list[int] = field(default_factory=lambda: [0, 0])

    @property
    def has_sides(self) -> bool:
        """Whether enough sides have several pictures to fit rho."""
        return sum(len(found) > 1 for found in self.persons.values()) >= _FEWEST_GROUPS


def places(size: int, *, is_cut: bool) -> float:
    """Number of places of a size class in one picture."""
    return 2.0 if is_cut else max(1.0 / (_ASPECT * _TYPICAL[size]) - 2.0, 1.0)


def fit(samples: Samples, network: str, sha256: str) -> Calibration:
    """Fit a calibration.

    Raises:
        DetectorError: there is no picture of a person.
    """
    if not any(samples.persons.values()):
        raise DetectorError(f"'{network}' cannot be calibrated: no picture shows a person")
    if not samples.has_sides:
        return _tables(samples, network, sha256, rhos=(CAUTIOUS.rho_person, CAUTIOUS.rho_nobody), worths=(1.0, 1.0))
    first = _tables(samples, network, sha256, rhos=(CAUTIOUS.rho_person, CAUTIOUS.rho_nobody), worths=(0.3, 0.3))
    persons = [[(first.person[at.cell], outcome(score)) for at, score in found] for found in samples.persons.values()]
    silence = first.nobody[Condition(_TYPICAL[2]).cell]
    nobodies = [
        [(first.nobody[at.cell], outcome(score)) for at, score in samples.false.get(side, ())]
        + [(silence, 0)] * samples.silent.get(side, 0)
        for side in {**samples.false, **samples.silent}
    ]
    rhos = fit_rho(persons), max(fit_rho(nobodies), _RHO_LEAST)
    worths = tuple(1.0 / (1.0 + (_mean_size(g) - 1.0) * rho) for g, rho in zip((persons, nobodies), rhos, strict=True))
    return _tables(samples, network, sha256, rhos=rhos, worths=(worths[0], worths[1]))


def fit_fooled(samples: Samples) -> float:
    """Probability that a pet fools the network: how often pets have boxes, as a share of how often persons have."""
    if not samples.pets:
        return CAUTIOUS.fooled
    pets = [_share(scores) for scores in samples.pets.values()]
    persons = [_share(score for _, score in found) for found in samples.persons.values()]
    fooled = (sum(pets) + _PRIOR_BOXES) / (len(pets) + 1.0)
    found = max(sum(persons) / len(persons), fooled)
    return min(max(fooled / found, _FOOLED_LEAST), _FOOLED_MOST)


def _share(scores: Iterable[float]) -> float:
    """Share of pictures with a box that counts."""
    found = [score >= _BOX for score in scores]
    return sum(found) / len(found)


def fit_rho(sides: Sequence[Sequence[tuple[Array, int]]]) -> float:
    """The correlation under which sides are most likely.

    Args:
        sides: of each picture of each side the probabilities of the outcomes, and the outcome.
    """
    groups = Counter(tuple((float(chances[0]), k > 0) for chances, k in side) for side in sides if len(side) > 1)
    if len(groups) < 2:
        return CAUTIOUS.rho_nobody

    def likelihood(rho: float) -> float:
        return sum(count * _log_likelihood(group, (1.0 - rho) / rho) for group, count in groups.items())

    return max(_RHOS, key=likelihood)


def _log_likelihood(side: Sequence[tuple[float, bool]], strength: float) -> float:
    """Of one side's boxes by the urn: of each picture the probability of no box, and whether there was one."""
    boxes, told = 0, 0.0
    for n, (silence, is_box) in enumerate(side):
        chance = (boxes + strength * (1.0 - silence)) / (n + strength)
        told += math.log(chance if is_box else 1.0 - chance)
        boxes += is_box
    return told


def rising(values: Array, weights: Array) -> Array:
    """The nearest values that never fall (isotonic regression, pool adjacent violators)."""
    blocks: list[list[float]] = []  # value, weight, count
    for value, weight in zip(values, weights, strict=True):
        blocks.append([float(value), float(weight), 1.0])
        while len(blocks) > 1 and blocks[-2][0] > blocks[-1][0]:
            last, before = blocks.pop(), blocks.pop()
            both = before[1] + last[1]
            blocks.append([(before[0] * before[1] + last[0] * last[1]) / both, both, before[2] + last[2]])
    return np.concatenate([np.full(int(count), value) for value, _, count in blocks])


def _mean_size(groups: Iterable[Sequence[object]]) -> float:
    sizes = [len(group) for group in groups if group]
    return sum(sizes) / max(len(sizes), 1)


def _tables(
    samples: Samples, network: str, sha256: str, *, rhos: tuple[float, float], worths: tuple[float, float]
) -> Calibration:
    """The tables of the calibration; correlated pictures are worth less than independent ones."""
    person, nobody = np.zeros(SHAPE), np.zeros(SHAPE)
    for found in samples.persons.values():
        for at, score in found:
            person[at.cell][outcome(score)] += worths[0]
    for found in samples.false.values():
        for at, score in found:
            nobody[at.cell][outcome(score)] += worths[1]
    for size, cut, dark in np.ndindex(*SHAPE[:3]):
        seen = samples.pictures[dark] * places(size, is_cut=bool(cut)) * worths[1]
        nobody[size, cut, dark, 0] = max(seen - nobody[size, cut, dark, 1:].sum(), 0.0)
    person, nobody = _smooth(person, CAUTIOUS.person), _smooth(nobody, CAUTIOUS.nobody)
    for cell in np.ndindex(*SHAPE[:3]):
        _make_rising(person[cell], nobody[cell])
    return Calibration(network, sha256, rhos[0], rhos[1], person, nobody, fit_fooled(samples))


def _smooth(counts: Array, prior: Array) -> Array:
    """Probabilities: each cell towards its size class, that towards all, and all towards the cautious table."""
    everything = _towards(counts.sum(axis=(0, 1, 2)), prior.mean(axis=(0, 1, 2)))
    by_size = [_towards(each, everything) for each in counts.sum(axis=(1, 2))]
    out = np.empty_like(counts)
    for cell in np.ndindex(*counts.shape[:-1]):
        out[cell] = _towards(counts[cell], by_size[cell[0]])
    return out


def _towards(counts: Array, prior: Array) -> Array:
    """Probabilities of one row: the rate of boxes, and the shares of the bins among them, each smoothed."""
    total, boxes, rate = counts.sum(), counts[1:].sum(), prior[1:].sum()
    weight = _PRIOR_BOXES / rate  # pictures in which so many boxes are expected
    chance = min((boxes + _PRIOR_BOXES) / (total + weight), 0.99)
    shares = counts[1:] + _PRIOR * prior[1:] / rate
    return np.concatenate(([1.0 - chance], chance * shares / shares.sum()))


def _make_rising(person: Array, nobody: Array) -> None:
    """Make the ratio of two rows rise with the score, in place; the chance of any box stays."""
    boxes = person[1:].sum()
    ratios = rising(np.log(person[1:] / nobody[1:]), person[1:] + nobody[1:])
    told = nobody[1:] * np.exp(ratios)
    person[1:] = told * boxes / told.sum()
