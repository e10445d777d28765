"""What is so near that the picture shows its legs only: a pet and a person look alike there.

A low camera sees up to 0.9 m at a metre and a half. What is nearer than that, and goes on above the picture, counts as
a person only where depth shows a person's legs, or where somebody was seen about there shortly before or after: of a
person's height, or going on above a picture that ends higher up than any pet. Where a pet was, it is the pet; else it
is a doubt, and worth a look from farther off.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from rosbot_patrol.patrol.intruder.exclusions import Exclusions, Reason, goes_on
from rosbot_patrol.patrol.records.inputs import Box, Eye, Measured

_SAME = 1.0  # so near to each other two sightings are of one [m]
_SPEED = 1.0  # it may have walked so fast since [m/s]
_WALKED = 4.0  # but no farther [m]
_SURE = 0.7  # probability of a sighting that speaks for a person: a dog far off is taken for one now and then
_TALL = 1.1  # and its top above the floor [m]
BEYOND = 0.8  # so much beyond a wall that it stands before may it be measured [m]
_SHORTLY = 3.0  # [s]
_SURER = 0.25  # by so much surer a sighting tells more
_OFTEN = 3  # such sightings, at least


@dataclass(frozen=True)
class SeenAt:
    """Where something was, in map [m], and when [s].

    Attributes:
        is_part: only a part of it showed, at the picture's edge.
        score: how sure the detector was.
    """

    x: float
    y: float
    at: float
    is_part: bool = False
    score: float = 1.0

    def may_be(self, other: SeenAt) -> bool:
        """Whether both may be of one."""
        walked = min(_SPEED * abs(self.at - other.at), _WALKED)
        return math.hypot(self.x - other.x, self.y - other.y) <= _SAME + walked

    def tells_more(self, other: SeenAt) -> bool:
        """Whether its place is to be believed rather than that of another of the same, a little later."""
        if self.is_part != other.is_part:
            return other.is_part
        return self.score > other.score + _SURER


class CloseUps:
    """Those of one mission.

    Args:
        exclusions: what is a pet, and what is too near to tell.
    """

    def __init__(self, exclusions: Exclusions) -> None:
        self._exclusions = exclusions
        self._pets: deque[SeenAt] = deque(maxlen=20)
        self._people: deque[SeenAt] = deque(maxlen=20)
        self._open: list[SeenAt] = []

    def start(self) -> None:
        """Forget all, for a new mission."""
        self._pets.clear()
        self._people.clear()
        self._open = []

    @property
    def doubtful(self) -> Sequence[SeenAt]:
        """What was too near to be told, and was not told otherwise."""
        return self._open

    def add_pets(self, sightings: Iterable[SeenAt]) -> None:
        """Take in where something was that moves and is no person."""
        new = [s for s in sightings if s not in self._pets]
        self._pets.extend(new)
        if new:
            self._open = [s for s in self._open if not self._is_settled(s)]

    def sort(self, stamp: float, boxes: Iterable[Box], eye: Eye | None = None) -> tuple[tuple[Box, ...], bool]:
        """The boxes of a picture that can be judged, and whether one was left out that may be a person.

        Args:
            stamp: of the picture [s].
            boxes: all of them.
            eye: the camera then, where that is known.
        """
        kept, near = [], []
        for box in boxes:
            m = box.measured
            if m is None or box.label != "person":
                kept.append(box)
                continue
            place = SeenAt(*self._before_walls(m, eye), stamp, m.is_cut_aside, box.probability)
            if self._exclusions.is_too_near(box) and not m.has_legs:
                near.append((box, place))
                continue
            kept.append(box)
            exclusion = self._exclusions.exclusion(box)
            if exclusion is not None:
                if exclusion.reason is Reason.PET:
                    self._pets.append(place)
            elif box.probability >= _SURE and (m.has_legs or self._is_tall(box, m)):
                self._people.append(place)
        self._open = [s for s in self._open if not self._is_settled(s)]
        is_left = False
        for box, place in near:
            if self._is_person(place):
                kept.append(box)
            elif self._exclusions.exclusion(box) is None and not any(place.may_be(pet) for pet in self._pets):
                is_left = True
                self._note(place)
        return tuple(kept), is_left

    def _is_tall(self, box: Box, m: Measured) -> bool:
        """Taller than any pet, by a margin where the picture shows all of it."""
        return m.top >= (self._exclusions.params.person_top_min if goes_on(box, m) else _TALL)

    def _note(self, place: SeenAt) -> None:
        """The newest place of one counts, unless one shortly before tells more."""
        before = [s for s in self._open if s.may_be(place)]
        kept = [s for s in before if s.tells_more(place) and place.at - s.at <= _SHORTLY]
        self._open = [s for s in self._open if s not in before] + (kept[-1:] or [place])

    def _before_walls(self, m: Measured, eye: Eye | None) -> tuple[float, float]:
        """The place of something, on the near side of the wall that it stands before."""
        if eye is None or self._exclusions.floor is None:
            return m.x, m.y
        return self._exclusions.floor.before((eye.pose.x, eye.pose.y), m.x, m.y, BEYOND)

    def _is_person(self, place: SeenAt) -> bool:
        return sum(place.may_be(person) for person in self._people) >= _OFTEN

    def _is_settled(self, place: SeenAt) -> bool:
        return self._is_person(place) or any(place.may_be(pet) for pet in self._pets)
