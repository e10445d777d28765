"""One hypothesis: somebody may be at a place, with the evidence for it by side of view.

Pictures from one side err alike. A side's n pictures are worth n / (1 + (n - 1) rho) independent ones, so its log-odds
are the mean of their log-likelihood ratios times that number. Sides are independent and add up.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.geometry import Pose2D, angle_difference
from rosbot_patrol.patrol.belief.calibration import Calibration
from rosbot_patrol.patrol.belief.likelihoods import Evidence, Veto
from rosbot_patrol.patrol.belief.params import BeliefParams
from rosbot_patrol.patrol.records.inputs import Box

Array = NDArray[np.float64]

_HEIGHT = 1.3  # [m] visible height that is expected before one was measured


@dataclass
class Side:
    """Evidence from one side.

    Attributes:
        bearing: from the place to the camera, in map [rad]; away: distance of the camera [m]; eye: its last pose.
        pictures, total: number of pictures that tell, and sum of their ratios.
        near_pictures, near_total: likewise of pictures that do not tell a person from a pet.
    """

    bearing: float
    away: float
    eye: Pose2D
    pictures: int = 0
    total: float = 0.0
    near_pictures: int = 0
    near_total: float = 0.0

    def add(self, evidence: Evidence) -> None:
        """Take one picture's evidence."""
        if evidence.is_near:
            self.near_pictures += 1
            self.near_total += evidence.ratio
        else:
            self.pictures += 1
            self.total += evidence.ratio

    def log_odds(self, calibration: Calibration) -> float:
        """Evidence of the pictures that tell."""
        return self.total / self.pictures * calibration.effective(self.pictures) if self.pictures else 0.0

    def near_log_odds(self, calibration: Calibration) -> float:
        """Evidence of the pictures that do not tell a person from a pet."""
        n = self.near_pictures
        return self.near_total / n * calibration.effective(n) if n else 0.0


