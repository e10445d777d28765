"""What happens in each patrol of a campaign, drawn from a seed: house, room, who is there, and what should come.

Patrol k of seed s is the same whatever else is run: the seed of everything in it is (s, k). Each block of
`len(KINDS)` patrols has every kind once, in an order of its own; the houses take turns.

Nobody is put into a wall or into the robot's only way: every place is one where somebody has room to stand by the
world's own shapes. Somebody hidden is out of sight from the room's point, and where the house allows it from the
way there, but not from everywhere that the robot can reach in that room.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray

from rosbot_patrol.campaign.floor import RECOGNISED, VIEW_RANGE, Floor
from rosbot_patrol.campaign.houses import HouseFiles
from rosbot_patrol.errors import WorldError

KINDS = ("standing", "walking", "hidden", "late", "standing", "walking", "two", "pets", "poster", "empty")
INTRUDERS = frozenset({"standing", "walking", "hidden", "late", "two"})

CLEAR, CONFIRMED = "clear", "confirmed"
NEAREST, FARTHEST = 1.0, 5.0  # from the room's point, somebody who stands in plain sight [m]
PLAIN, HIDDEN = 0.6, 0.12  # share of the body in the line of sight
VIEWPOINT = (0.9, 3.5)  # how far off a hidden one can be recognised [m]
TRIGGER_AT = 2.0  # [s] after the first guard
FROM_ELSEWHERE = (2.5, 6.0)  # way that somebody who arrives late has to go [m]
WITHIN = 600.0  # simulated time for a patrol [s]
_TRIES = 400


@dataclass(frozen=True, kw_only=True)
class Person:
    """Somebody whom the patrol should find: name and posture in the scenario."""

    name: str
    posture: str = ""


@dataclass(frozen=True, kw_only=True)
class Patrol:
    """One planned patrol.

    Attributes:
        number: in the campaign; seed: of the campaign.
        kind: one of KINDS.
        house: its name; room: number of the room that is triggered.
        people: who should be found; expected: the verdict.
        viewpoint: a place from which a hidden one is seen [m], None where nobody hides.
        scenario: the file's tree.
    """

    number: int
    seed: int
    kind: str
    house: str
    room: int
    room_name: str
    expected: str
    scenario: dict[str, Any]
    people: tuple[Person, ...] = ()
    viewpoint: tuple[float, float] | None = None

    @property
    def title(self) -> str:
        """What it is about, in a line."""
        return str(self.scenario["title"])

    def to_plain(self) -> dict[str, Any]:
        """For JSON."""
        return asdict(self)


def patrol_from_plain(tree: dict[str, Any]) -> Patrol:
    """What `to_plain` made. Raises KeyError, TypeError where it is something else."""
    people = tuple(Person(**person) for person in tree["people"])
    viewpoint = tree["viewpoint"]
    at = (float(viewpoint[0]), float(viewpoint[1])) if viewpoint else None
    return Patrol(**{**tree, "people": people, "viewpoint": at})


def kind_of(seed: int, number: int) -> str:
    """The kind of a patrol."""
    block, place = divmod(number, len(KINDS))
    return KINDS[int(np.random.default_rng([seed, block, 1]).permutation(len(KINDS))[place])]


def house_of(seed: int, number: int, houses: Sequence[str]) -> str:
    """The house of a patrol: they take turns, and begin with another in each block."""
    return houses[(number + number // len(KINDS) + seed) % len(houses)]


def plan_patrol(seed: int, number: int, files: HouseFiles, floor: Floor) -> Patrol:
    """Draw a patrol.

    Args:
        seed: of the campaign.
        number: of the patrol.
        files: of the house that it is in.
        floor: of that house.

    Raises:
        WorldError: no room of the house has a place for what the kind asks for.
    """
    kind = kind_of(seed, number)
    rng = np.random.default_rng([seed, number, 2])
    rooms = [room.id for room in floor.rooms if room.id != floor.rooms.base.id]
    for make in _CASTS[kind]:
        for room in rng.permutation(rooms):
            cast = make(_Stage(floor, int(room), rng))
            if cast is not None:
                return _patrol(seed, number, kind, files, floor, int(room), cast)
    raise WorldError(files.name, f"has no room with a place for a patrol of the kind '{kind}'")


@dataclass(frozen=True)
class _Cast:
    """Who is there: the scenario's actors, and which of them should be found."""

    actors: tuple[dict[str, Any], ...] = ()
    people: tuple[Person, ...] = ()
    viewpoint: tuple[float, float] | None = None
    told: str = ""


@dataclass(frozen=True)
class _Stage:
    """A room to put somebody into."""

    floor: Floor
    room: int
    rng: np.random.Generator

    @property
    def point(self) -> tuple[float, float]:
        pose = next(room.pose for room in self.floor.rooms if room.id == self.room)
        return pose.x, pose.y

    def drawn(self) -> NDArray[np.float64]:
        """Places of the room where somebody can stand, in a random order, shape (N, 2)."""
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
        """Whether too little of a body to be recognised is seen from the robot's way to the room."""
        drive = self.floor.drive_to(self.room)
        near = drive[np.hypot(*(drive - place).T) < VIEW_RANGE][::4]
        return all(self.floor.share_seen(eye, place, posture) < RECOGNISED for eye in near)

    def is_walkable(self, a: Sequence[float], b: Sequence[float]) -> bool:
        """Whether somebody can go to and fro between two places, and stop for the robot anywhere between them."""
        count = max(int(math.dist(a, b) / 0.3), 1)
        between = [(a[0] + k / count * (b[0] - a[0]), a[1] + k / count * (b[1] - a[1])) for k in range(1, count)]
        return self.floor.is_straight(a, b) and all(self.floor.leaves_way(self.room, *p) for p in between)

    def facing(self) -> float:
        return round(float(self.rng.uniform(-math.pi, math.pi)), 2)


