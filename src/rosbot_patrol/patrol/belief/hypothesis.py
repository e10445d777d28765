"""One hypothesis: somebody may be at a place, with the evidence for it by side of view.

Four explanations compete: a person, a pet, a picture of a person, and nobody. The scores tell the others from nobody.
The size tells a person from a pet, and depth from a picture (`Side.size`). A picture fools every network, and so does a
part of a pet from near. Seen whole, a pet fools few networks: a missing box is expected there, but unlikely for a
person. So evidence from near (`Side.near`) and of the whole (`Side.whole`) is kept apart. Sides are independent and add
up. Pictures from one side are not independent: the same view is misjudged again and again.
"""

from __future__ import annotations

import math
import statistics
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.geometry import Pose2D, angle_difference, distance
from rosbot_patrol.patrol.belief.calibration import EDGES, Calibration
from rosbot_patrol.patrol.belief.likelihoods import Evidence, Veto
from rosbot_patrol.patrol.belief.params import BeliefParams
from rosbot_patrol.patrol.records.inputs import Box, Measured

Array = NDArray[np.float64]

_SAME_EYE = 0.3  # [m] cameras this near to each other see the same side, wherever the object is
_TOGETHER = 2  # pictures of two persons that tell them apart: one may be spoilt
_HEIGHT = 1.3  # [m] visible height that is expected before one was measured
_UNSEEN = 0.03  # probability that a network never finds somebody from one side: behind furniture, in a rare pose


@dataclass
class Side:
    """Evidence from one side.

    A Polya urn (`urn`) models the pictures of one side: each outcome raises its own later probability. A second picture
    with the same outcome adds little if pictures are much alike (rho near 1), and its full weight if independent.

    However many pictures show nobody, a person there may be one whom the network never finds from this side: the
    log-likelihood ratio has a lower limit.

    Attributes:
        eye: the camera when the side was first seen from there.
        counts: pictures with each outcome, as far as the place was in view.
        near_sum, whole_sum: log-likelihood ratio of what pictures from near and of the whole say, of a person against
            nobody.
        sizes, size_total: boxes, and sum of what their sizes say of a person against a pet and against a picture.
    """

    eye: Pose2D
    counts: Array = field(default_factory=lambda: np.zeros(len(EDGES)))
    near_sum: float = 0.0
    whole_sum: float = 0.0
    sizes: int = 0
    size_total: Array = field(default_factory=lambda: np.zeros(2))

    def add(self, evidence: Evidence, calibration: Calibration) -> None:
        """Take one picture's evidence."""
        told = self.told(evidence, calibration)
        if evidence.is_near:
            self.near_sum += told
        else:
            self.whole_sum += told
        self.counts[evidence.outcome] += evidence.weight
        if evidence.size is not None:
            self.sizes += 1
            self.size_total = self.size_total + evidence.size

    def told(self, evidence: Evidence, calibration: Calibration) -> float:
        """What a further picture would add to `near_sum` or `whole_sum`."""
        person, nobody = (
            1.0 - evidence.weight * (1.0 - urn(self.counts, evidence.outcome, chances, rho))
            for chances, rho in ((evidence.person, calibration.rho_person), (evidence.nobody, calibration.rho_nobody))
        )
        return math.log(person / nobody)

    @property
    def near(self) -> float:
        """Log-likelihood ratio of the pictures from near."""
        return max(self.near_sum, math.log(_UNSEEN))

    @property
    def whole(self) -> float:
        """Log-likelihood ratio of the pictures of the whole."""
        return max(self.whole_sum, math.log(_UNSEEN))

    @property
    def score(self) -> float:
        """Log-likelihood ratio of all pictures, of a person against nobody."""
        return self.near + self.whole

    def size(self, params: BeliefParams) -> Array:
        """Log-likelihood ratios of all sizes, shape (2,); n correlated ones are worth n / (1 + (n - 1) rho)."""
        return self.size_total / (1.0 + max(self.sizes - 1.0, 0.0) * params.size_rho)


