"""Who was met on a mission: the same person once, another one as another.

Somebody who is seen again near where they were last seen, or as far off as they can have walked, is the same. Of two
whom the lidar has not seen move, neither has walked. Somebody in the same direction is the same, too: their distance
may have been measured wrongly. Two people whom pictures showed side by side are never merged. Somebody without a known
place counts as the one seen last.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass

from rosbot_patrol.geometry import Pose2D, angle_difference
from rosbot_patrol.params import param
from rosbot_patrol.patrol.records.findings import Person
from rosbot_patrol.patrol.records.inputs import Measured

_IN_LINE = 0.1  # [rad]


@dataclass(frozen=True, kw_only=True)
class PersonsParams:
    """Conditions under which two sightings are of the same person."""

    same_person: float = param(1.0, unit="m", lo=0.1, doc="sightings closer than this belong to the same person")
    walking_speed: float = param(
        1.0, unit="m/s", lo=0.0, doc="growth of that distance with the time since the last sighting"
    )
    walked_most: float = param(
        5.0, unit="m", lo=0.0, doc="upper limit of that growth; sightings farther apart are of different people"
    )


class Persons:
    """Those met on one mission."""

    def __init__(self, params: PersonsParams | None = None) -> None:
        self.params = params or PersonsParams()
        self.met: list[Person] = []
        self._by_key: dict[int, Person] = {}

    def recall(self, places: Iterable[tuple[float, float] | None], now: float) -> None:
        """Those met before the program ended, as if they had been seen now."""
        for place in places:
            x, y = place or (None, None)
            self.met.append(Person(number=len(self.met) + 1, x=x, y=y, error=0.3, at=now))

    @property
    def places(self) -> list[tuple[float, float] | None]:
        """Where each was last."""
        return [None if p.x is None or p.y is None else (p.x, p.y) for p in self.met]

    def note(
        self,
        now: float,
        measured: Measured | None,
        key: int | None = None,
        apart: Collection[int] = (),
        *,
        eye: Pose2D | None = None,
        stays: bool = False,
    ) -> tuple[Person, bool]:
        """Somebody was confirmed; who it is, and whether for the first time.

        Args:
            now: steady time [s].
            measured: where, None if unknown.
            key: sightings with the same key are known to be of the same person.
            apart: keys of those who are known to be others.
            eye: the camera in map, None if unknown.
            stays: the lidar, which sees, has not seen them move.
        """
        person = self._by_key.get(key) if key is not None else None
        others = [self._by_key[k] for k in apart if k in self._by_key]
        person = person or self._who(now, measured, others, eye, stays=stays)
        is_new = person is None
        if person is None:
            person = Person(number=len(self.met) + 1, x=None, y=None, error=math.inf, at=now)
            self.met.append(person)
        if key is not None:
            self._by_key[key] = person
        if measured is not None and (measured.error <= 2.0 * person.error or now - person.at > 1.0):
            person.x, person.y, person.error = measured.x, measured.y, measured.error
        person.at, person.stays = now, stays
        person.sightings += 1
        return person, is_new

    def walks(self, key: int) -> None:
        """The lidar saw the person with this key move, if one was met."""
        if key in self._by_key:
            self._by_key[key].stays = False

    def _who(
        self, now: float, measured: Measured | None, others: Sequence[Person], eye: Pose2D | None, *, stays: bool
    ) -> Person | None:
        left = [person for person in self.met if not any(person is other for other in others)]
        if measured is None:
            return max(left, key=lambda person: person.at, default=None)
        may_be = [
            p
            for p in left
            if self._gap(now, p, measured, may_walk=not (stays and p.stays)) <= 0.0 or _is_in_line(eye, p, measured)
        ]
        return min(may_be, key=lambda person: _apart(person, measured), default=None)

    def _gap(self, now: float, person: Person, measured: Measured, *, may_walk: bool) -> float:
        """How much farther apart than one can have walked [m], 0 or less where it may be the same."""
        p = self.params
        if person.x is None or person.y is None:
            return 0.0
        walked = min(p.walking_speed * (now - person.at), p.walked_most) if may_walk else 0.0
        return _apart(person, measured) - p.same_person - walked - min(measured.error, 1.0) - min(person.error, 1.0)


def _is_in_line(eye: Pose2D | None, person: Person, measured: Measured) -> bool:
    """Whether a camera sees a place in the direction of a person."""
    if eye is None or person.x is None or person.y is None:
        return False
    known = math.atan2(person.y - eye.y, person.x - eye.x)
    return abs(angle_difference(known, math.atan2(measured.y - eye.y, measured.x - eye.x))) < _IN_LINE


def _apart(person: Person, measured: Measured) -> float:
    """How far a place is from where a person was last [m], inf where that is not known."""
    if person.x is None or person.y is None:
        return math.inf
    return math.hypot(measured.x - person.x, measured.y - person.y)
