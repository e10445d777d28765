"""The belief of who is in the house: every picture and every scan updates each hypothesis in view.

A box belongs to the likeliest hypothesis within its gate, or begins one. A hypothesis that was in view and has no box
takes the lack of it as evidence, as far as its place was surely in view. Verdict: a posterior of at least
`confirmed_above`, with two boxes and no veto, confirms. All posteriors below `clear_below`, with the floor seen, are
clear. Anything else is unverified, with the place.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.geometry import Pose2D, angle_difference
from rosbot_patrol.patrol.belief.association import Located, assign, distinct, locate, overlap
from rosbot_patrol.patrol.belief.calibration import CAUTIOUS, Calibration, Condition
from rosbot_patrol.patrol.belief.hypothesis import Hypothesis, nearest
from rosbot_patrol.patrol.belief.likelihoods import Likelihoods, Veto, is_plausible
from rosbot_patrol.patrol.belief.params import BeliefParams
from rosbot_patrol.patrol.house.floor import Floor
from rosbot_patrol.patrol.intruder.known_objects import KnownObject
from rosbot_patrol.patrol.intruder.lidar_motion import LidarTrack
from rosbot_patrol.patrol.records.inputs import Box, Eye, Frame
from rosbot_patrol.patrol.records.mission import Verdict
from rosbot_patrol.patrol.visibility.coverage import Sight

Array = NDArray[np.float64]

_BODY = 0.4  # [m] in front of a place its own body may end a beam
_VIEW_EDGE = 0.1  # [rad] at the image borders where a miss says nothing
_MOST = 60  # hypotheses
_TRACK_ERROR = 0.2  # [m] error of a lidar track's place
_STAYS = 3.0  # [s] for which one whom the lidar saw move stays at a place, on average
_FEWEST = 2  # boxes that confirm: one picture may be spoilt
_LIKELY = 0.5  # posterior of somebody who tells from which others they are apart
_EPISODE = 1.0  # [s] without a box, after which a box without a place is of something else
_NOWHERE = Eye(pose=Pose2D(0.0, 0.0, 0.0), width=1.047)  # stands for a camera whose pose is unknown


@dataclass(frozen=True)
class PictureView:
    """What could be seen in a picture.

    Attributes:
        sight: free way around the camera, None if unknown: then a missing box tells nothing.
        is_dark: the picture is dark.
        has_scan: the lidar sees, and would notice who walks.
    """

    sight: Sight | None = None
    is_dark: bool = False
    has_scan: bool = False


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
        classes: that alarm; boxes of other classes are left out.

    Attributes:
        hypotheses: all, in order of their numbers.
    """

    def __init__(
        self,
        calibration: Calibration = CAUTIOUS,
        params: BeliefParams | None = None,
        *,
        threshold: float = 0.1,
        known: tuple[KnownObject, ...] = (),
        floor: Floor | None = None,
        classes: Sequence[str] = ("person",),
    ) -> None:
        self.params = params or BeliefParams()
        self.known, self.floor = known, floor
        self.likelihoods = Likelihoods(calibration, self.params, threshold)
        self._classes = tuple(classes)
        self.hypotheses: list[Hypothesis] = []
        self._count = 0
        self._newest = -math.inf

    def start(self, now: float) -> None:
        """Forget everything; pictures taken before `now` (steady time [s]) do not count."""
        self.hypotheses, self._newest = [], now

    # -- evidence

    def see(self, now: float, frame: Frame, view: PictureView) -> list[Hypothesis]:
        """Take a picture; returns the hypotheses that it shows, and those that it confirms.

        One that is older than the newest, equal to the one before it, or not measured yet adds nothing.

        Args:
            now: steady time [s], for a picture without a stamp.
            frame: boxes, and the camera then.
            view: what could be seen.
        """
        if frame.is_same or not frame.counts or (frame.stamp is not None and frame.stamp <= self._newest):
            return []
        at = now if frame.stamp is None else frame.stamp
        self._newest = self._newest if frame.stamp is None else frame.stamp
        boxes = self.plausible(frame)
        if frame.eye is None:
            shown = self._see_unplaced(at, boxes, frame)
        else:
            shown = self._see_placed(at, boxes, frame, frame.eye, view)
        confirmed = [h for h in self.hypotheses if self._confirms(h)]
        return [h for h in self.hypotheses if any(h is each for each in (*shown, *confirmed))]

    def plausible(self, frame: Frame) -> list[Box]:
        """Boxes of a picture that may show somebody by class, score and shape."""
        least = self.likelihoods.threshold
        return [b for b in frame.boxes if b.label in self._classes and b.probability >= least and is_plausible(b)]

    def _see_placed(
        self, at: float, boxes: Sequence[Box], frame: Frame, eye: Eye, view: PictureView
    ) -> list[Hypothesis]:
        shown = []
        for hypothesis in self.hypotheses:
            hypothesis.may_walk = hypothesis.moved > 0.0 or not view.has_scan
        for label in self._classes:
            of_class = [locate(box, eye, view.sight) for box in boxes if box.label == label]
            located = distinct(of_class, self.params)
            before = [h for h in self.hypotheses if h.is_placed and h.label == label]
            for each, known in zip(located, assign(before, located, at, self.params), strict=True):
                hypothesis = known or self._begin(each.place, each.spread, at, label)
                self._take(hypothesis, each, frame, view, at)
                shown.append(hypothesis)
        for a, b in combinations([h for h in shown if self.posterior(h) > _LIKELY], 2):
            if self._are_beside(a, b):
                a.together[b.number] += 1
                b.together[a.number] += 1
        for hypothesis in self.hypotheses:
            if hypothesis.is_placed and not any(hypothesis is each for each in shown):
                self._miss(hypothesis, eye, view, at)
        self._merge()
        self._forget()
        return shown

    def _see_unplaced(self, at: float, boxes: Sequence[Box], frame: Frame) -> list[Hypothesis]:
        """Take a picture whose place is unknown: of each class one hypothesis, for as long as pictures show it."""
        over = [h for h in self.hypotheses if not h.is_placed and not h.is_confirmed and at - h.seen_at > _EPISODE]
        self.hypotheses = [h for h in self.hypotheses if not any(h is each for each in over)]
        shown, view = [], PictureView()
        for label in self._classes:
            of_class = [box for box in boxes if box.label == label]
            known = next((h for h in self.hypotheses if not h.is_placed and h.label == label), None)
            if of_class:
                known = known or self._begin(np.zeros(2), np.eye(2), at, label, is_placed=False)
                surest = max(of_class, key=lambda box: box.probability)
                self._take(known, Located(surest, known.place, known.spread), frame, view, at)
                shown.append(known)
            elif known is not None and known.last is not None:
                miss = self.likelihoods.miss(Condition(known.last.height / _NOWHERE.columns), 1.0)
                known.take(_NOWHERE.pose, miss, self.likelihoods.calibration, self.params)
        return shown

    def motion(self, tracks: Iterable[LidarTrack]) -> None:
        """Take what the lidar follows: something that moves may be a person."""
        for track in tracks:
            if not track.has_moved:
                continue
            place, spread = np.array([track.x, track.y]), np.eye(2) * _TRACK_ERROR**2
            persons = [h for h in self.hypotheses if h.is_placed and h.label == "person"]
            apart, known = nearest(persons, track.x, track.y)
            if known is None or apart > self.params.merge + self.params.gate * _TRACK_ERROR:
                known = self._begin(place, spread, track.at)
            elif track.at > known.at:
                known.may_walk = True
                known.move(place, spread, track.at, self.params)
            if not known.moved:  # pictures of the place from before it came tell nothing
                known.sides = [side for side in known.sides if side.score > 0.0]
            known.moved = math.log(self.params.motion_ratio)

    def _begin(
        self, place: Array, spread: Array, now: float, label: str = "person", *, is_placed: bool = True
    ) -> Hypothesis:
        self._count += 1
        begun = Hypothesis(self._count, place.copy(), spread.copy(), now, label=label, is_placed=is_placed)
        self.hypotheses.append(begun)
        return begun

    def _take(self, hypothesis: Hypothesis, each: Located, frame: Frame, view: PictureView, at: float) -> None:
        eye = frame.eye or _NOWHERE
        evidence = self.likelihoods.box(each.box, eye, is_dark=view.is_dark)
        if hypothesis.boxes and hypothesis.is_placed:
            hypothesis.move(each.place, each.spread, at, self.params)
        hypothesis.take(eye.pose, evidence, self.likelihoods.calibration, self.params)
        hypothesis.boxes += 1
        hypothesis.seen_at, hypothesis.last = at, each.box
        hypothesis.scores.append(each.box.probability)
        if evidence.veto is not None:
            hypothesis.against[evidence.veto] += 1
        elif not evidence.is_near or evidence.size is not None:
            hypothesis.possible += 1
        m = each.box.measured
        hypothesis.measured = m or hypothesis.measured
        if m is not None and not evidence.is_near and not m.is_cut_aside:
            hypothesis.height = m.height
        if hypothesis.best is None or each.box.probability > hypothesis.best.probability:
            hypothesis.best, hypothesis.shown = each.box, frame.boxes
            hypothesis.picture = at if frame.picture is None else frame.picture
        hypothesis.place_veto = self._place_veto(hypothesis, each)

    def _place_veto(self, hypothesis: Hypothesis, each: Located) -> Veto | None:
        x, y = float(hypothesis.place[0]), float(hypothesis.place[1])
        m = each.box.measured
        for known in self.known if m is not None else ():
            if known.label in ("", hypothesis.label) and m is not None and known.is_at(m):
                hypothesis.known = f"{known.name} at ({known.x:.1f}, {known.y:.1f})"
                return Veto.KNOWN
        if self.floor is None or m is None or m.source == "floor":
            return None
        within = self.params.outside_after + hypothesis.error
        return None if self.floor.nearest(self.floor.free, x, y, within) is not None else Veto.OUTSIDE

    def _miss(self, hypothesis: Hypothesis, eye: Eye, view: PictureView, at: float) -> None:
        seen = self._in_view(hypothesis, eye, view.sight)
        if hypothesis.moved and hypothesis.boxes:  # the place it has left tells nothing
            seen *= math.exp(-max(at - hypothesis.at, 0.0) / _STAYS)
        if seen <= 0.0:
            return
        _, away = hypothesis.from_place(eye.pose)
        focal = 0.5 * eye.columns / math.tan(0.5 * eye.width)
        condition = Condition(focal * hypothesis.height / max(away, 0.3) / eye.columns, is_dark=view.is_dark)
        miss = self.likelihoods.miss(condition, seen, is_near=away < self.params.whole_from)
        hypothesis.take(eye.pose, miss, self.likelihoods.calibration, self.params)

    def _in_view(self, hypothesis: Hypothesis, eye: Eye, sight: Sight | None) -> float:
        """Probability that its place was in view: the share of five points of its spread.

        That it has walked on is left out.
        """
        if sight is None:
            return 0.0
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
        if hypothesis.is_confirmed or hypothesis.place_veto is not None or hypothesis.boxes < _FEWEST:
            return False
        hypothesis.is_confirmed = self.posterior(hypothesis) >= self.params.confirmed_above
        return hypothesis.is_confirmed

    def _merge(self) -> None:
        """Make one of hypotheses at one place, unless they are two persons, or two boxes of one picture."""
        kept: list[Hypothesis] = []
        for hypothesis in self.hypotheses:
            near = [k for k in kept if self._is_one(k, hypothesis)]
            if near:
                near[0].absorb(hypothesis, self.params)
                for other in self.hypotheses:
                    other.rename(hypothesis.number, near[0].number)
            else:
                kept.append(hypothesis)
        self.hypotheses = kept

    def _is_one(self, a: Hypothesis, b: Hypothesis) -> bool:
        if not (a.is_placed and b.is_placed) or a.label != b.label or a.number in b.others or self._are_beside(a, b):
            return False
        return self._are_close(a, b)

    def _are_close(self, a: Hypothesis, b: Hypothesis) -> bool:
        return float(np.hypot(*(a.place - b.place))) < self.params.merge

    def _are_beside(self, a: Hypothesis, b: Hypothesis) -> bool:
        """Whether one picture, the newest of both, shows them in different columns, and not as the legs of one."""
        if a.last is None or b.last is None or a.seen_at != b.seen_at or overlap(a.last, b.last):
            return False
        near = [m is not None and m.away < self.params.whole_from for m in (a.last.measured, b.last.measured)]
        return not (all(near) and self._are_close(a, b))

    def _forget(self) -> None:
        """Keep the most probable ones."""
        if len(self.hypotheses) > _MOST:
            kept = sorted(self.hypotheses, key=lambda h: (h.is_confirmed, self.posterior(h)), reverse=True)[:_MOST]
            self.hypotheses = [h for h in self.hypotheses if any(h is each for each in kept)]

    # -- conclusions

    def posterior(self, hypothesis: Hypothesis) -> float:
        """Probability of a person at a hypothesis."""
        return hypothesis.posterior(self.params, self.likelihoods.calibration.fooled)

    def why(self, hypothesis: Hypothesis) -> str:
        """One sentence about a hypothesis."""
        return hypothesis.why(self.params, self.likelihoods.calibration.fooled)

    def may_be_somebody(self, hypothesis: Hypothesis) -> bool:
        """Whether a hypothesis is not known to be nobody."""
        return hypothesis.place_veto is None and self.posterior(hypothesis) >= self.params.clear_below

    @property
    def vetoes(self) -> Counter[str]:
        """Reasons why boxes showed no intruder, and how many boxes."""
        found: Counter[str] = Counter()
        for hypothesis in self.hypotheses:
            if hypothesis.veto is not None:
                found[hypothesis.veto_text] += hypothesis.boxes
        return found

    def pictures(self, most: int) -> tuple[float, ...]:
        """Stamps of the pictures that show the most probable hypotheses best [s]."""
        shown = [h for h in self.hypotheses if h.best is not None and h.place_veto is None]
        return tuple(h.picture for h in sorted(shown, key=self.posterior, reverse=True)[:most])

    @property
    def open(self) -> Sequence[Hypothesis]:
        """Hypotheses that are neither confirmed nor below `clear_below`, the most probable first."""
        found = [h for h in self.hypotheses if not h.is_confirmed and self.may_be_somebody(h)]
        return sorted(found, key=self.posterior, reverse=True)

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
