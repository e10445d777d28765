"""When detections make an intruder: one class of alarm, in several pictures, over some time, sure enough on average.

A detector that is shown the same picture again and again (a dead camera behind darknet_ros) adds nothing: pictures
count by their stamp. Pictures in which nothing was seen count against.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

from rosbot_patrol.params import param
from rosbot_patrol.patrol.inputs import Box, Frame


@dataclass(frozen=True, kw_only=True)
class WatchParams:
    """What makes an intruder."""

    frames: int = param(3, lo=1, hi=100, doc="pictures that have to show it")
    window: int = param(5, lo=1, hi=100, doc="out of this many last pictures")
    span: float = param(0.2, unit="s", lo=0.0, hi=10.0, doc="least time from the first of them to the last")
    max_age: float = param(10.0, unit="s", lo=0.1, doc="older pictures are forgotten")
    min_score: float = param(0.65, lo=0.0, hi=1.0, doc="least mean probability")
    min_height: int = param(16, unit="px", lo=1, doc="smaller boxes are not believed")
    min_aspect: float = param(0.15, lo=0.0, doc="least height / width of a box")
    max_aspect: float = param(8.0, lo=0.1, doc="greatest height / width of a box")


@dataclass(frozen=True, kw_only=True)
class Confirmation:
    """An intruder, as far as the detector can tell.

    Attributes:
        label: its class.
        probability: mean over the pictures that show it.
        stamp: of the picture that shows it best [s].
        boxes: alarm boxes in that picture, the best first.
        pictures: how many showed it.
    """

    label: str
    probability: float
    stamp: float
    boxes: tuple[Box, ...]
    pictures: int


class Watch:
    """Collects pictures' boxes until they make an intruder.

    Args:
        alarm_classes: classes that alarm.
        params: how sure to be.
    """

    def __init__(self, alarm_classes: tuple[str, ...], params: WatchParams | None = None) -> None:
        self.params = params or WatchParams()
        self._classes = frozenset(alarm_classes)
        self._views: deque[_View] = deque(maxlen=self.params.window)
        self._newest = -math.inf

    def start(self, now: float) -> None:
        """Forget everything; pictures taken before `now` do not count from here on."""
        self._views.clear()
        self._newest = now

    def add(self, now: float, frame: Frame) -> Confirmation | None:
        """Take one picture's boxes; a confirmation where they make an intruder."""
        stamp = now if frame.stamp is None else frame.stamp
        if frame.stamp is not None:
            if stamp <= self._newest or now - stamp > self.params.max_age:
                return None
            self._newest = stamp
        view = _View(arrived=now, stamp=stamp, boxes=tuple(box for box in frame.boxes if self._is_plausible(box)))
        self._views.append(view)
        while now - self._views[0].arrived > self.params.max_age:
            self._views.popleft()
        return self._confirm({box.label for box in view.boxes})

    def candidate(self, now: float, recent: float = 0.6) -> bool:
        """Whether a picture that came lately shows something that may become an intruder."""
        return any(view.boxes and abs(now - view.arrived) <= recent for view in self._views)

    def _is_plausible(self, box: Box) -> bool:
        if box.label not in self._classes or not 0.0 < box.probability <= 1.0:
            return False
        if box.width <= 0 or box.height < self.params.min_height:
            return False
        return self.params.min_aspect <= box.height / box.width <= self.params.max_aspect

    def _confirm(self, labels: set[str]) -> Confirmation | None:
        for label in sorted(labels, key=self._best_score, reverse=True):
            shown = [(max(view.of(label), key=_score), view) for view in self._views if view.of(label)]
            mean = sum(box.probability for box, _ in shown) / len(shown)
            span = shown[-1][1].stamp - shown[0][1].stamp
            if len(shown) >= self.params.frames and span >= self.params.span - 1e-6 and mean >= self.params.min_score:
                view = max(shown, key=lambda pair: (pair[0].probability, pair[0].height))[1]
                boxes = tuple(sorted(view.boxes, key=lambda b: (b.label != label, -b.probability)))
                return Confirmation(label=label, probability=mean, stamp=view.stamp, boxes=boxes, pictures=len(shown))
        return None

    def _best_score(self, label: str) -> float:
        return max(box.probability for view in self._views for box in view.of(label))


@dataclass(frozen=True, kw_only=True)
class _View:
    arrived: float
    stamp: float
    boxes: tuple[Box, ...]

    def of(self, label: str) -> list[Box]:
        return [box for box in self.boxes if box.label == label]


def _score(box: Box) -> float:
    return box.probability