def urn(counts: Array, outcome: int, chances: Array, rho: float) -> float:
    """Probability of the next outcome by Polya's urn: first whether there is a box, then the bin of its score.

    With the concentration s = (1 - rho) / rho an outcome of probability p has the probability (k + s p) / (n + s) after
    k of n pictures with it.

    Args:
        counts: pictures with each outcome so far, shape (N,); the first is that without a box.
        outcome: the next one.
        chances: probability of each outcome, shape (N,).
        rho: correlation of two pictures, between 0 and 1.
    """
    strength = (1.0 - rho) / rho
    total, boxes, chance = float(counts.sum()), float(counts[1:].sum()), float(chances[1:].sum())
    any_box = (boxes + strength * chance) / (total + strength)
    if outcome == 0:
        return 1.0 - any_box
    share = float(chances[outcome]) / chance
    return any_box * (float(counts[outcome]) + strength * share) / (boxes + strength)


@dataclass
class Hypothesis:
    """Somebody may be there.

    Without a place, size and depth tell nothing, and no look-alike competes.

    Attributes:
        number: of it, from 1 on.
        label: object class; is_placed: pictures of it tell where it is.
        place: x, y in map [m], shape (2,); spread: its covariance [m2], shape (2, 2); at: time of both [s].
        height: visible height when last measured [m].
        seen_at: time of the last picture with a box of it [s].
        together: pictures that likely showed a person here and another one elsewhere, by the other's number.
        sides: evidence; boxes: pictures with a box of it.
        against, possible: boxes with each reason against a person, and boxes without one.
        place_veto: reason by its place, None if there is none; known: name of the known object there.
        moved: log-likelihood ratio of its motion, 0 where the lidar saw none.
        may_walk: the lidar saw it move, or sees nothing; else it stays about where it is.
        is_confirmed: it was confirmed once, and stays so.
        second_looks: viewpoints that it was looked at from.
        scores: of its boxes; last: the newest one; measured: its newest measured place and size.
        best: the surest box; picture: stamp of its picture [s]; shown: all boxes of that picture.
    """

    number: int
    place: Array
    spread: Array
    at: float
    label: str = "person"
    is_placed: bool = True
    height: float = _HEIGHT
    seen_at: float = -math.inf
    together: Counter[int] = field(default_factory=Counter)
    sides: list[Side] = field(default_factory=list)
    boxes: int = 0
    against: Counter[Veto] = field(default_factory=Counter)
    possible: int = 0
    place_veto: Veto | None = None
    known: str = ""
    moved: float = 0.0
    may_walk: bool = True
    is_confirmed: bool = False
    second_looks: list[Pose2D] = field(default_factory=list)
    scores: list[float] = field(default_factory=list)
    last: Box | None = None
    measured: Measured | None = None
    best: Box | None = None
    picture: float = -math.inf
    shown: tuple[Box, ...] = ()

    @property
    def error(self) -> float:
        """Largest standard deviation of the place [m]."""
        return math.sqrt(float(np.linalg.eigvalsh(self.spread)[-1]))

    @property
    def veto(self) -> Veto | None:
        """Reason why it is no intruder: by its place, or as most boxes speak against a person."""
        if self.place_veto is not None or self.against.total() <= self.possible:
            return self.place_veto
        return self.against.most_common(1)[0][0]

    @property
    def veto_text(self) -> str:
        """The reason as a sentence, "" if there is none."""
        return "" if self.veto is None else f"it is {self.known}" if self.veto is Veto.KNOWN else self.veto.value

    @property
    def others(self) -> set[int]:
        """Numbers of those that are surely not the same person: pictures showed both at once."""
        return {number for number, pictures in self.together.items() if pictures >= _TOGETHER}

    @property
    def is_near_only(self) -> bool:
        """Whether all boxes of it were too near to tell a person from a pet."""
        return self.boxes > 0 and self.possible == 0 and not self.against

    @property
    def near(self) -> float:
        """Log-likelihood ratio of views from near and of motion, which person and pet have in common.

        The camera is low: from near, every side shows the legs. Legs that the network never finds are missed from all
        sides, so together these have the lower limit of one.
        """
        told = [side.near for side in self.sides]
        against = sum(each for each in told if each < 0.0)
        return sum(each for each in told if each > 0.0) + max(against, math.log(_UNSEEN)) + self.moved

    @property
    def wholes(self) -> Array:
        """Log-likelihood ratio of views of the whole from each side, shape (S,)."""
        return np.array([side.whole for side in self.sides])

    @property
    def probability(self) -> float:
        """Median of the scores of its boxes, 0 without boxes."""
        return statistics.median_low(self.scores) if self.scores else 0.0

    def size(self, params: BeliefParams) -> Array:
        """Log-likelihood ratios of size and depth, of a person against a pet and against a picture, shape (2,)."""
        if not self.is_placed:
            return np.full(2, math.inf)
        return sum((side.size(params) for side in self.sides), np.zeros(2))

    def posterior(self, params: BeliefParams, fooled: float) -> float:
        """Probability of a person there, by a network that a pet fools from this share of sides."""
        return posterior(self.near, self.wholes, self.size(params), params, fooled)

    def find_side(self, eye: Pose2D, params: BeliefParams) -> Side | None:
        """The known side that a camera sees, None if it is another one.

        Sides are told apart by the present place: a better place may show that two views are of one side.
        """
        bearing, away = self.from_place(eye)

        def is_this(side: Side) -> bool:
            if distance(side.eye, eye) < _SAME_EYE:
                return True
            other, far = self.from_place(side.eye)
            is_alike = min(far, away) > params.side_nearer * max(far, away)
            return abs(angle_difference(other, bearing)) <= params.side_angle and is_alike

        found = filter(is_this, self.sides)
        return min(found, key=lambda side: distance(side.eye, eye), default=None)

    def side(self, eye: Pose2D, params: BeliefParams) -> Side:
        """The side that a camera sees, a new one if it is another."""
        found = self.find_side(eye, params)
        if found is None:
            found = Side(eye)
            self.sides.append(found)
        return found

    def take(self, eye: Pose2D, evidence: Evidence, calibration: Calibration, params: BeliefParams) -> None:
        """Take what a picture from a camera says.

        What gives false boxes from one side does so from others: with nobody there, a box from a new side is as likely
        as `side_rho` times the share of pictures with one from the other sides, at least.
        """
        side = self.side(eye, params)
        others = sum((each.counts for each in self.sides if each is not side), np.zeros(len(EDGES)))
        share = float(others[1:].sum()) / (float(others.sum()) + 1.0)
        side.add(evidence.with_false_boxes(params.side_rho * share), calibration)

    def from_place(self, eye: Pose2D) -> tuple[float, float]:
        """Bearing [rad] and distance [m] of a camera from the place."""
        dx, dy = eye.x - float(self.place[0]), eye.y - float(self.place[1])
        return math.atan2(dy, dx), math.hypot(dx, dy)

    def spread_at(self, now: float, params: BeliefParams) -> Array:
        """Covariance of the place at a later time [m2]."""
        return self.spread + np.eye(2) * (self._walked(now, params) / 3.0) ** 2

    def move(self, place: Array, spread: Array, now: float, params: BeliefParams) -> None:
        """Take a measured place with its covariance (a Kalman update).

        A person who walks goes on in one direction: so the distance walked is one standard deviation here, not three.
        """
        before = self.spread + np.eye(2) * self._walked(now, params) ** 2
        gain = before @ np.linalg.inv(before + spread)
        self.place = self.place + gain @ (place - self.place)
        self.spread = (np.eye(2) - gain) @ before
        self.at = now

    def _walked(self, now: float, params: BeliefParams) -> float:
        """How far somebody may have walked since the place was measured [m]."""
        most = params.walked_most if self.may_walk else params.merge
        return min(params.speed * max(now - self.at, 0.0), most)

    def absorb(self, other: Hypothesis, params: BeliefParams) -> None:
        """Take in another hypothesis of the same object."""
        for side in other.sides:
            own = self.find_side(side.eye, params)
            if own is None:
                self.sides.append(side)
            elif side.score > own.score:  # of two counts of one side, the one with more for it
                self.sides[[each is own for each in self.sides].index(True)] = side
        self.boxes, self.possible = self.boxes + other.boxes, self.possible + other.possible
        self.scores += other.scores
        self.together += other.together
        self.together.pop(self.number, None)
        self.against += other.against
        self.moved = max(self.moved, other.moved)
        self.is_confirmed |= other.is_confirmed
        self.seen_at = max(self.seen_at, other.seen_at)

    def rename(self, gone: int, number: int) -> None:
        """Take note that another hypothesis has become a part of a third, or of this one."""
        pictures = self.together.pop(gone, 0)
        if pictures and number != self.number:
            self.together[number] += pictures

    def why(self, params: BeliefParams, fooled: float) -> str:
        """One sentence: what it is believed to be, and by what."""
        where = f"at about ({self.place[0]:.1f}, {self.place[1]:.1f})" if self.is_placed else "somewhere in view"
        share = self.posterior(params, fooled)
        if self.place_veto is not None or (self.veto is not None and share < params.clear_below):
            return f"what was seen {where} is no intruder: {self.veto_text}"
        said = [_said(side, self.from_place(side.eye)[1]) for side in self.sides]
        told = "; ".join(said) or "no picture tells"
        is_sized = self.is_placed and any(side.sizes for side in self.sides)
        pet, picture = self.size(params)
        size = f"; size {pet:+.1f} against a pet, depth {picture:+.1f} against a picture" if is_sized else ""
        near = "; it was too near to be told from a pet" if self.is_near_only else ""
        moved = "; the lidar saw it move" if self.moved else ""
        return f"a {self.label} {where} with probability {share:.0%}: {told}{size}{near}{moved}"


