"""Which of the camera's pictures go into a record: the seconds about a sighting, the best ones, some of each look."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field

from rosbot_patrol.alerts.pictures.jpeg import LabelledBox, Picture, RawPicture, to_jpeg
from rosbot_patrol.alerts.pictures.ring import Candidate, Clip, EvidenceParams, EvidenceRing, best_pictures, sharpness
from rosbot_patrol.alerts.records.files import NewFile
from rosbot_patrol.errors import AlertError

_LOOK_PAUSE = 2.0  # [s] between two pictures of a look around
_QUALITY = 80  # of JPEG: a picture of 640 x 480 takes 3 ms and 40 kB
_BEST = 3
_SAME = 0.002  # [s]: a detection speaks of the picture with its stamp


@dataclass(frozen=True, kw_only=True)
class Sighting:
    """What a detector saw in one picture: its stamp [s], probability, boxes [px]."""

    stamp: float
    probability: float
    boxes: Sequence[LabelledBox]


@dataclass(kw_only=True)
class _Shelf:
    clip: Clip | None = None
    count: int = 0
    looks: int = 0
    look_at: float = float("-inf")
    candidates: dict[str, tuple[Candidate, bytes, float]] = field(default_factory=dict)


class Album:
    """Collects for several records at once.

    One thread, the keeper's, collects. `note` and `is_waiting` are for other threads, too.

    Args:
        params: how much.
    """

    def __init__(self, params: EvidenceParams) -> None:
        self.params = params
        self._shelves: dict[str, _Shelf] = {}
        self._sightings: deque[Sighting] = deque(maxlen=200)
        self._guard = threading.Lock()  # of the sightings and of which shelves there are
        self.problems: set[str] = set()

    @property
    def is_waiting(self) -> bool:
        """Whether pictures are still to come for a sighting."""
        with self._guard:
            return any(shelf.clip is not None for shelf in self._shelves.values())

    def begin(self, incident_id: str) -> None:
        """A mission begins."""
        with self._guard:
            self._shelves.setdefault(incident_id, _Shelf())

    def sight(self, incident_id: str, stamp: float) -> None:
        """Somebody was seen: the seconds about it are wanted, the first time."""
        self.begin(incident_id)
        shelf = self._shelves[incident_id]
        if shelf.clip is None and shelf.count == 0:
            shelf.clip = Clip.around(incident_id, stamp, self.params)

    def note(self, sighting: Sighting) -> None:
        """What a detector saw."""
        with self._guard:
            self._sightings.append(sighting)

    def is_over(self, incident_id: str, ring: EvidenceRing) -> bool:
        """Whether nothing more comes for a record."""
        shelf = self._shelves.get(incident_id)
        return shelf is None or shelf.clip is None or shelf.clip.is_over(ring)

    def has_all(self, incident_id: str) -> bool:
        """Whether the seconds about a record's sighting were taken."""
        shelf = self._shelves.get(incident_id)
        return shelf is not None and shelf.clip is None and shelf.count > 0

    def take(self, incident_id: str, ring: EvidenceRing) -> list[NewFile]:
        """New files about a sighting, encoded."""
        shelf = self._shelves.get(incident_id)
        if shelf is None or shelf.clip is None:
            return []
        clip, files = shelf.clip, []
        is_over = clip.is_over(ring)
        for picture in clip.take(ring):
            data = self._jpeg(picture)
            if data is None:
                continue
            shelf.count += 1
            role = "before" if picture.stamp <= clip.stamp else "after"
            name = f"{role}-{shelf.count:03}.jpg"
            caption = f"{picture.stamp - clip.stamp:+.1f} s"
            files.append(NewFile(name=name, role=role, data=data, stamp=picture.stamp, caption=caption))
            self._consider(shelf, picture, data)
        if is_over:
            shelf.count = max(shelf.count, 1)
            shelf.clip = None
        return files

    def look(self, incident_id: str, ring: EvidenceRing) -> list[NewFile]:
        """The newest picture of a look around, if one is due."""
        shelf, picture = self._shelves.get(incident_id), ring.newest
        if shelf is None or picture is None or shelf.looks >= self.params.look_pictures:
            return []
        if 0.0 <= picture.stamp - shelf.look_at < _LOOK_PAUSE:
            return []
        data = self._jpeg(picture)
        if data is None:
            return []
        shelf.look_at = picture.stamp
        shelf.looks += 1
        name = f"look-{shelf.looks:02}.jpg"
        return [NewFile(name=name, role="look", data=data, stamp=picture.stamp, caption=f"look {shelf.looks}")]

    def finish(self, incident_id: str) -> list[NewFile]:
        """The best pictures, with boxes; forgets the record."""
        with self._guard:
            shelf = self._shelves.pop(incident_id, None)
        if shelf is None:
            return []
        files = []
        for number, name in enumerate(best_pictures((c for c, _, _ in shelf.candidates.values()), _BEST), 1):
            candidate, data, stamp = shelf.candidates[name]
            caption = f"probability {candidate.probability:.2f}"
            files.append(NewFile(name=f"best-{number}.jpg", role="best", data=data, stamp=stamp, caption=caption))
        return files

    def _consider(self, shelf: _Shelf, picture: Picture, plain: bytes) -> None:
        with self._guard:
            seen = next((s for s in self._sightings if abs(s.stamp - picture.stamp) <= _SAME), None)
        if seen is None or not seen.boxes:
            return
        largest = max(seen.boxes, key=lambda b: abs(b.xmax - b.xmin) * abs(b.ymax - b.ymin))
        area = abs(largest.xmax - largest.xmin) * abs(largest.ymax - largest.ymin)
        whole = picture.width * picture.height if isinstance(picture, RawPicture) else 640 * 480
        name = f"{picture.stamp:.3f}"
        candidate = Candidate(
            name=name,
            stamp=picture.stamp,
            probability=seen.probability,
            share=area / max(whole, 1),
            sharpness=sharpness(plain),
        )
        boxed = self._jpeg(picture, seen.boxes)
        if boxed is None:
            return
        shelf.candidates[name] = (candidate, boxed, picture.stamp)
        kept = set(best_pictures((c for c, _, _ in shelf.candidates.values()), _BEST))
        shelf.candidates = {name: item for name, item in shelf.candidates.items() if name in kept}

    def _jpeg(self, picture: Picture, boxes: Sequence[LabelledBox] = ()) -> bytes | None:
        try:
            return to_jpeg(picture, boxes, quality=_QUALITY)
        except AlertError as err:
            self.problems.add(str(err))
            return None
