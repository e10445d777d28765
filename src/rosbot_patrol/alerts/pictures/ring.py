"""The camera's last seconds in memory, and which of its pictures are worth keeping.

Every picture of the last moment is there, so that the one which a detection speaks of is found; older ones are thinned
to a few a second. Nothing is encoded here: what nobody keeps costs no more than its bytes, and those are bounded.
"""

from __future__ import annotations

import io
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass

from PIL import Image, ImageFilter, ImageStat

from rosbot_patrol.alerts.pictures.jpeg import Picture
from rosbot_patrol.params import param

_SHARP_WIDTH = 160  # [px]: sharpness is judged on a picture of this width


@dataclass(frozen=True, kw_only=True)
class EvidenceParams:
    """Which camera pictures are kept for an incident."""

    evidence_before: float = param(5.0, unit="s", lo=0.0, hi=30.0, doc="length of the clip before a sighting")
    evidence_after: float = param(20.0, unit="s", lo=0.0, hi=120.0, doc="length of the clip after a sighting")
    evidence_rate: float = param(5.0, unit="Hz", lo=0.2, hi=15.0, doc="pictures per second in the clip")
    evidence_mb: float = param(
        40.0, unit="MB", lo=4.0, hi=1000.0, doc="memory for recent pictures; when full, the oldest are dropped"
    )
    evidence_always: bool = param(
        False, doc="collect pictures between missions, too, so that the seconds before a call are kept"
    )
    look_pictures: int = param(
        8, lo=0, hi=60, doc="number of pictures kept from each look around, whatever the verdict"
    )


class EvidenceRing:
    """Pictures by their stamp.

    Args:
        seconds: how far back it reaches.
        rate: older pictures are thinned to this rate [Hz].
        max_bytes: of all pictures together; 40 MB hold 43 raw ones of 640 x 480, or 1,000 compressed ones.
        fresh: pictures younger than this [s] are all kept, as long as they take no more than half of the memory.
    """

    def __init__(self, *, seconds: float, rate: float, max_bytes: float, fresh: float = 3.0) -> None:
        self._seconds, self._gap, self._max_bytes, self._fresh = seconds, 1.0 / rate, max_bytes, fresh
        self._old: deque[Picture] = deque()
        self._new: deque[Picture] = deque()
        self._old_bytes = self._new_bytes = 0

    @property
    def bytes(self) -> int:
        """Of all pictures together."""
        return self._old_bytes + self._new_bytes

    def __len__(self) -> int:
        return len(self._old) + len(self._new)

    @property
    def newest(self) -> Picture | None:
        """The picture that came last."""
        return self._new[-1] if self._new else None

    def snapshot(self) -> EvidenceRing:
        """A copy of the ring, for another thread."""
        other = EvidenceRing(seconds=self._seconds, rate=1.0 / self._gap, max_bytes=self._max_bytes, fresh=self._fresh)
        other._old, other._new = self._old.copy(), self._new.copy()
        other._old_bytes, other._new_bytes = self._old_bytes, self._new_bytes
        return other

    def clear(self) -> None:
        """Forget all."""
        self._old.clear()
        self._new.clear()
        self._old_bytes = self._new_bytes = 0

    def add(self, picture: Picture) -> None:
        """Take a picture; one that is older than the newest means that the clock went back: all others go."""
        if self.newest is not None and picture.stamp < self.newest.stamp:
            self.clear()
        self._new.append(picture)
        self._new_bytes += len(picture.data)
        first_fresh, first_kept = picture.stamp - self._fresh, picture.stamp - self._seconds
        while len(self._new) > 1 and (self._new[0].stamp < first_fresh or 2 * self._new_bytes > self._max_bytes):
            self._thin(self._new.popleft())
        while self._old and (self._old[0].stamp < first_kept or self.bytes > self._max_bytes):
            self._old_bytes -= len(self._old.popleft().data)

    def find(self, stamp: float, tolerance: float) -> Picture | None:
        """The picture nearest to a time [s], None if none lies within the tolerance."""
        best = min((*self._old, *self._new), key=lambda p: abs(p.stamp - stamp), default=None)
        return best if best is not None and abs(best.stamp - stamp) <= tolerance else None

    def between(self, after: float, until: float) -> list[Picture]:
        """Pictures later than one time and not later than another [s], no more a second than the ring's rate."""
        taken: list[Picture] = []
        last = after
        for picture in (*self._old, *self._new):
            if after < picture.stamp <= until and picture.stamp - last >= self._gap * 0.95:
                taken.append(picture)
                last = picture.stamp
        return taken

    def _thin(self, picture: Picture) -> None:
        self._new_bytes -= len(picture.data)
        if not self._old or picture.stamp - self._old[-1].stamp >= self._gap * 0.95:
            self._old.append(picture)
            self._old_bytes += len(picture.data)


@dataclass(kw_only=True)
class Clip:
    """The seconds before and after a moment, taken from the ring bit by bit.

    Attributes:
        incident: id of its record.
        stamp: the moment [s].
        until: the last picture's time [s].
        taken: the newest picture that was taken has this stamp [s].
    """

    incident: str
    stamp: float
    until: float
    taken: float

    @classmethod
    def around(cls, incident: str, stamp: float, params: EvidenceParams) -> Clip:
        """The clip of an incident about a moment [s]."""
        end = stamp + params.evidence_after
        return cls(incident=incident, stamp=stamp, until=end, taken=stamp - params.evidence_before - 1e-3)

    def take(self, ring: EvidenceRing) -> list[Picture]:
        """What came since the last call."""
        pictures = ring.between(self.taken, self.until)
        if pictures:
            self.taken = pictures[-1].stamp
        return pictures

    def is_over(self, ring: EvidenceRing) -> bool:
        """Whether nothing more can come: it is complete, or the clock was set back."""
        return ring.newest is None or not self.taken <= ring.newest.stamp < self.until


@dataclass(frozen=True, kw_only=True)
class Candidate:
    """A picture that shows somebody.

    Attributes:
        name: of its file.
        stamp: when it was taken [s].
        probability: how sure the detector was.
        share: of the picture that the box takes.
        sharpness: see `sharpness`.
    """

    name: str
    stamp: float
    probability: float
    share: float
    sharpness: float


def best_pictures(candidates: Iterable[Candidate], count: int = 3, apart: float = 1.0) -> list[str]:
    """Names of the pictures that show the person best (sure, large, sharp), each some time [s] from the others."""
    known = list(candidates)
    sharpest = max((c.sharpness for c in known), default=0.0) or 1.0

    def score(candidate: Candidate) -> float:
        size: float = min(candidate.share / 0.1, 1.0) ** 0.5
        return candidate.probability * (0.3 + 0.7 * size) * (0.5 + 0.5 * candidate.sharpness / sharpest)

    taken: list[Candidate] = []
    for candidate in sorted(known, key=score, reverse=True):
        if len(taken) < count and all(abs(candidate.stamp - other.stamp) >= apart for other in taken):
            taken.append(candidate)
    return [candidate.name for candidate in taken]


def sharpness(jpeg: bytes) -> float:
    """Detail of a picture: the variance of its edges at a small size; 0 if it cannot be read."""
    try:
        image = Image.open(io.BytesIO(jpeg))
        image.draft("L", (_SHARP_WIDTH, _SHARP_WIDTH))
        small = image.convert("L").resize((_SHARP_WIDTH, max(_SHARP_WIDTH * image.height // image.width, 1)))
    except (OSError, SyntaxError, Image.DecompressionBombError):
        return 0.0
    return float(ImageStat.Stat(small.filter(ImageFilter.FIND_EDGES)).var[0])
