"""People in a room during a patrol: their places, drawn at random among suitable ones."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.campaign.floor import RECOGNISED, VIEW_RANGE, Floor

NEAREST, FARTHEST = 1.0, 5.0  # distance from the room's point to a person in plain sight [m]
PLAIN, HIDDEN = 0.6, 0.12  # share of the body in the line of sight
VIEWPOINT = (0.9, 3.5)  # distance at which a hidden person can be recognised [m]
FROM_ELSEWHERE = (2.5, 6.0)  # path length of a person who arrives late [m]
_TRIES = 400


@dataclass(frozen=True, kw_only=True)
class Person:
    """A person whom the patrol should find: name and posture in the scenario."""

    name: str
    posture: str = ""


@dataclass(frozen=True)
class Cast:
    """The actors of a scenario, and which of them should be found."""

    actors: tuple[dict[str, Any], ...] = ()
    people: tuple[Person, ...] = ()
    viewpoint: tuple[float, float] | None = None
    title: str = ""


@dataclass(frozen=True)
class Stage:
    """A room in which to place people."""

    floor: Floor
    room: int
    rng: np.random.Generator

    @property
    def point(self) -> tuple[float, float]:
        """Point of the room, x, y [m]."""
        pose = next(room.pose for room in self.floor.rooms if room.id == self.room)
        return pose.x, pose.y

    def drawn(self) -> NDArray[np.float64]:
        """Places of the room where a person can stand, in random order, shape (N, 2)."""
        return self.rng.permutation(self.floor.places(self.room, self.floor.standable))

    def in_sight(self) -> tuple[float, float] | None:
        """A place in plain sight of the room's point."""
        for place in self.drawn()[:_TRIES]:
            away = math.dist(place, self.point)
            if not NEAREST <= away <= FARTHEST or self.floor.share_seen(self.point, place) < PLAIN:
                continue
            if self.floor.leaves_way(self.room, *place):
                return _rounded(place)
        return None

    def is_hidden_from_the_way(self, place: Sequence[float], posture: str) -> bool:
        """Whether too little of a body to be recognised is visible from the robot's route to the room."""
        drive = self.floor.drive_to(self.room)
        near = drive[np.hypot(*(drive - place).T) < VIEW_RANGE][::4]
        return all(self.floor.share_seen(eye, place, posture) < RECOGNISED for eye in near)

    def is_walkable(self, a: Sequence[float], b: Sequence[float]) -> bool:
        """Whether a person can walk to and fro between two places, and stop for the robot anywhere between."""
        count = max(int(math.dist(a, b) / 0.3), 1)
        between = [(a[0] + k / count * (b[0] - a[0]), a[1] + k / count * (b[1] - a[1])) for k in range(1, count)]
        return self.floor.is_straight(a, b) and all(self.floor.leaves_way(self.room, *p) for p in between)

    def facing(self) -> float:
        """A random heading [rad]."""
        return round(float(self.rng.uniform(-math.pi, math.pi)), 2)


def plain_place(floor: Floor, room: int, rng: np.random.Generator) -> tuple[float, float] | None:
    """A place in plain sight of a room's point, where the robot can pass [m]; None if there is none."""
    return Stage(floor, room, rng).in_sight()


def _standing(stage: Stage) -> Cast | None:
    place = stage.in_sight()
    if place is None:
        return None
    posture = ("standing", "standing", "sitting", "crouching")[int(stage.rng.integers(4))]
    actor = {"name": "intruder", "at": 1.0, "start": [*place, stage.facing()], "posture": posture}
    return Cast((actor,), (Person(name="intruder", posture=posture),), title=f"somebody {posture}")


def _walking(stage: Stage) -> Cast | None:
    for _ in range(80):
        a, b = stage.in_sight(), stage.in_sight()
        if a is None or b is None:
            return None
        if math.dist(a, b) >= 1.2 and stage.is_walkable(a, b):
            speed = round(float(stage.rng.uniform(0.3, 1.0)), 2)
            actor = {
                "name": "intruder", "at": 1.0, "start": [*a], "path": [[*b], [*a]],
                "speed": speed, "loop": True, "pause": 1.0,
            }  # fmt: skip
            return Cast((actor,), (Person(name="intruder"),), title=f"somebody who walks to and fro at {speed} m/s")
    return None


