"""A house of a campaign as files, and what stands in it."""

from __future__ import annotations

import json
import os.path
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import yaml

from rosbot_patrol.campaign.cast import Person
from rosbot_patrol.errors import ParamError
from rosbot_patrol.files import read_json, write_atomic, write_json
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.patrol.house.rooms import Rooms, load_rooms
from rosbot_patrol.simulation.actors.doors import Door, DoorPlace, plain_door
from rosbot_patrol.simulation.scenario.furniture import MovedFurniture, move_furniture
from rosbot_patrol.simulation.scene.scene import Body
from rosbot_patrol.simulation.sdf.world import World, load_world
from rosbot_patrol.simulation.sensors.motion_sensors import SensorPlace

HOUSES = ("house", "flat", "office")
INFO = "house.json"
_KEYS = {"world": "world", "map": "map", "rooms": "room_points", "sensors": "motion_sensors"}  # in a scenario

ReadWorld = Callable[[Path], World]


@dataclass(frozen=True)
class HouseFiles:
    """Files of a house: world, map, room points and motion sensors.

    Attributes:
        scenario: further keys of every scenario in it, such as the robot's start, doors or moved furniture.
    """

    name: str
    world: Path
    map: Path
    rooms: Path
    sensors: Path
    scenario: Mapping[str, Any] = field(default_factory=dict)

    def entries(self) -> dict[str, Any]:
        """Keys of a scenario in this house."""
        return {key: str(getattr(self, name)) for name, key in _KEYS.items()} | dict(self.scenario)


@dataclass(frozen=True)
class House:
    """A house without the people of a patrol; `people` live there, by the world's own file."""

    files: HouseFiles
    bodies: tuple[Body, ...]
    rooms: Rooms
    people: tuple[Person, ...] = ()


def house_files(name: str, root: Path) -> HouseFiles:
    """The files of one of our houses by name, under the package's folder.

    Raises:
        ParamError: no house has that name.
    """
    if name not in HOUSES:
        raise ParamError("houses", f"'{name}' is no house, expected of {', '.join(HOUSES)}")
    prefix = "" if name == "house" else f"{name}_"
    return HouseFiles(
        name=name,
        world=root / "worlds" / f"{name}.world",
        map=root / "maps" / f"{'rosbot' if name == 'house' else name}_map.yaml",
        rooms=root / "params" / f"{prefix}room_points.yaml",
        sensors=root / "config" / f"{name}_sensors.yaml",
    )


def scenario_files(name: str, scenario: Mapping[str, Any], folder: Path, root: Path) -> HouseFiles:
    """The files that a scenario names; those of our own houses are this machine's.

    Args:
        name: of the house.
        scenario: its contents.
        folder: of the scenario's file, where relative paths start.
        root: folder of the package.
    """
    if name in HOUSES:
        return house_files(name, root)
    paths = {key: Path(os.path.normpath(folder / scenario[key])) for key in _KEYS.values()}
    rest = {key: scenario[key] for key in ("robot", "doors", "furniture") if key in scenario}
    return HouseFiles(name, paths["world"], paths["map"], paths["room_points"], paths["motion_sensors"], rest)


def moved_scenario(scenario: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """A scenario with its paths relative to the folder of its file."""
    return {**scenario, **{key: os.path.relpath(scenario[key], folder) for key in _KEYS.values()}}


def load_house(files: HouseFiles, read: ReadWorld = load_world) -> House:
    """Read a house; its doors and its furniture stand as they do when a patrol begins.

    Raises:
        PatrolError: a file of it cannot be used.
    """
    world = read(files.world)
    people = tuple(Person(name=actor.name) for actor in world.actors if actor.model == "person")
    leaves = [_leaf(place, 0.0) for place in world.doors]
    return House(files, _at_begin((*world.bodies, *leaves), files), load_rooms(files.rooms), people)


def changed_house(house: House, files: HouseFiles) -> House:
    """The house of the same world with other entries of its scenarios: doors that are new, and furniture moved."""
    return replace(house, files=files, bodies=_at_begin(house.bodies, files))


def _at_begin(bodies: tuple[Body, ...], files: HouseFiles) -> tuple[Body, ...]:
    """Bodies with a scenario's moved furniture and its doors."""
    moved = [MovedFurniture(**tree) for tree in files.scenario.get("furniture", ())]
    known = {body.name for body in bodies}
    doors = [tree for tree in files.scenario.get("doors", ()) if tree["name"] not in known]
    leaves = [_leaf(_door(tree), float(tree.get("opening", 0.0))) for tree in doors]
    return (*move_furniture(bodies, moved), *leaves)


def _door(tree: Mapping[str, Any]) -> DoorPlace:
    x, y, yaw = tree["hinge"]
    return plain_door(str(tree["name"]), Pose2D(x, y, yaw), width=float(tree["width"]), swing=float(tree["swing"]))


def _leaf(place: DoorPlace, opening: float) -> Body:
    """The leaf of a door as a thing that stands still."""
    door = Door(place)
    door.set(opening, 0.0)
    return replace(door.body, pose=door.matrix, static=True)


def read_house_folder(folder: Path) -> HouseFiles | None:
    """The house that `write_house_folder` has completed in a folder, None if it has not."""
    info = read_json(folder / INFO)
    if info is None:
        return None
    world = Path(info["world"]) if info["world"] else folder / "house.world"
    return HouseFiles(
        info["name"], world, folder / "map.yaml", folder / "rooms.yaml", folder / "sensors.yaml", info["scenario"]
    )


def write_house_folder(files: HouseFiles, folder: Path, sensors: Sequence[SensorPlace]) -> None:
    """Complete a folder that has the map and the rooms: write the motion sensors, and that it is complete."""
    rows = [
        {key: round(value, 2) for key, value in asdict(sensor).items()}  # ids and ports stay whole numbers
        for sensor in sensors
    ]
    write_atomic(folder / "sensors.yaml", yaml.safe_dump({"angle_unit": "rad", "sensors": rows}).encode())
    world = "" if files.world.parent == folder else str(files.world)
    write_json(folder / INFO, json.loads(json.dumps({"name": files.name, "world": world, "scenario": files.scenario})))