def _said(side: Side, away: float) -> str:
    boxes, silent = side.counts[1:].sum(), side.counts[0]
    return f"{boxes:.0f} boxes and {silent:.0f} pictures without one from {away:.1f} m ({side.score:+.1f})"


def posterior(near: float, wholes: Array, size: Array, params: BeliefParams, fooled: float) -> float:
    """Probability of a person, against a look-alike and nobody.

    A picture of a person is one for any network, from all sides. A pet, seen whole, fools the network from one side and
    not from the next.

    Args:
        near: log-likelihood ratio of views from near and of motion, of a person or look-alike against nobody.
        wholes: log-likelihood ratio of views of the whole from each side, of a person against nobody, shape (S,).
        size: log-likelihood ratios of size and depth, of a person against a pet and against a picture, shape (2,).
        params: prior of each.
        fooled: probability that a pet fools the network from one side.
    """
    whole = float(wholes.sum())
    as_pet = float(np.logaddexp(math.log(fooled) + wholes, math.log(1.0 - fooled)).sum())
    logs = (
        math.log(params.prior) + near + whole,
        math.log(params.pets) + near - float(size[0]) + as_pet,
        math.log(params.pictures) + near - float(size[1]) + whole,
        math.log(1.0 - params.prior - params.pets - params.pictures),
    )
    most = max(logs)
    shares = [math.exp(each - most) for each in logs]
    return shares[0] / sum(shares)


def entropy(share: float) -> float:
    """Entropy of a yes-or-no question [nat]."""
    return -sum(p * math.log(p) for p in (share, 1.0 - share) if p > 0.0)


def nearest(hypotheses: Iterable[Hypothesis], x: float, y: float) -> tuple[float, Hypothesis | None]:
    """Distance [m] of the nearest hypothesis, and it; inf and None if there is none."""
    pairs = [(math.hypot(float(h.place[0]) - x, float(h.place[1]) - y), h) for h in hypotheses]
    return min(pairs, key=lambda pair: pair[0], default=(math.inf, None))