def _hidden(stage: Stage, *, also_from_the_way: bool = False) -> Cast | None:
    floor = stage.floor
    posture = ("standing", "sitting", "crouching")[int(stage.rng.integers(3))]
    views = stage.rng.permutation(floor.places(stage.room, floor.drivable))
    for place in stage.drawn()[:_TRIES]:
        if math.dist(place, stage.point) > FARTHEST + 1.0:
            continue
        if floor.share_seen(stage.point, place, posture) > HIDDEN or not floor.leaves_way(stage.room, *place):
            continue
        if also_from_the_way and not stage.is_hidden_from_the_way(place, posture):
            continue
        for view in views:
            if not VIEWPOINT[0] <= math.dist(view, place) <= VIEWPOINT[1]:
                continue
            if floor.share_seen(view, place, posture) >= PLAIN:
                spot = _rounded(place)
                actor = {"name": "intruder", "at": 1.0, "start": [*spot, stage.facing()], "posture": posture}
                title = f"somebody {posture} out of sight of the room's point"
                return Cast((actor,), (Person(name="intruder", posture=posture),), _rounded(view), title)
    return None


def _late(stage: Stage) -> Cast | None:
    floor = stage.floor
    goal = stage.in_sight()
    if goal is None:
        return None
    elsewhere = [room.id for room in floor.rooms if room.id != stage.room]
    outside = np.vstack([floor.places(room, floor.standable) for room in elsewhere])
    for place in stage.rng.permutation(outside)[:_TRIES]:
        if not 1.5 <= math.dist(place, stage.point) <= FROM_ELSEWHERE[1]:
            continue
        if floor.share_seen(stage.point, place) > HIDDEN:
            continue
        start = _rounded(place)
        way = floor.way(start, goal)
        length = sum(math.dist(a, b) for a, b in pairwise(way))
        if not way or not FROM_ELSEWHERE[0] <= length <= FROM_ELSEWHERE[1]:
            continue
        late = round(float(stage.rng.uniform(0.0, 4.0)), 1)
        actor = {
            "name": "intruder", "after": "looking", "at": late, "start": [*start],
            "path": [list(_rounded(p)) for p in way[1:]], "speed": 0.9,
        }  # fmt: skip
        title = f"somebody who comes {late} s after the robot has begun to look"
        return Cast((actor,), (Person(name="intruder"),), title=title)
    return None


def _two(stage: Stage) -> Cast | None:
    for _ in range(80):
        a, b = stage.in_sight(), stage.in_sight()
        if a is None or b is None:
            return None
        if math.dist(a, b) > 1.0:
            names = ("first", "second")
            actors = tuple(
                {"name": name, "at": 1.0, "start": [*place, stage.facing()]}
                for name, place in zip(names, (a, b), strict=True)
            )
            return Cast(actors, tuple(Person(name=name) for name in names), title="two people")
    return None


def _pets(stage: Stage) -> Cast | None:
    actors: list[dict[str, Any]] = []
    for name, model in (("rex", "dog"), ("minka", "cat"))[: int(stage.rng.integers(1, 3))]:
        place = stage.in_sight()
        if place is None:
            return None
        speed = round(float(stage.rng.uniform(0.3, 0.8)), 2)
        actors.append(
            {"name": name, "model": model, "at": 1.0, "start": [*place], "roam": 1.5, "speed": speed, "pause": 2.0}
        )
    return Cast(tuple(actors), title=" and ".join(f"a {actor['model']}" for actor in actors))


def _poster(stage: Stage) -> Cast | None:
    for place in stage.drawn()[:_TRIES]:
        wall = stage.floor.wall_behind(float(place[0]), float(place[1]))
        if wall is None or not 1.5 <= math.dist(wall[:2], stage.point) <= 4.0:
            continue
        ahead = (wall.x + 0.2 * math.cos(wall.yaw), wall.y + 0.2 * math.sin(wall.yaw))
        if stage.floor.share_seen(stage.point, ahead) >= PLAIN:
            start = [round(float(value), 3) for value in wall]
            return Cast(({"name": "poster", "model": "poster", "at": 1.0, "start": start},), title="a poster")
    return None


def _empty(stage: Stage) -> Cast | None:
    return Cast(title="nobody")


# How to cast each kind; the next function only if no room of the house has a place for the previous one.
CASTS: dict[str, tuple[Callable[[Stage], Cast | None], ...]] = {
    "standing": (_standing,),
    "walking": (_walking,),
    "hidden": (partial(_hidden, also_from_the_way=True), _hidden),
    "late": (_late,),
    "two": (_two,),
    "pets": (_pets,),
    "poster": (_poster,),
    "empty": (_empty,),
}


def _rounded(place: Sequence[float]) -> tuple[float, float]:
    return round(float(place[0]), 2), round(float(place[1]), 2)
