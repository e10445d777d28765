"""Weak sights gathered by place: what looks a little like a person, and stays so from another side, is one.

Somebody half hidden behind furniture is seen for long, but never surely: the watch, which wants a few sure pictures in
a row, lets them pass. Here boxes are gathered by the place of what they show. Something with a person's face from one
side only (a coat on a stand, a shadow) is doubtful, and worth a look from elsewhere; something that is taken for a
person from two sides, at one place, is confirmed. Each side's pictures count as one witness, however many there are:
pictures from one place err alike. Half of a thing looks like half of a person: a side that shows it only in boxes
that the picture's side cuts leaves it doubtful, unless they are sure.
"""

from __future__ import annotations

import math
import statistics
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass, field

from rosbot_patrol.geometry import Pose2D, angle_difference
from rosbot_patrol.params import param
from rosbot_patrol.patrol.records.findings import Confirmation
from rosbot_patrol.patrol.records.inputs import Box, Measured

_PICTURES = 100  # of a side that are kept
_PART = 0.25  # what the place of a part of it is worth, at the picture's edge


@dataclass(frozen=True, kw_only=True)
class WeakSightingParams:
    """Conclusions from uncertain sightings at one place."""

    weak_score: float = param(0.5, lo=0.0, hi=1.0, doc="minimum median score from one side for a weak sighting")
    weak_pictures: int = param(5, lo=1, hi=100, doc="minimum number of images from one side for a weak sighting")
    doubt_pictures: int = param(
        2, lo=1, hi=100, doc="number of images from one side, at any score, that make a place worth a second look"
    )
    grave_score: float = param(0.4, lo=0.0, hi=1.0, doc="minimum median score from one side of something seen for long")
    grave_pictures: int = param(
        20,
        lo=1,
        hi=_PICTURES,
        doc="this many images from one side at `grave_score` need a second look, else the verdict is unverified",
    )
    cut_score: float = param(
        0.8, lo=0.0, hi=1.0, doc="`weak_score` for a side seen only in boxes cut by the image border, if larger"
    )
    weak_sides: int = param(2, lo=1, hi=10, doc="number of sides from which it must look like a person")
    side_angle: float = param(
        0.6, unit="rad", lo=0.05, hi=3.1, doc="viewing directions this far apart count as separate sides"
    )
    weak_error: float = param(0.6, unit="m", lo=0.05, doc="maximum position error of a sighting that counts")
    weak_apart: float = param(0.7, unit="m", lo=0.1, doc="sightings farther apart than this are two objects")


@dataclass
class Side:
    """What was seen of a thing from one side.

    Attributes:
        bearing: from the thing to where it was first seen from, in map [rad].
        scores: probabilities of the last pictures.
        eye: the camera at the last of them.
        is_cut: the picture's left or right edge cut the thing in all of them.
    """

    bearing: float
    eye: Pose2D
    is_cut: bool = True
    scores: deque[float] = field(default_factory=lambda: deque(maxlen=_PICTURES))

    @property
    def score(self) -> float:
        """Median of the probabilities."""
        return statistics.median_low(self.scores)


@dataclass
class WeakSighting:
    """Something that looks like a person.

    Attributes:
        label: class of object; x, y: place in map [m]; weight: of all that told it.
        sides: from where it was seen.
        best: the surest box; picture: the camera's stamp of its picture [s]; boxes: all of that picture.
        seen_at: when the last picture that showed it was taken [s].
        is_confirmed: it was confirmed; is_grave: from one side it looks like a person, or a little so for long.
    """

    label: str
    x: float
    y: float
    weight: float
    best: Box
    picture: float
    boxes: tuple[Box, ...]
    seen_at: float = -math.inf
    sides: list[Side] = field(default_factory=list)
    is_confirmed: bool = False
    is_grave: bool = False

    @property
    def pictures(self) -> int:
        """In which it was seen, of all sides."""
        return sum(len(side.scores) for side in self.sides)

    def apart(self, x: float, y: float) -> float:
        """From a place [m]."""
        return math.hypot(self.x - x, self.y - y)


