"""Scenario file: one yaml with world, seed, actors, doors, moved furniture, timed faults, and the expected outcome.

    scenario = read_scenario("scenarios/intruder.yaml")

Times are simulated seconds after an event of the patrol: `start` of the simulation, `on_guard` (unless the file's
`begin` says otherwise), `driving`, `looking`, `returning`, `home`; the first occurrence of each counts.
`simulation/player.py` plays it.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from rosbot_patrol import params
from rosbot_patrol.counts import count_of
from rosbot_patrol.errors import ParamError, WorldError
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.params import param
from rosbot_patrol.simulation.actors.doors import SPEED, SWING, DoorPlace, plain_door
from rosbot_patrol.simulation.actors.walkers import Walker
from rosbot_patrol.simulation.render.lights import LIGHTS
from rosbot_patrol.simulation.scenario.faults import EVENTS, Doorway, Fault, Timed, finite, read_fault
from rosbot_patrol.simulation.scenario.furniture import MovedFurniture
from rosbot_patrol.yaml_files import read_mapping

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

T = TypeVar("T", bound="DataclassInstance")

PLAYED = "Everything in the scenario has happened."  # the simulator's last message about it
VERDICTS = ("confirmed", "clear", "unreachable", "unverified")


def _points(points: Sequence[Sequence[float]]) -> str | None:
    bad = next((p for p in points if len(p) not in (2, 3)), None)
    return None if bad is None else f"expected points [x, y] or [x, y, yaw], got {list(bad)}"


def _point(point: Sequence[float]) -> str | None:
    return _points([point])


def pose_of(point: Sequence[float]) -> Pose2D:
    """Convert [x, y] or [x, y, yaw] to a pose."""
    return Pose2D(point[0], point[1], point[2] if len(point) == 3 else 0.0)


@dataclass(frozen=True, kw_only=True)
class Way(Timed):
    """Path of an actor, from a start time."""

    path: list[list[float]] = param([], check=_points, doc="points [x, y] or [x, y, yaw] in the map frame")
    speed: float = param(0.8, unit="m/s", lo=0.05, hi=8.0, doc="walking speed")
    loop: bool = param(False, doc="repeat the path for ever")
    pause: float = param(0.0, unit="s", lo=0.0, check=finite, doc="stop at each point")
    yields: bool = param(True, doc="stop in front of the robot; false: walk on, over the robot if need be")
    roam: float = param(0.0, unit="m", lo=0.0, hi=50.0, doc="radius of random walking, instead of a path")


@dataclass(frozen=True, kw_only=True)
class ActorEntry(Way):
    """A person, animal or object that appears, walks, and may leave again."""

    name: str = param(doc="unique name")
    model: str = param("person", doc="person, fire_hydrant, cat, dog or poster")
    look: str = param("", doc="name of an appearance; empty: drawn from the seed")
    posture: str = param("", doc="posture of a person: standing, sitting, crouching, creeping")
    start: list[float] = param(check=_point, doc="place of appearance, [x, y] or [x, y, yaw]")
    stays: float = param(0.0, unit="s", lo=0.0, check=finite, doc="time until it disappears; 0: never")


@dataclass(frozen=True, kw_only=True)
class WalkEntry(Way):
    """A further walk of an actor."""

    actor: str = param(doc="name of the actor")


@dataclass(frozen=True, kw_only=True)
class DoorEntry:
    """A door that exists from the beginning."""

    name: str = param(doc="unique name")
    hinge: list[float] = param(check=_point, doc="[x, y, yaw]: place of the hinge; the closed leaf lies along yaw")
    width: float = param(0.9, unit="m", lo=0.1, hi=5.0, doc="width of the leaf")
    swing: float = param(SWING, unit="rad", lo=-3.1, hi=3.1, doc="angle of the open door, counter-clockwise")
    opening: float = param(0.0, lo=0.0, hi=1.0, doc="opening at the start; 0: closed, 1: open")

    @property
    def place(self) -> DoorPlace:
        """The door in the engine's form."""
        return plain_door(self.name, pose_of(self.hinge), width=self.width, swing=self.swing)


@dataclass(frozen=True, kw_only=True)
class DoorMove(Timed):
    """A door opens or closes."""

    door: str = param(doc="name of the door")
    opening: float = param(lo=0.0, hi=1.0, doc="opening to move to; 0: closed, 1: open")
    speed: float = param(SPEED, unit="rad/s", lo=0.0, hi=10.0, doc="speed of the leaf; 0: at once")


