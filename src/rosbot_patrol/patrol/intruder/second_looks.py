"""What looked like a person and was not told surely: places that are worth another look, and whether they had it.

Three kinds. What was too far off to be measured is looked at from nearer. What looks like a person from one side only
is looked at from another, and is nothing only where most pictures from there showed its place, and nobody. What was too
near to be told from a pet is looked at from farther off, again where it has moved meanwhile, and is nothing only where
its place was seen from there and nothing moves in the room; what moves there is looked at, too, as it may be that.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from rosbot_patrol.geometry import Pose2D, angle_difference
from rosbot_patrol.patrol.intruder.close_ups import SeenAt
from rosbot_patrol.patrol.intruder.weak_sightings import WeakSighting
from rosbot_patrol.patrol.records.inputs import Eye
from rosbot_patrol.patrol.visibility.coverage import Sight

_SAME_FAR = 1.5  # boxes too far off to be measured that are nearer are of one thing, and so are those too near [m]
_SAME_SUSPECT = 0.9  # what looks like a person moves by less as it is measured from elsewhere [m]
_MOVED = 0.6  # what was too near and stands so much farther on has to be looked for again [m]
_FOLLOWED = 5.0  # what moves and is farther from there is another [m]
_VISITS = 3  # of what is too near wherever the robot goes: it comes along
_VISITS_GRAVE = 4  # of what looks much like a person
_VISITS_UNSURE = 2  # of what looks little like one
_LOOKS = 5  # pictures of another side that tell
_WELL = 1.8  # from so far off what is half hidden is seen well; nearer it is hardly told from a pet [m]
_CLOSE = 1.0  # so near one may come to what is half hidden [m]
_BACK = 2.0, 4.5  # from there a person shows whole [m]
_WHOLE = 1.7  # from so far off one who stands cannot be taken for a pet [m]
_INSIDE = 0.1  # of the picture's edges a place must lie [rad]
_ASIDE = 0.6  # from so far aside a place shows another side [rad]
_NEARER = 0.8  # of the least distance so far: that is another look, too
_BODY = 0.4  # in front of a place its own body may end a beam [m]


@dataclass
class SecondLook:
    """A place [m] in map where something like a person, or what else alarms, was seen.

    Attributes:
        label: class of object that it may be.
        pictures: that showed it.
        seen_from: where a second side is wanted, the sides that are known.
        is_grave: without a second look nobody can say that nobody is there.
        is_near: too near to be told from a pet.
        is_visited: it had its look, or needs none.
        is_over: somebody was confirmed there, or it no longer looks like anybody.
        visits: viewpoints that it was to be looked at from.
        tried: those viewpoints.
        known_from: the sides that were known when the last of them was chosen.
        looks: pictures that showed its place from there: from farther off, or from another side, and nobody.
        seen_again: pictures that showed it, from there, too.
        was_at: where it was too near, since what moves elsewhere is looked at for it.
    """

    x: float
    y: float
    label: str = "person"
    pictures: int = 1
    seen_from: tuple[Pose2D, ...] = ()
    is_grave: bool = True
    is_near: bool = False
    is_visited: bool = False
    is_over: bool = False
    visits: int = 0
    tried: tuple[tuple[float, float], ...] = ()
    known_from: tuple[Pose2D, ...] = ()
    looks: int = 0
    seen_again: int = 0
    was_at: tuple[float, float] | None = None

    @property
    def text(self) -> str:
        """What is to be said of it where it stays one."""
        looked = "was seen from one side only" if self.seen_from else "was not seen from near"
        if self.is_near:
            looked = "was too near to be told from a pet"
        x, y = self.was_at or (self.x, self.y)
        return f"something like a {self.label} at about ({x:.1f}, {y:.1f}) {looked}"

    @property
    def spans(self) -> Sequence[dict[str, float]]:
        """From how near and how far it is to be looked at, as far as that matters, the best first [m]."""
        if self.is_near:
            return ({"nearest": _BACK[0], "most": _BACK[1]},)
        return ({"nearest": _WELL}, {"nearest": _CLOSE}) if self.seen_from else ({},)

    @property
    def goes_on(self) -> bool:
        """Whether another viewpoint is worth its time where one was in vain."""
        if self.is_near:
            return self.visits < _VISITS
        return self.visits < (_VISITS_GRAVE if self.is_grave else _VISITS_UNSURE)

    def visit(self, at: Pose2D) -> None:
        """Take it that the robot goes somewhere and looks."""
        self.is_visited = True
        self.visits += 1
        self.tried += ((at.x, at.y),)
        self.known_from = self.seen_from

    def move_to(self, x: float, y: float, was_at: tuple[float, float] | None = None) -> None:
        """Take it that it has moved to another place [m], and had no look there."""
        self.x, self.y, self.was_at = x, y, was_at
        self.is_visited, self.looks, self.tried = False, 0, ()

    def shows(self, eye: Eye, sight: Sight) -> bool:
        """Whether a picture is the second look that this place wants."""
        if self.is_near:
            return shows_whole(eye, sight, self.x, self.y)
        return self.is_visited and bool(self.known_from) and shows_anew(eye, sight, self)


class SecondLooks:
    """Those of one mission.

    Args:
        seen_in: pictures that have to show a thing to make it one.
    """

    def __init__(self, seen_in: int) -> None:
        self._seen_in = seen_in
        self._all: list[SecondLook] = []
        self._too_near: Sequence[SeenAt] = ()  # what nobody has told from a pet yet
        self._weak_sightings: Sequence[WeakSighting] = ()

    def __iter__(self) -> Iterator[SecondLook]:
        return iter(self._all)

    def add_far(self, label: str, x: float, y: float) -> None:
        """Take in that something of a class was seen at about a place, too far off to be measured."""
        for doubt in self._all:
            if not doubt.seen_from and not doubt.is_near and math.hypot(doubt.x - x, doubt.y - y) < _SAME_FAR:
                doubt.pictures += 1
                return
        self._all.append(SecondLook(x, y, label))

    def suspect(self, doubtful: Sequence[WeakSighting]) -> None:
        """Take in what seems to be a person from one side, all that is so by now."""
        for suspect in doubtful:
            known = next((d for d in self._all if d.seen_from and suspect.apart(d.x, d.y) < _SAME_SUSPECT), None)
            if known is None:
                known = SecondLook(suspect.x, suspect.y, suspect.label, pictures=self._seen_in)
                self._all.append(known)
            known.is_grave = suspect.is_grave
            known.seen_from = tuple(side.eye for side in suspect.sides)
        for doubt in self._all:
            if doubt.seen_from and not any(s.apart(doubt.x, doubt.y) < _SAME_SUSPECT for s in doubtful):
                doubt.is_visited = doubt.is_over = True
        self._weak_sightings = tuple(doubtful)

    def set_too_near(self, doubtful: Sequence[SeenAt]) -> None:
        """Take in what is too near to be told from a pet, all that is so by now."""
        for thing in doubtful:
            known = next((d for d in self._all if d.is_near and _apart(d, thing) < _SAME_FAR), None)
            if known is None:
                self._all.append(SecondLook(thing.x, thing.y, pictures=self._seen_in, is_near=True))
            elif known.was_at == (thing.x, thing.y):
                continue
            elif not known.is_visited:
                known.x, known.y, known.was_at = thing.x, thing.y, None
            elif _apart(known, thing) > _MOVED and known.visits < _VISITS:
                known.move_to(thing.x, thing.y)
        for doubt in self._all:
            if doubt.is_near and not any(_apart(doubt, thing) < _SAME_FAR for thing in doubtful):
                doubt.is_visited = doubt.is_over = True
        self._too_near = tuple(doubtful)

    def follow(self, moving: Iterable[tuple[float, float]]) -> None:
        """Look at what moves, too, where it may be what was too near and is not there any more.

        Args:
            moving: where something moves, in map [m].
        """
        places = tuple(moving)
        for doubt in self._all:
            if not doubt.is_near or not doubt.is_visited or doubt.is_over or doubt.looks < self._seen_in:
                continue
            here = doubt.x, doubt.y
            apart, place = min(((math.dist(here, place), place) for place in places), default=(0.0, here))
            if _MOVED < apart < _FOLLOWED and doubt.visits < _VISITS:
                doubt.move_to(*place, was_at=doubt.was_at or here)

    def look(self, stamp: float | None, eye: Eye, sight: Sight) -> None:
        """Count a picture for the places that it gives a second look at.

        Args:
            stamp: of the picture [s], None where it showed nothing.
            eye: the camera then.
            sight: how far one could look from there.
        """
        for doubt in self._all:
            if not doubt.shows(eye, sight):
                continue
            if stamp is not None and not doubt.is_near and self._was_seen(doubt, stamp):
                doubt.seen_again += 1
            else:
                doubt.looks += 1

    def _was_seen(self, doubt: SecondLook, stamp: float) -> bool:
        """Whether a picture, or one after it, shows something like a person at a place."""
        return any(
            s.seen_at >= stamp and s.apart(doubt.x, doubt.y) < _SAME_SUSPECT for s in self._weak_sightings
        ) or any(thing.at >= stamp and _apart(doubt, thing) < _SAME_SUSPECT for thing in self._too_near)

    def open(self) -> list[SecondLook]:
        """Those seen in some pictures and not looked at again, or in vain: the way was blocked, or the view."""
        known = [doubt for doubt in self._all if doubt.pictures >= self._seen_in]
        return [doubt for doubt in known if not doubt.is_visited or (self._is_in_vain(doubt) and doubt.goes_on)]

    def grave(self) -> list[SecondLook]:
        """Those without whose second look nobody can say that nobody is there."""
        return [doubt for doubt in self.open() if doubt.is_grave and not doubt.is_visited] + [
            doubt for doubt in self._all if doubt.seen_from and doubt.is_grave and self._is_in_vain(doubt)
        ]

    def _is_in_vain(self, doubt: SecondLook) -> bool:
        """It was seen from one side, or too near, and pictures from elsewhere did not show its place, or it again."""
        wanted = self._seen_in if doubt.is_near else max(_LOOKS, doubt.seen_again) if doubt.seen_from else 0
        return doubt.is_visited and not doubt.is_over and doubt.looks < wanted

    def unsure(self, is_moving: bool) -> str:
        """What is still too near to be told, "" where there is nothing.

        A place that was seen from farther off is told: if anybody was there, the watch knows.

        Args:
            is_moving: something moves in the room: it may have gone from there.
        """
        for thing in self._too_near:
            if is_moving or not any(self._was_looked_at(doubt, thing) for doubt in self._all):
                return SecondLook(thing.x, thing.y, is_near=True).text
        return ""

    def _was_looked_at(self, doubt: SecondLook, thing: SeenAt) -> bool:
        return doubt.is_near and doubt.looks >= self._seen_in and _apart(doubt, thing) < _SAME_FAR


def _apart(doubt: SecondLook, thing: SeenAt) -> float:
    return math.dist(doubt.was_at or (doubt.x, doubt.y), (thing.x, thing.y))


def shows_anew(eye: Eye, sight: Sight, doubt: SecondLook) -> bool:
    """Whether a picture shows a place from another side than those known, or from nearer than any of them."""
    away, bearing = math.hypot(doubt.x - eye.pose.x, doubt.y - eye.pose.y), _bearing(eye.pose, doubt)
    aside = min(abs(angle_difference(_bearing(known, doubt), bearing)) for known in doubt.known_from)
    before = min(math.hypot(doubt.x - known.x, doubt.y - known.y) for known in doubt.known_from)
    if aside < _ASIDE and away > _NEARER * before:
        return False
    return _is_in_view(eye, sight, away, bearing)


def shows_whole(eye: Eye, sight: Sight, x: float, y: float) -> bool:
    """Whether a picture shows a place in map [m] from as far off as a person shows whole."""
    away, bearing = math.hypot(x - eye.pose.x, y - eye.pose.y), math.atan2(y - eye.pose.y, x - eye.pose.x)
    return _WHOLE <= away <= _BACK[1] + 0.5 and _is_in_view(eye, sight, away, bearing)


def _bearing(eye: Pose2D, doubt: SecondLook) -> float:
    return math.atan2(doubt.y - eye.y, doubt.x - eye.x)


def _is_in_view(eye: Eye, sight: Sight, away: float, bearing: float) -> bool:
    if abs(angle_difference(bearing, eye.pose.yaw)) > 0.5 * eye.width - _INSIDE:
        return False
    return bool(sight.reaches(np.array([bearing]), np.array([away - _BODY]))[0])
