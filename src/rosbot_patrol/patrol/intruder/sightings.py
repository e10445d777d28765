"""When detections make an intruder: one class of alarm, in several pictures, over some time, with enough probability.

Pictures count by their stamp: the same picture again and again (a dead camera behind darknet_ros) adds nothing.
Pictures without a detection count against. The median of the probabilities decides, so one lucky picture does not make
up for doubtful ones. Boxes cut by the picture's side need a higher median, and so do classes other than person: half of
a thing looks like half of a person. A box that the exclusions refuse (a pet, a poster, somebody outside) counts as
nothing seen. If places are known, only boxes near each other make one person: two persons in view are confirmed each.
"""

from __future__ import annotations

import math
import statistics
from collections import Counter, deque
from dataclasses import dataclass

from rosbot_patrol.params import param
from rosbot_patrol.patrol.intruder.exclusions import Exclusions
from rosbot_patrol.patrol.records.findings import Confirmation
from rosbot_patrol.patrol.records.inputs import Box, Frame, Measured

_AS_GOOD = 1.3  # so much larger may an error be in a newer picture


@dataclass(frozen=True, kw_only=True)
class SightingsParams:
    """Sightings that make an intruder."""

    frames: int = param(3, lo=1, hi=100, doc="minimum number of images that show the intruder")
    window: int = param(5, lo=1, hi=100, doc="number of latest images in which they are counted")
    span: float = param(0.2, unit="s", lo=0.0, hi=10.0, doc="minimum time between the first and the last of them")
    max_age: float = param(10.0, unit="s", lo=0.1, doc="maximum age of an image")
    min_score: float = param(0.65, lo=0.0, hi=1.0, doc="minimum median score of the boxes")
    cut_score: float = param(
        0.8, lo=0.0, hi=1.0, doc="`min_score` when every box touches the left or right image border, if larger"
    )
    thing_score: float = param(
        0.8, lo=0.0, hi=1.0, doc="`min_score` for classes other than person, as their size tells little, if larger"
    )
    min_height: int = param(16, unit="px", lo=1, doc="minimum height of a box; smaller boxes are ignored")
    min_aspect: float = param(0.15, lo=0.0, doc="minimum height / width of a box")
    max_aspect: float = param(8.0, lo=0.1, doc="maximum height / width of a box")
    same_place: float = param(
        1.0, unit="m", lo=0.1, doc="boxes closer than this in successive images belong to the same person"
    )