@dataclass(frozen=True, kw_only=True)
class Trigger(Timed):
    """A trigger of a motion sensor, whatever it sees."""

    sensor: int = param(lo=0, hi=255, doc="id of the sensor")


@dataclass(frozen=True, kw_only=True)
class Expect:
    """Expected outcome of the scenario."""

    verdicts: dict[Any, Any] = param({}, doc="verdict of the last mission to each room: {room: verdict}")
    missions: int | None = param(
        None, lo=0, hi=1000, doc="number of missions; without it one for each room of `verdicts`"
    )
    mails: int | None = param(None, lo=0, hi=1000, doc="number of mails")
    home: bool = param(True, doc="whether the robot is home at the end")
    within: float = param(
        600.0, unit="s", lo=1.0, check=finite, doc="simulated time allowed, counted from the first time on guard"
    )

    @property
    def least_missions(self) -> int:
        """Number of missions to wait for."""
        return max(len(self.verdicts), 1) if self.missions is None else self.missions


@dataclass(frozen=True, kw_only=True)
class Start:
    """Pose of the robot at the beginning, in the map frame."""

    x: float = param(0.0, unit="m", check=finite, doc="position")
    y: float = param(0.0, unit="m", check=finite, doc="position")
    yaw: float = param(0.0, unit="rad", check=finite, doc="heading")


@dataclass(frozen=True, kw_only=True)
class Setting:
    """World and settings; an empty name keeps the launch file's. Paths are relative to the scenario file."""

    title: str = param("", doc="subject of the scenario, in one line")
    world: str = param("", doc="SDF file of the world")
    motion_sensors: str = param("", doc="file of the motion sensors")
    map: str = param("", doc="yaml file of the map")
    room_points: str = param("", doc="points file of the rooms")
    light: str = param("", choices=("", *LIGHTS), doc="light of the scene: day, noon, evening, lamps or torch")
    seed: int | None = param(None, lo=0, doc="seed of all noise")
    begin: str = param("on_guard", choices=EVENTS, doc="event from which times count if an entry has no `after`")


@dataclass(frozen=True, kw_only=True)
class Scenario:
    """Checked contents of a file; `after` of every entry is filled in."""

    file: str
    setting: Setting
    robot: Start | None = None
    actors: tuple[ActorEntry, ...] = ()
    walks: tuple[WalkEntry, ...] = ()
    doors: tuple[DoorEntry, ...] = ()
    door_moves: tuple[DoorMove, ...] = ()
    furniture: tuple[MovedFurniture, ...] = ()
    doorways: dict[str, Doorway] = field(default_factory=dict)
    faults: tuple[Fault, ...] = ()
    triggers: tuple[Trigger, ...] = ()
    expect: Expect | None = None

    @property
    def launch_arguments(self) -> dict[str, str]:
        """Arguments of rosbot_patrol.launch that the file sets."""
        s = self.setting
        named = {
            "world": s.world,
            "motion_sensors": s.motion_sensors,
            "map_file": s.map,
            "path_to_params": s.room_points,
            "seed": "" if s.seed is None else str(s.seed),
        }
        return {key: value for key, value in named.items() if value}


_LISTS: dict[str, type] = {
    "actors": ActorEntry,
    "walks": WalkEntry,
    "doors": DoorEntry,
    "door_moves": DoorMove,
    "furniture": MovedFurniture,
    "triggers": Trigger,
}


def read_scenario(path: str | Path) -> Scenario:
    """Read and check a file.

    Raises:
        ParamError: it cannot be read, a key is unknown or a value is wrong; the text names file and key.
    """
    path = Path(path)
    setting_keys = [key for key, *_ in params.declared(Setting)]
    keys = [*setting_keys, "robot", *_LISTS, "doorways", "faults", "expect"]
    tree = read_mapping(path, keys=", ".join(keys))
    for key in tree:
        if key not in keys:
            raise ParamError(f"{path}: {key}", params.unknown_name(str(key), keys))
    setting = params.load(Setting, {k: v for k, v in tree.items() if k in setting_keys}, name=f"{path}: ")
    scenario = Scenario(
        file=str(path),
        setting=_located(setting, path),
        robot=params.load_strict(Start, tree["robot"], name=f"{path}: robot/") if "robot" in tree else None,
        doorways=_doorways(tree.get("doorways", {}), path),
        faults=tuple(read_fault(t, source=name) for name, t in _listed(tree, "faults", path)),
        expect=_expect(tree["expect"], path) if "expect" in tree else None,
        **{key: tuple(_load(cls, t, name) for name, t in _listed(tree, key, path)) for key, cls in _LISTS.items()},
    )
    _check_names(scenario)
    return _timed(scenario)


