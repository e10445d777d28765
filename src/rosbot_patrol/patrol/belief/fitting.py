"""Fit of a network's calibration to pictures with boxes and truth, real or simulated.

P(score | person) is counted over the pictures that show a person, no box included. P(score | nobody) is counted over
the places of a picture where nobody is: as many as boxes of a size fit side by side. Few data are smoothed towards
coarser tables (Dirichlet), in the end towards the cautious one; correlated pictures count as fewer. The ratio of both
is made to rise with the score (isotonic regression). `rho` is the intraclass correlation of the ratios of one side.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Hashable, Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.errors import DetectorError
from rosbot_patrol.patrol.belief.calibration import CAUTIOUS, EDGES, SHAPE, Calibration, Condition

Array = NDArray[np.float64]

_TYPICAL = (0.08, 0.18, 0.37, 0.75)  # height of a box of each size class over the longer side of the picture
_ASPECT = 0.4  # width of a person over the height
_PRIOR = 2.0  # boxes that a coarser table's shares of the bins are worth
_PRIOR_BOXES = 0.5  # boxes that its rate of boxes is worth
_FEWEST_GROUPS = 8  # sides with several pictures, to fit rho


@dataclass
class Samples:
    """Counted pictures.

    Attributes:
        persons: condition and score (0: no box) of each picture of a person, by side; sides are any hashable key.
        false: likewise of boxes where nobody is.
        silent: pictures of a part of the view without a false box, by side.
        pictures: number of pictures by light (bright, dark).
    """

    persons: dict[Hashable, list[tuple[Condition, float]]] = field(default_factory=lambda: defaultdict(list))
    false: dict[Hashable, list[tuple[Condition, float]]] = field(default_factory=lambda: defaultdict(list))
    silent: dict[Hashable, int] = field(default_factory=lambda: defaultdict(int))
    pictures: list[int] = field(default_factory=lambda: [0, 0])

    @property
    def has_sides(self) -> bool:
        """Whether enough sides have several pictures to fit rho."""
        return sum(len(found) > 1 for found in self.persons.values()) >= _FEWEST_GROUPS


def outcome(score: float) -> int:
    """Index of what a picture said: 0 for no box, else the bin of the score."""
    return int(np.clip(np.searchsorted(EDGES, score, side="right"), 0, len(EDGES) - 1))


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
        return _tables(samples, network, sha256, CAUTIOUS.rho, person_worth=1.0, nobody_worth=1.0)
    first = _tables(samples, network, sha256, CAUTIOUS.rho, person_worth=0.3, nobody_worth=0.3)
    persons, nobodies = _ratios(samples, first)
    rho_person, rho_nobody = intraclass_correlation(persons), intraclass_correlation(nobodies)
    rho = float(np.clip(0.5 * (rho_person + rho_nobody), 0.05, 0.95))
    worth = [1.0 / (1.0 + (_mean_size(groups) - 1.0) * rho) for groups in (persons, nobodies)]
    return _tables(samples, network, sha256, rho, person_worth=worth[0], nobody_worth=worth[1])


def intraclass_correlation(groups: Sequence[Sequence[float]]) -> float:
    """Share of the variance that lies between groups (one-way analysis of variance), 0 to 1."""
    kept = [np.asarray(group, np.float64) for group in groups if len(group) > 1]
    total = sum(map(len, kept))
    if len(kept) < 2 or total <= len(kept):
        return CAUTIOUS.rho
    mean = sum(float(group.sum()) for group in kept) / total
    between = sum(len(group) * (float(group.mean()) - mean) ** 2 for group in kept) / (len(kept) - 1)
    within = sum(float(((group - group.mean()) ** 2).sum()) for group in kept) / (total - len(kept))
    size = (total - sum(len(group) ** 2 for group in kept) / total) / (len(kept) - 1)
    if between + (size - 1.0) * within <= 0.0:
        return CAUTIOUS.rho
    return float(np.clip((between - within) / (between + (size - 1.0) * within), 0.0, 1.0))


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


def _ratios(samples: Samples, calibration: Calibration) -> tuple[list[list[float]], list[list[float]]]:
    def ratio(at: Condition, score: float) -> float:
        return calibration.box_ratio(score, at) if score > 0.0 else calibration.miss_ratio(at, 0.0)

    persons = [[ratio(*each) for each in found] for found in samples.persons.values()]
    silence = calibration.miss_ratio(Condition(_TYPICAL[2]), 0.0)
    nobodies = [
        [ratio(*each) for each in samples.false.get(side, ())] + [silence] * samples.silent.get(side, 0)
        for side in {*samples.false, *samples.silent}
    ]
    return persons, nobodies


def _mean_size(groups: Iterable[Sequence[float]]) -> float:
    sizes = [len(group) for group in groups if group]
    return sum(sizes) / max(len(sizes), 1)


def _tables(
    samples: Samples, network: str, sha256: str, rho: float, *, person_worth: float, nobody_worth: float
) -> Calibration:
    person, nobody = np.zeros(SHAPE), np.zeros(SHAPE)
    for found in samples.persons.values():
        for at, score in found:
            person[at.cell][outcome(score)] += person_worth
    for found in samples.false.values():
        for at, score in found:
            nobody[at.cell][outcome(score)] += nobody_worth
    for size, cut, dark in np.ndindex(*SHAPE[:3]):
        seen = samples.pictures[dark] * places(size, is_cut=bool(cut)) * nobody_worth
        nobody[size, cut, dark, 0] = max(seen - nobody[size, cut, dark, 1:].sum(), 0.0)
    person, nobody = _smooth(person, CAUTIOUS.person), _smooth(nobody, CAUTIOUS.nobody)
    for cell in np.ndindex(*SHAPE[:3]):
        _make_rising(person[cell], nobody[cell])
    return Calibration(network, sha256, rho, person, nobody)


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
