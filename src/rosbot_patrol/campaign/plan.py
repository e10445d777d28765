"""Plan of each patrol in a campaign, drawn from a seed: house, room, people, expected outcome.

Patrol k of seed s is the same whatever else is run: everything in it uses the seed (s, k). Each block of ten patrols
has every kind of its mix, in its own order; the houses take turns.

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
from rosbot_patrol.campaign.houses.doorways import shuts
from rosbot_patrol.campaign.houses.files import HouseFiles
from rosbot_patrol.campaign.mishaps import STRANDED, mishap_of
from rosbot_patrol.errors import WorldError

KINDS = ("standing", "walking", "hidden", "late", "standing", "walking", "two", "pets", "poster", "empty")
HALF_EMPTY = ("standing", "walking", "hidden", "late", "two", "pets", "poster", "empty", "empty", "empty")
MIXES = {"usual": KINDS, "half_empty": HALF_EMPTY}
LIGHTS = ("day", "day", "noon", "evening", "lamps", "torch")  # how often each is drawn
INTRUDERS = frozenset({"standing", "walking", "hidden", "late", "two"})

CLEAR, CONFIRMED = "clear", "confirmed"
TRIGGER_AT = 2.0  # [s] after the first guard
SHUT = 0.15  # share of the patrols to a room with a door that find it shut
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


def kind_of(seed: int, number: int, mix: str = "usual") -> str:
    """Kind of a patrol; `mix` is one of MIXES."""
    kinds = MIXES[mix]
    block, place = divmod(number, len(kinds))
    return kinds[int(np.random.default_rng([seed, block, 1]).permutation(len(kinds))[place])]


def house_of(seed: int, number: int, houses: Sequence[str]) -> str:
    """House of a patrol: they take turns, starting with another one in each block."""
    return houses[(number + number // len(KINDS) + seed) % len(houses)]


def plan_patrol(
    seed: int,
    number: int,
    files: HouseFiles,
    floor: Floor,
    *,
    faults: int = 0,
    mix: str = "usual",
    is_light_drawn: bool = False,
) -> Patrol:
    """Plan a patrol.

    Args:
        seed: of the campaign.
        number: of the patrol.
        files: of the house that it is in.
        floor: of that house.
        faults: every how many patrols one has a fault, 0 for never; the people stay the same.
        mix: of the kinds of patrols, one of MIXES.
        is_light_drawn: whether the light is drawn, from noon to a torch.

    Raises:
        WorldError: no room of the house has a place that suits the kind, nor a plainer one.
    """
    kind = kind_of(seed, number, mix)
    rng = np.random.default_rng([seed, number, 2])
    rooms = [room.id for room in floor.rooms if room.id != floor.rooms.base.id]
    found = _cast(floor, kind, rooms, rng)
    if found is None:  # in a strange house there may be nowhere to hide, or no wall for a poster
        kind = "standing" if kind in INTRUDERS else "empty"
        found = _cast(floor, kind, rooms, rng)
    if found is None:
        raise WorldError(files.name, f"has no room with a place for a patrol of the kind '{kind}'")
    patrol = _patrol(seed, number, kind, files=files, floor=floor, room=found[0], cast=found[1])
    if is_light_drawn:
        light = str(np.random.default_rng([seed, number, 8]).choice(LIGHTS))
        patrol = replace(patrol, scenario={**patrol.scenario, "light": light})
    patrol = _broken(patrol, rooms, faults) if faults else patrol
    return patrol if patrol.mishap else _shut_out(patrol, floor)


def _cast(floor: Floor, kind: str, rooms: Sequence[int], rng: np.random.Generator) -> tuple[int, Cast] | None:
    """A room and its cast; None if no room has a place for it."""
    for make in CASTS[kind] * PASSES:
        for room in rng.permutation(rooms):
            cast = make(Stage(floor, int(room), rng))
            if cast is not None:
                return int(room), cast
    return None


def _broken(patrol: Patrol, rooms: Sequence[int], every: int) -> Patrol:
    """A patrol with its mishap, if it has one."""
    mishap = mishap_of(patrol.seed, patrol.number, patrol.room, rooms, every=every)
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


def _shut_out(patrol: Patrol, floor: Floor) -> Patrol:
    """A patrol before a shut door, if it has one: now and then, in a house with doors."""
    if np.random.default_rng([patrol.seed, patrol.number, 9]).random() >= SHUT:
        return patrol
    doors = patrol.scenario.get("doors", ())
    barring = next((door for door in doors if shuts(door, floor, patrol.room)), None)
    if barring is None:
        return patrol
    text = f"the door {barring['name']} is shut"
    tree = {
        **patrol.scenario,
        "title": f"{patrol.title}; {text}",
        "doors": [{**door, "opening": 0.0} if door is barring else door for door in doors],
        "expect": {key: value for key, value in patrol.scenario["expect"].items() if key != "verdicts"},
    }
    return replace(patrol, scenario=tree, mishap=text, allowed=STRANDED)


def _patrol(seed: int, number: int, kind: str, *, files: HouseFiles, floor: Floor, room: int, cast: Cast) -> Patrol:
    known = floor.rooms.find(room)
    assert known is not None
    expected = CONFIRMED if kind in INTRUDERS else CLEAR
    tree: dict[str, Any] = {
        "title": f"{cast.title} in the {known.name} ({files.name})",
        **files.entries(),
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