def _listed(tree: Mapping[str, Any], key: str, path: Path) -> list[tuple[str, Any]]:
    """The entries of a list, each with its name for messages."""
    entries = tree.get(key, [])
    if not isinstance(entries, list):
        raise ParamError(f"{path}: {key}", f"expected a list, got {entries!r}")
    return [(f"{path}: {key}[{i}]/", entry) for i, entry in enumerate(entries)]


def _load(cls: type[T], tree: Any, name: str) -> T:
    entry = params.load_strict(cls, tree, name=name)
    try:
        if isinstance(entry, ActorEntry):
            rng = np.random.default_rng(0)
            Walker(entry.name, entry.model, entry.look, pose_of(entry.start), rng, posture=entry.posture)
        if isinstance(entry, DoorEntry):
            assert entry.place
    except WorldError as err:
        raise ParamError(name.rstrip("/"), str(err)) from err
    if isinstance(entry, Way) and entry.roam and entry.path:
        raise ParamError(f"{name}roam", "stands beside a path: an actor walks or wanders")
    if isinstance(entry, WalkEntry) and not entry.roam and not entry.path:
        raise ParamError(f"{name}path", "is missing, and so is roam")
    return entry


def _located(setting: Setting, path: Path) -> Setting:
    changes: dict[str, Any] = {}
    for key in ("world", "motion_sensors", "map", "room_points"):
        named = getattr(setting, key)
        if named:
            file = path.parent / Path(named).expanduser()
            if not file.is_file():
                raise ParamError(f"{path}: {key}", f"'{named}' is no file (looked for {file})")
            changes[key] = str(file.resolve())
    return dataclasses.replace(setting, **changes)


def _doorways(tree: Any, path: Path) -> dict[str, Doorway]:
    if not isinstance(tree, Mapping):
        raise ParamError(f"{path}: doorways", f"expected a place for each name, got {tree!r}")
    return {str(n): params.load_strict(Doorway, t, name=f"{path}: doorways/{n}/") for n, t in tree.items()}


def _expect(tree: Any, path: Path) -> Expect:
    expect = params.load_strict(Expect, tree, name=f"{path}: expect/")
    for room, verdict in expect.verdicts.items():
        name = f"{path}: expect/verdicts/{room}"
        if not isinstance(room, int) or isinstance(room, bool) or not 0 <= room <= 255:
            raise ParamError(name, "is no room, expected its number")
        if verdict not in VERDICTS:
            raise ParamError(name, f"is {verdict!r}, expected one of {', '.join(VERDICTS)}")
    return expect


def _check_names(scenario: Scenario) -> None:
    for key, entries in (("actors", scenario.actors), ("doors", scenario.doors)):
        names = [entry.name for entry in entries]
        for i, name in enumerate(names):
            if not name or name in names[:i]:
                problem = "is used twice" if name else "is empty"
                raise ParamError(f"{scenario.file}: {key}[{i}]/name", f"'{name}' {problem}")


def _timed(scenario: Scenario) -> Scenario:
    """The scenario with the reference event of each entry filled in."""
    begin = scenario.setting.begin

    def fill(entries: tuple[Any, ...]) -> tuple[Any, ...]:
        return tuple(dataclasses.replace(entry, after=entry.after or begin) for entry in entries)

    keys = ("actors", "walks", "door_moves", "faults", "triggers")
    filled: dict[str, Any] = {key: fill(getattr(scenario, key)) for key in keys}
    return dataclasses.replace(scenario, **filled)


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """Outcome: verdict of the last mission to each room, missions that ended, mails, whether the robot is home."""

    verdicts: dict[int, str]
    missions: int
    mails: int
    is_home: bool


def disappointments(expect: Expect, outcome: Outcome) -> list[str]:
    """One sentence for each failed expectation."""
    found = []
    for room, verdict in expect.verdicts.items():
        ended_as = outcome.verdicts.get(room)
        if ended_as != verdict:
            was = f"it was {ended_as}" if ended_as else "no mission to it has ended"
            found.append(f"The verdict for room {room} should have been {verdict}; {was}.")
    if expect.missions is not None and outcome.missions != expect.missions:
        found.append(f"{count_of(expect.missions, 'mission')} should have ended; there were {outcome.missions}.")
    if expect.mails is not None and outcome.mails != expect.mails:
        found.append(f"{count_of(expect.mails, 'mail')} should have been written; there were {outcome.mails}.")
    if expect.home and not outcome.is_home:
        found.append("The robot should have been home.")
    return found
