"""The belief of who is in the house: every picture and every scan updates each hypothesis in view.

A box belongs to the nearest hypothesis within its gate, or begins one. A hypothesis that was in view and has no box
takes the lack of it as evidence, as far as its place was surely in view. Verdict: a posterior above `confirmed_above`
confirms; all below `clear_below` with the floor seen is clear; anything else is unverified, with the place.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.geometry import angle_difference
from rosbot_patrol.patrol.belief.association import Located, assign, distinct, locate
from rosbot_patrol.patrol.belief.calibration import CAUTIOUS, Calibration, Condition
from rosbot_patrol.patrol.belief.hypothesis import Hypothesis, nearest
from rosbot_patrol.patrol.belief.likelihoods import Likelihoods, Veto
from rosbot_patrol.patrol.belief.params import BeliefParams
from rosbot_patrol.patrol.house.floor import Floor
from rosbot_patrol.patrol.intruder.exclusions import KnownObject
from rosbot_patrol.patrol.intruder.lidar_motion import LidarTrack
from rosbot_patrol.patrol.records.inputs import Eye, Frame
from rosbot_patrol.patrol.records.mission import Verdict
from rosbot_patrol.patrol.visibility.coverage import Sight

Array = NDArray[np.float64]

_BODY = 0.4  # [m] in front of a place its own body may end a beam
_VIEW_EDGE = 0.1  # [rad] at the image borders where a miss says nothing
_MOST = 60  # hypotheses
_TRACK_ERROR = 0.2  # [m] error of a lidar track's place


@dataclass(frozen=True)
class PictureView:
    """What could be seen in a picture.

    Attributes:
        sight: free way around the camera.
        is_dark: the picture is dark.
    """

    sight: Sight
    is_dark: bool = False


@dataclass(frozen=True)
class Judgement:
    """The verdict that the belief allows.

    Attributes:
        verdict: CONFIRMED, CLEAR or UNVERIFIED.
        why: one sentence.
        of: the hypothesis that it is about, None if it is about none.
    """

    verdict: Verdict
    why: str
    of: Hypothesis | None = None


class Belief:
    """Hypotheses of one mission.

    Args:
        calibration: of the network; the cautious one if there is none.
        params: the table.
        threshold: of the detector.
        known: objects that look like somebody.
        floor: of the map, None if unknown.
    """

    def __init__(
        self,
        calibration: Calibration = CAUTIOUS,
        params: BeliefParams | None = None,
        *,
        threshold: float = 0.1,
        known: tuple[KnownObject, ...] = (),
        floor: Floor | None = None,
    ) -> None:
        self.params = params or BeliefParams()
        self.calibration, self.known, self.floor = calibration, known, floor
        self.likelihoods = Likelihoods(calibration, self.params, threshold)
        self.hypotheses: list[Hypothesis] = []
        self._count = 0
        self._newest = -math.inf

    def start(self, now: float) -> None:
        """Forget everything; pictures taken before `now` (steady time [s]) do not count."""
        self.hypotheses, self._newest = [], now

    # -- evidence

    def see(self, frame: Frame, view: PictureView) -> list[Hypothesis]:
        """Take a picture; returns the hypotheses that it confirms.

        A picture without a place, from before the newest one, or equal to the one before it adds nothing.
        """
        if frame.eye is None or frame.stamp is None or frame.stamp <= self._newest or frame.is_same or not frame.counts:
            return []
        now = self._newest = frame.stamp
        boxes = [box for box in frame.boxes if box.label == "person" and box.probability >= self.likelihoods.threshold]
        located = distinct([locate(box, frame.eye, view.sight) for box in boxes], self.params.merge)
        shown = []
        for each, known in zip(located, assign(self.hypotheses, located, now, self.params), strict=True):
            hypothesis = known or self._begin(each.place, each.spread, now)
            self._take(hypothesis, each, frame, view)
            shown.append(hypothesis)
        for hypothesis in self.hypotheses:
            if not any(hypothesis is each for each in shown):
                self._miss(hypothesis, frame.eye, view)
        self._merge()
        self._forget()
        return [h for h in self.hypotheses if self._confirms(h)]

    def motion(self, tracks: Iterable[LidarTrack]) -> None:
        """Take what the lidar follows: something that moves may be a person."""
        for track in tracks:
            if not track.has_moved:
                continue
            place, spread = np.array([track.x, track.y]), np.eye(2) * _TRACK_ERROR**2
            apart, known = nearest(self.hypotheses, track.x, track.y)
            if known is None or apart > self.params.merge + self.params.gate * _TRACK_ERROR:
                known = self._begin(place, spread, track.at)
            elif track.at > known.at:
                known.move(place, spread, track.at, self.params)
            known.moved = math.log(self.params.motion_ratio)

    def _begin(self, place: Array, spread: Array, now: float) -> Hypothesis:
        self._count += 1
        self.hypotheses.append(Hypothesis(self._count, place.copy(), spread.copy(), now))
        return self.hypotheses[-1]

    def _take(self, hypothesis: Hypothesis, each: Located, frame: Frame, view: PictureView) -> None:
        assert frame.eye is not None
        assert frame.stamp is not None
        evidence = self.likelihoods.box(each.box, frame.eye, is_dark=view.is_dark)
        if hypothesis.boxes:
            hypothesis.move(each.place, each.spread, frame.stamp, self.params)
        hypothesis.take(frame.eye.pose, evidence, self.calibration, self.params)
        hypothesis.boxes += 1
        hypothesis.seen_at = frame.stamp
        if evidence.veto is not None:
            hypothesis.against[evidence.veto] += 1
        elif not evidence.is_near:
            hypothesis.possible += 1
        m = each.box.measured
        if m is not None and not evidence.is_near and not m.is_cut_aside:
            hypothesis.height = m.height
        if hypothesis.best is None or each.box.probability > hypothesis.best.probability:
            hypothesis.best, hypothesis.shown = each.box, frame.boxes
            hypothesis.picture = frame.stamp if frame.picture is None else frame.picture
        hypothesis.place_veto = self._place_veto(hypothesis, each)

    def _place_veto(self, hypothesis: Hypothesis, each: Located) -> Veto | None:
        x, y = float(hypothesis.place[0]), float(hypothesis.place[1])
        m = each.box.measured
        if m is not None and any(known.is_at(m) and known.label in ("", "person") for known in self.known):
            return Veto.KNOWN
        if self.floor is None or m is None or m.source == "floor":
            return None
        within = self.params.outside_after + hypothesis.error
        return None if self.floor.nearest(self.floor.free, x, y, within) is not None else Veto.OUTSIDE

    def _miss(self, hypothesis: Hypothesis, eye: Eye, view: PictureView) -> None:
        seen = self._in_view(hypothesis, eye, view.sight)
        if seen <= 0.0:
            return
        _, away = hypothesis.from_place(eye.pose)
        focal = 0.5 * eye.columns / math.tan(0.5 * eye.width)
        at = Condition(focal * hypothesis.height / max(away, 0.3) / eye.columns, is_dark=view.is_dark)
        hypothesis.take(eye.pose, self.likelihoods.miss(at, seen), self.calibration, self.params)

    def _in_view(self, hypothesis: Hypothesis, eye: Eye, sight: Sight) -> float:
        """Probability that its place was in view: the share of five points of its spread.

        That it has walked on is left out: then it is seen elsewhere, or the lidar sees it move.
        """
        values, axes = np.linalg.eigh(hypothesis.spread)
        steps = axes * np.sqrt(np.maximum(values, 0.0))
        points = hypothesis.place + np.vstack((np.zeros(2), steps.T, -steps.T))
        dx, dy = points[:, 0] - eye.pose.x, points[:, 1] - eye.pose.y
        bearings, away = np.arctan2(dy, dx), np.hypot(dx, dy)
        aside = np.array([abs(angle_difference(float(bearing), eye.pose.yaw)) for bearing in bearings])
        shows = (aside <= 0.5 * eye.width - _VIEW_EDGE) & (away <= self.params.view_range)
        side = hypothesis.find_side(eye.pose, self.params)
        if side is not None and side.counts[1:].any():  # it was seen from there, over what ends the lidar's beam
            return float(shows.mean())
        return float((shows & sight.reaches(bearings, away - _BODY)).mean())

    def _confirms(self, hypothesis: Hypothesis) -> bool:
        if hypothesis.is_confirmed or hypothesis.place_veto is not None or not hypothesis.boxes:
            return False
        hypothesis.is_confirmed = self.posterior(hypothesis) >= self.params.confirmed_above
        return hypothesis.is_confirmed

    def _merge(self) -> None:
        """Make one of hypotheses at one place, unless the same picture shows both."""
        kept: list[Hypothesis] = []
        for hypothesis in self.hypotheses:
            near = [k for k in kept if k.seen_at != hypothesis.seen_at and self._is_one(k, hypothesis)]
            if near:
                near[0].absorb(hypothesis, self.params)
            else:
                kept.append(hypothesis)
        self.hypotheses = kept

    def _is_one(self, a: Hypothesis, b: Hypothesis) -> bool:
        return float(np.hypot(*(a.place - b.place))) < self.params.merge

    def _forget(self) -> None:
        """Keep the most probable ones."""
        if len(self.hypotheses) > _MOST:
            kept = sorted(self.hypotheses, key=lambda h: (h.is_confirmed, self.posterior(h)), reverse=True)[:_MOST]
            self.hypotheses = [h for h in self.hypotheses if any(h is each for each in kept)]

    # -- conclusions

    def posterior(self, hypothesis: Hypothesis) -> float:
        """Probability of a person at a hypothesis."""
        return hypothesis.posterior(self.params)

    def why(self, hypothesis: Hypothesis) -> str:
        """One sentence about a hypothesis."""
        return hypothesis.why(self.params)

    @property
    def open(self) -> Sequence[Hypothesis]:
        """Hypotheses that are neither confirmed nor below `clear_below`, the most probable first."""
        p = self.params
        found = [h for h in self.hypotheses if not h.is_confirmed and h.place_veto is None]
        return sorted((h for h in found if self.posterior(h) >= p.clear_below), key=self.posterior, reverse=True)

    def verdict(self, *, floor_seen: bool) -> Judgement:
        """What can be said of the room.

        Args:
            floor_seen: enough of its floor was in view.
        """
        confirmed = next((h for h in self.hypotheses if h.is_confirmed), None)
        if confirmed is not None:
            return Judgement(Verdict.CONFIRMED, self.why(confirmed), confirmed)
        if self.open:
            return Judgement(Verdict.UNVERIFIED, self.why(self.open[0]), self.open[0])
        if not floor_seen:
            return Judgement(Verdict.UNVERIFIED, "too little of the floor was seen")
        return Judgement(Verdict.CLEAR, "the floor was seen, and nobody is there")