def plain_place(floor: Floor, room: int, rng: np.random.Generator) -> tuple[float, float] | None:
    """A place in plain sight of a room's point, where the robot can pass; None where there is none [m]."""
    return _Stage(floor, room, rng).in_sight()


def _standing(stage: _Stage) -> _Cast | None:
    place = stage.in_sight()
    if place is None:
        return None
    posture = ("standing", "standing", "sitting", "crouching")[int(stage.rng.integers(4))]
    actor = {"name": "intruder", "at": 1.0, "start": [*place, stage.facing()], "posture": posture}
    return _Cast((actor,), (Person(name="intruder", posture=posture),), told=f"somebody {posture}")


def _walking(stage: _Stage) -> _Cast | None:
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
            return _Cast((actor,), (Person(name="intruder"),), told=f"somebody who walks to and fro at {speed} m/s")
    return None


def _hidden(stage: _Stage, *, also_from_the_way: bool = False) -> _Cast | None:
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
                told = f"somebody {posture} out of sight of the room's point"
                return _Cast((actor,), (Person(name="intruder", posture=posture),), _rounded(view), told)
    return None


def _late(stage: _Stage) -> _Cast | None:
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
        told = f"somebody who comes {late} s after the robot has begun to look"
        return _Cast((actor,), (Person(name="intruder"),), told=told)
    return None


def _two(stage: _Stage) -> _Cast | None:
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
            return _Cast(actors, tuple(Person(name=name) for name in names), told="two people")
    return None


def _pets(stage: _Stage) -> _Cast | None:
    actors: list[dict[str, Any]] = []
    for name, model in (("rex", "dog"), ("minka", "cat"))[: int(stage.rng.integers(1, 3))]:
        place = stage.in_sight()
        if place is None:
            return None
        speed = round(float(stage.rng.uniform(0.3, 0.8)), 2)
        actors.append(
            {"name": name, "model": model, "at": 1.0, "start": [*place], "roam": 1.5, "speed": speed, "pause": 2.0}
        )
    return _Cast(tuple(actors), told=" and ".join(f"a {actor['model']}" for actor in actors))


def _poster(stage: _Stage) -> _Cast | None:
    for place in stage.drawn()[:_TRIES]:
        wall = stage.floor.wall_behind(float(place[0]), float(place[1]))
        if wall is None or not 1.5 <= math.dist(wall[:2], stage.point) <= 4.0:
            continue
        ahead = (wall.x + 0.2 * math.cos(wall.yaw), wall.y + 0.2 * math.sin(wall.yaw))
        if stage.floor.share_seen(stage.point, ahead) >= PLAIN:
            start = [round(float(value), 3) for value in wall]
            return _Cast(({"name": "poster", "model": "poster", "at": 1.0, "start": start},), told="a poster")
    return None


def _empty(stage: _Stage) -> _Cast | None:
    return _Cast(told="nobody")


# How to cast each kind; the next way only where no room of the house has a place for the one before.
_CASTS: dict[str, tuple[Callable[[_Stage], _Cast | None], ...]] = {
    "standing": (_standing,),
    "walking": (_walking,),
    "hidden": (partial(_hidden, also_from_the_way=True), _hidden),
    "late": (_late,),
    "two": (_two,),
    "pets": (_pets,),
    "poster": (_poster,),
    "empty": (_empty,),
}


def _patrol(seed: int, number: int, kind: str, files: HouseFiles, floor: Floor, room: int, cast: _Cast) -> Patrol:
    known = floor.rooms.find(room)
    assert known is not None
    expected = CONFIRMED if kind in INTRUDERS else CLEAR
    tree: dict[str, Any] = {
        "title": f"{cast.told} in the {known.name} ({files.name})",
        "world": str(files.world),
        "motion_sensors": str(files.sensors),
        "map": str(files.map),
        "room_points": str(files.rooms),
        "seed": seed * 1000 + number,
        "actors": [dict(actor) for actor in cast.actors],
        "triggers": [{"sensor": room, "at": TRIGGER_AT}],
        "expect": {"verdicts": {room: expected}, "within": WITHIN},
    }
    return Patrol(
        number=number,
        seed=seed,
        kind=kind,
        house=files.name,
        room=room,
        room_name=known.name,
        expected=expected,
        scenario=tree,
        people=cast.people,
        viewpoint=cast.viewpoint,
    )


def scenario_text(patrol: Patrol) -> str:
    """The scenario's file."""
    expect = dict(patrol.scenario["expect"])
    expect["verdicts"] = {int(room): verdict for room, verdict in expect["verdicts"].items()}  # JSON made them text
    return yaml.safe_dump({**patrol.scenario, "expect": expect}, sort_keys=False, allow_unicode=True, width=120)


def _rounded(place: Sequence[float]) -> tuple[float, float]:
    return round(float(place[0]), 2), round(float(place[1]), 2)
