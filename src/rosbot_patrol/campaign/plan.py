"""Plan of each patrol in a campaign, drawn from a seed: house, room, people, expected outcome.

Patrol k of seed s is the same whatever else is run: everything in it uses the seed (s, k). Each block of `len(KINDS)`
patrols has every kind once, in its own order; the houses take turns.

Nobody is placed in a wall or on the robot's only path: by the world's own shapes there is room to stand at every place.
A hidden person is out of sight from the room's point and, if the house allows it, from the route there. But some place
in that room, within the robot's reach, has a view of the person.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
import yaml

from rosbot_patrol.campaign.cast import CASTS, Cast, Person, Stage
from rosbot_patrol.campaign.floor import Floor
from rosbot_patrol.campaign.houses import HouseFiles
from rosbot_patrol.campaign.mishaps import mishap_of
from rosbot_patrol.errors import WorldError

KINDS = ("standing", "walking", "hidden", "late", "standing", "walking", "two", "pets", "poster", "empty")
INTRUDERS = frozenset({"standing", "walking", "hidden", "late", "two"})

CLEAR, CONFIRMED = "clear", "confirmed"
TRIGGER_AT = 2.0  # [s] after the first guard
WITHIN = 600.0  # simulated time limit of a patrol [s]
PASSES = 8  # passes over all rooms: each draws some places and one posture only


@dataclass(frozen=True, kw_only=True)
class Patrol:
    """One planned patrol.

    Attributes:
        number: in the campaign; seed: of the campaign.
        kind: one of KINDS.
        house: its name; room: number of the triggered room.
        people: persons to be found; expected: the verdict.
        viewpoint: a place with a view of the hidden person [m], None if nobody hides.
        scenario: contents of the scenario file.
        mishap: the fault in words, "" for none; allowed: verdicts that it excuses.
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
    mishap: str = ""
    allowed: tuple[str, ...] = ()

    @property
    def title(self) -> str:
        """Description in one line."""
        return str(self.scenario["title"])

    def to_plain(self) -> dict[str, Any]:
        """Contents for JSON."""
        return asdict(self)


def patrol_from_plain(tree: dict[str, Any]) -> Patrol:
    """Patrol from the result of `to_plain`. Raises KeyError, TypeError for anything else."""
    people = tuple(Person(**person) for person in tree["people"])
    viewpoint = tree["viewpoint"]
    at = (float(viewpoint[0]), float(viewpoint[1])) if viewpoint else None
    return Patrol(**{**tree, "people": people, "viewpoint": at, "allowed": tuple(tree.get("allowed", ()))})


def kind_of(seed: int, number: int) -> str:
    """Kind of a patrol."""
    block, place = divmod(number, len(KINDS))
    return KINDS[int(np.random.default_rng([seed, block, 1]).permutation(len(KINDS))[place])]


def house_of(seed: int, number: int, houses: Sequence[str]) -> str:
    """House of a patrol: they take turns, starting with another one in each block."""
    return houses[(number + number // len(KINDS) + seed) % len(houses)]


def plan_patrol(seed: int, number: int, files: HouseFiles, floor: Floor, *, faults: bool = False) -> Patrol:
    """Plan a patrol.

    Args:
        seed: of the campaign.
        number: of the patrol.
        files: of the house that it is in.
        floor: of that house.
        faults: whether every other patrol has a fault; the people stay the same.

    Raises:
        WorldError: no room of the house has a place that suits the kind.
    """
    kind = kind_of(seed, number)
    rng = np.random.default_rng([seed, number, 2])
    rooms = [room.id for room in floor.rooms if room.id != floor.rooms.base.id]
    for make in CASTS[kind] * PASSES:
        for room in rng.permutation(rooms):
            cast = make(Stage(floor, int(room), rng))
            if cast is not None:
                patrol = _patrol(seed, number, kind, files=files, floor=floor, room=int(room), cast=cast)
                return _broken(patrol, rooms) if faults else patrol
    raise WorldError(files.name, f"has no room with a place for a patrol of the kind '{kind}'")


def _broken(patrol: Patrol, rooms: Sequence[int]) -> Patrol:
    """A patrol with its mishap, if it has one."""
    mishap = mishap_of(patrol.seed, patrol.number, patrol.room, rooms)
    if mishap is None:
        return patrol
    expect = {key: value for key, value in patrol.scenario["expect"].items() if key != "verdicts"}
    tree = {
        **patrol.scenario,
        "title": f"{patrol.title}; {mishap.text}",
        "faults": [mishap.fault],
        "expect": expect if mishap.allowed else patrol.scenario["expect"],
    }
    return replace(patrol, scenario=tree, mishap=mishap.text, allowed=mishap.allowed)


def _patrol(seed: int, number: int, kind: str, *, files: HouseFiles, floor: Floor, room: int, cast: Cast) -> Patrol:
    known = floor.rooms.find(room)
    assert known is not None
    expected = CONFIRMED if kind in INTRUDERS else CLEAR
    tree: dict[str, Any] = {
        "title": f"{cast.title} in the {known.name} ({files.name})",
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
    """Text of the scenario file."""
    expect = dict(patrol.scenario["expect"])
    if "verdicts" in expect:  # JSON has turned the room numbers into strings
        expect["verdicts"] = {int(room): verdict for room, verdict in expect["verdicts"].items()}
    return yaml.safe_dump({**patrol.scenario, "expect": expect}, sort_keys=False, allow_unicode=True, width=120)