class WeakSightings:
    """Those of one mission.

    Args:
        params: what makes one a person.
    """

    def __init__(self, params: WeakSightingParams | None = None) -> None:
        self.params = params or WeakSightingParams()
        self.all: list[WeakSighting] = []
        self._newest = -math.inf

    def start(self, now: float) -> None:
        """Forget all, for a new mission; pictures taken before `now` do not count from here on."""
        self.all, self._newest = [], now

    def add(
        self, stamp: float, eye: Pose2D, boxes: Iterable[Box], picture: float | None = None
    ) -> tuple[Confirmation, ...]:
        """Take the boxes of one picture that may show an intruder; a confirmation for each that has become one.

        Args:
            stamp: when the picture was taken [s].
            eye: the camera in map.
            boxes: of the classes that alarm, none of them refused.
            picture: the camera's own stamp of it [s], None where that is `stamp`.
        """
        if stamp <= self._newest:
            return ()
        self._newest = stamp
        found, boxes = [], tuple(boxes)
        for box in boxes:
            m = box.measured
            if m is None or m.error > self.params.weak_error:
                continue
            suspect = self._take(box, m, stamp if picture is None else picture, boxes)
            suspect.seen_at = stamp
            side = self._side(suspect, eye)
            side.scores.append(box.probability)
            side.is_cut &= m.is_cut_aside
            suspect.is_grave = any(self._is_weak(side) or self._lasts(side) for side in suspect.sides)
            if not suspect.is_confirmed and len(self._witnesses(suspect)) >= self.params.weak_sides:
                suspect.is_confirmed = True
                found.append(self._confirmation(suspect))
        return tuple(found)

    def note_confirmed(self, measured: Measured | None) -> None:
        """Somebody was confirmed otherwise: what was gathered there is of them."""
        for suspect in self.all:
            if measured is None or suspect.apart(measured.x, measured.y) <= self.params.weak_apart + measured.error:
                suspect.is_confirmed = True

    def doubtful(self) -> list[WeakSighting]:
        """Those that looked like a person in some pictures, and are not confirmed."""
        least = self.params.doubt_pictures
        return [s for s in self.all if not s.is_confirmed and any(len(side.scores) >= least for side in s.sides)]

    def _take(self, box: Box, m: Measured, picture: float, boxes: tuple[Box, ...]) -> WeakSighting:
        near = [s for s in self.all if s.label == box.label and s.apart(m.x, m.y) <= self.params.weak_apart]
        weight = (_PART if m.is_cut_aside else 1.0) / max(m.error, 0.05) ** 2
        if not near:
            self.all.append(WeakSighting(box.label, m.x, m.y, weight, box, picture, boxes))
            return self.all[-1]
        suspect = min(near, key=lambda s: s.apart(m.x, m.y))
        suspect.weight += weight
        suspect.x += (m.x - suspect.x) * weight / suspect.weight
        suspect.y += (m.y - suspect.y) * weight / suspect.weight
        if box.probability > suspect.best.probability:
            suspect.best, suspect.picture, suspect.boxes = box, picture, boxes
        return suspect

    def _side(self, suspect: WeakSighting, eye: Pose2D) -> Side:
        bearing = math.atan2(eye.y - suspect.y, eye.x - suspect.x)
        nearest = min(suspect.sides, key=lambda s: abs(angle_difference(s.bearing, bearing)), default=None)
        if nearest is None or abs(angle_difference(nearest.bearing, bearing)) > self.params.side_angle:
            nearest = Side(bearing, eye)
            suspect.sides.append(nearest)
        nearest.eye = eye
        return nearest

    def _witnesses(self, suspect: WeakSighting) -> list[Side]:
        least = self.params.cut_score
        return [s for s in suspect.sides if self._is_weak(s) and (not s.is_cut or s.score >= least)]

    def _is_weak(self, side: Side) -> bool:
        return len(side.scores) >= self.params.weak_pictures and side.score >= self.params.weak_score

    def _lasts(self, side: Side) -> bool:
        return len(side.scores) >= self.params.grave_pictures and side.score >= self.params.grave_score

    def _confirmation(self, suspect: WeakSighting) -> Confirmation:
        others = tuple(box for box in suspect.boxes if box is not suspect.best)
        scores = [score for side in self._witnesses(suspect) for score in side.scores]
        return Confirmation(
            label=suspect.label,
            probability=statistics.median_low(scores),
            stamp=suspect.picture,
            boxes=(suspect.best, *others),
            pictures=len(scores),
            measured=suspect.best.measured,
        )