@dataclass
class Hypothesis:
    """Somebody may be there.

    Attributes:
        number: of it, from 1 on.
        place: x, y in map [m], shape (2,); spread: its covariance [m2], shape (2, 2); at: time of both [s].
        height: visible height when last measured [m].
        seen_at: time of the last picture with a box of it [s].
        sides: evidence; boxes: pictures with a box of it.
        against, possible: boxes with each reason against a person, and boxes without one.
        place_veto: reason by its place, None if there is none.
        has_moved: the lidar saw it move.
        is_confirmed: it was confirmed once, and stays so.
        second_looks: viewpoints that it was looked at from.
        best: the surest box; picture: stamp of its picture [s]; shown: all boxes of that picture.
    """

    number: int
    place: Array
    spread: Array
    at: float
    height: float = _HEIGHT
    seen_at: float = -math.inf
    sides: list[Side] = field(default_factory=list)
    boxes: int = 0
    against: Counter[Veto] = field(default_factory=Counter)
    possible: int = 0
    place_veto: Veto | None = None
    has_moved: bool = False
    is_confirmed: bool = False
    second_looks: list[Pose2D] = field(default_factory=list)
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
        if self.place_veto is not None or not self.against:
            return self.place_veto
        reason, count = self.against.most_common(1)[0]
        return reason if self.against.total() > self.possible and count >= 1 else None

    @property
    def is_near_only(self) -> bool:
        """Whether all boxes of it were too near to tell a person from a pet."""
        return self.possible == 0 and not self.against and any(side.near_pictures for side in self.sides)

    def log_odds(self, calibration: Calibration, params: BeliefParams) -> float:
        """Log-odds of a person there."""
        told = sum(side.log_odds(calibration) for side in self.sides)
        near = min(sum(side.near_log_odds(calibration) for side in self.sides), params.near_most)
        moved = math.log(params.motion_ratio) if self.has_moved else 0.0
        return params.prior_log_odds + told + near + moved

    def posterior(self, calibration: Calibration, params: BeliefParams) -> float:
        """Probability of a person there."""
        return probability(self.log_odds(calibration, params))

    def find_side(self, eye: Pose2D, params: BeliefParams) -> Side | None:
        """The known side that a camera sees, None if it is another one."""
        bearing, away = self.from_place(eye)

        def is_this(side: Side) -> bool:
            near, far = sorted((side.away, away))
            return abs(angle_difference(side.bearing, bearing)) <= params.side_angle and near > params.side_nearer * far

        found = filter(is_this, self.sides)
        return min(found, key=lambda side: abs(angle_difference(side.bearing, bearing)), default=None)

    def side(self, eye: Pose2D, params: BeliefParams) -> Side:
        """The side that a camera sees, a new one if it is another."""
        found = self.find_side(eye, params)
        if found is None:
            found = Side(*self.from_place(eye), eye)
            self.sides.append(found)
        found.eye = eye
        return found

    def from_place(self, eye: Pose2D) -> tuple[float, float]:
        """Bearing [rad] and distance [m] of a camera from the place."""
        dx, dy = eye.x - float(self.place[0]), eye.y - float(self.place[1])
        return math.atan2(dy, dx), math.hypot(dx, dy)

    def spread_at(self, now: float, params: BeliefParams) -> Array:
        """Covariance of the place at a later time [m2]; a person walks at most so fast, and so far."""
        walked = min(params.speed * max(now - self.at, 0.0), params.walked_most)
        return self.spread + np.eye(2) * (walked / 3.0) ** 2

    def move(self, place: Array, spread: Array, now: float, params: BeliefParams) -> None:
        """Take a measured place with its covariance (a Kalman update)."""
        before = self.spread_at(now, params)
        gain = before @ np.linalg.inv(before + spread)
        self.place = self.place + gain @ (place - self.place)
        self.spread = (np.eye(2) - gain) @ before
        self.at = now

    def absorb(self, other: Hypothesis, params: BeliefParams) -> None:
        """Take in another hypothesis of the same object."""
        for side in other.sides:
            own = self.side(side.eye, params)
            own.pictures, own.total = own.pictures + side.pictures, own.total + side.total
            own.near_pictures += side.near_pictures
            own.near_total += side.near_total
        self.boxes, self.possible = self.boxes + other.boxes, self.possible + other.possible
        self.against += other.against
        self.has_moved |= other.has_moved
        self.is_confirmed |= other.is_confirmed
        self.seen_at = max(self.seen_at, other.seen_at)

    def why(self, calibration: Calibration, params: BeliefParams) -> str:
        """One sentence: what it is believed to be, and by what."""
        where = f"at about ({self.place[0]:.1f}, {self.place[1]:.1f})"
        if self.veto is not None:
            return f"what was seen {where} is no intruder: {self.veto.value}"
        share = self.posterior(calibration, params)
        said = [_said(side, calibration) for side in self.sides if side.pictures]
        told = "; ".join(said) or ("it was too near to be told from a pet" if self.is_near_only else "no picture tells")
        moved = "; the lidar saw it move" if self.has_moved else ""
        return f"a person {where} with probability {share:.0%}: {told}{moved}"


def _said(side: Side, calibration: Calibration) -> str:
    for_or_against = "for" if side.total > 0.0 else "against"
    count = f"{side.pictures} picture{'s' if side.pictures > 1 else ''}"
    return f"{count} from {side.away:.1f} m {for_or_against} it ({side.log_odds(calibration):+.1f})"


def probability(log_odds: float) -> float:
    """Probability of log-odds."""
    return 1.0 / (1.0 + math.exp(-max(min(log_odds, 500.0), -500.0)))


def entropy(share: float) -> float:
    """Entropy of a yes-or-no question [nat]."""
    return -sum(p * math.log(p) for p in (share, 1.0 - share) if p > 0.0)


def nearest(hypotheses: Iterable[Hypothesis], x: float, y: float) -> tuple[float, Hypothesis | None]:
    """Distance [m] of the nearest hypothesis, and it; inf and None if there is none."""
    pairs = [(math.hypot(float(h.place[0]) - x, float(h.place[1]) - y), h) for h in hypotheses]
    return min(pairs, key=lambda pair: pair[0], default=(math.inf, None))