class Sightings:
    """Collects pictures' boxes until they make an intruder.

    Args:
        alarm_classes: classes that alarm.
        params: how sure to be.
        exclusions: boxes that cannot be an intruder.

    Attributes:
        refusals: why boxes were refused since `start`, and how often.
    """

    def __init__(
        self,
        alarm_classes: tuple[str, ...],
        params: SightingsParams | None = None,
        exclusions: Exclusions | None = None,
    ) -> None:
        self.params = params or SightingsParams()
        self.exclusions = exclusions or Exclusions()
        self.refusals: Counter[str] = Counter()
        self._classes = frozenset(alarm_classes)
        self._views: deque[_View] = deque(maxlen=self.params.window)
        self._glimpses: deque[float] = deque(maxlen=3)  # when pictures came that do not count, but show somebody
        self._newest = -math.inf

    def start(self, now: float) -> None:
        """Forget everything; pictures taken before `now` do not count from here on."""
        self._views.clear()
        self._glimpses.clear()
        self.refusals.clear()
        self._newest = now

    def add(self, now: float, frame: Frame) -> tuple[Confirmation, ...]:
        """Take one picture's boxes; a confirmation for each intruder that they make."""
        if not frame.counts:
            if self.plausible(frame):
                self.glimpse(now)
            return ()
        stamp = now if frame.stamp is None else frame.stamp
        if frame.stamp is not None:
            if stamp <= self._newest or now - stamp > self.params.max_age:
                return ()
            self._newest = stamp
        boxes = [box for box in frame.boxes if self._is_likely(box)]
        refusals = {box: self.exclusions.refusal(box) for box in boxes}
        self.refusals.update(why for why in refusals.values() if why)
        picture = stamp if frame.picture is None else frame.picture
        view = _View(arrived=now, stamp=stamp, picture=picture, boxes=tuple(box for box in boxes if not refusals[box]))
        self._views.append(view)
        while now - self._views[0].arrived > self.params.max_age:
            self._views.popleft()
        found: list[Confirmation] = []
        for box in sorted(view.boxes, key=_score, reverse=True):
            if not any(self._is_same(box, other.label, other.measured) for other in found):
                found += self._confirm(box)
        return tuple(found)

    def glimpse(self, now: float) -> None:
        """Something was in view that cannot be judged yet."""
        self._glimpses.append(now)

    def candidate(self, now: float, recent: float = 0.6) -> bool:
        """Whether a picture that came lately shows something that may become an intruder."""
        seen = [view.arrived for view in self._views if view.boxes]
        return any(now - at <= recent for at in (*seen, *self._glimpses))

    def plausible(self, frame: Frame) -> list[Box]:
        """Boxes of a picture that may show an intruder, the surest first."""
        likely = (box for box in frame.boxes if self._is_likely(box) and not self.exclusions.refusal(box))
        return sorted(likely, key=_score, reverse=True)

    def lately(self, now: float, recent: float = 3.0) -> int:
        """How many of the last three pictures, if they came lately, show something that may become an intruder."""
        seen = [view.arrived for view in list(self._views)[-3:] if view.boxes]
        return sum(now - at <= recent for at in (*seen, *self._glimpses))

    def _is_likely(self, box: Box) -> bool:
        if box.label not in self._classes or not 0.0 < box.probability <= 1.0:
            return False
        if box.width <= 0 or box.height < self.params.min_height:
            return False
        return self.params.min_aspect <= box.height / box.width <= self.params.max_aspect

    def _is_same(self, box: Box, label: str, measured: Measured | None) -> bool:
        if box.label != label:
            return False
        if box.measured is None or measured is None:
            return True
        apart = math.hypot(box.measured.x - measured.x, box.measured.y - measured.y)
        return apart <= self.params.same_place + min(box.measured.error, 1.0) + min(measured.error, 1.0)

    def _confirm(self, newest: Box) -> list[Confirmation]:
        shown = []
        for view in self._views:
            same = [box for box in view.boxes if self._is_same(box, newest.label, newest.measured)]
            if same:
                shown.append((max(same, key=_score), view))
        sure = statistics.median_low(box.probability for box, _ in shown)
        span = shown[-1][1].stamp - shown[0][1].stamp
        is_sure = sure >= self._least([box for box, _ in shown])
        if len(shown) < self.params.frames or span < self.params.span - 1e-6 or not is_sure:
            return []
        best, view = max(shown, key=lambda pair: (pair[0].probability, pair[0].height))
        others = sorted((b for b in view.boxes if b is not best), key=lambda b: (b.label != best.label, -b.probability))
        measured = _newest([b.measured for b, _ in shown[-3:] if b.measured])
        return [
            Confirmation(
                label=best.label,
                probability=sure,
                stamp=view.picture,
                boxes=(best, *others),
                pictures=len(shown),
                measured=measured,
            )
        ]

    def _least(self, shown: list[Box]) -> float:
        """The median that these have to have."""
        least = self.params.min_score
        if all(box.measured is not None and box.measured.is_cut_aside for box in shown):
            least = max(least, self.params.cut_score)
        return least if shown[0].label == "person" else max(least, self.params.thing_score)


@dataclass(frozen=True, kw_only=True)
class _View:
    arrived: float
    stamp: float
    picture: float
    boxes: tuple[Box, ...]


def _score(box: Box) -> float:
    return box.probability


def _newest(measured: list[Measured]) -> Measured | None:
    """The last of those that are whole and about as exact as the best: who walks is no longer where they were."""
    if not measured:
        return None
    measured = [m for m in measured if not m.is_cut_aside] or measured
    best = min(m.error for m in measured)
    return [m for m in measured if m.error <= _AS_GOOD * best][-1]
