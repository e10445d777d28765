"""Houses of a campaign: their files and their furniture."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from rosbot_patrol.errors import ParamError
from rosbot_patrol.patrol.house.rooms import Rooms, load_rooms
from rosbot_patrol.simulation.scene.scene import Body
from rosbot_patrol.simulation.sdf.world import load_world

HOUSES = ("house", "flat", "office")


@dataclass(frozen=True)
class HouseFiles:
    """Files of a house: world, map, room points and motion sensors."""

    name: str
    world: Path
    map: Path
    rooms: Path
    sensors: Path


@dataclass(frozen=True)
class House:
    """A house without people."""

    files: HouseFiles
    bodies: tuple[Body, ...]
    rooms: Rooms


def house_files(name: str, root: Path) -> HouseFiles:
    """The files of a house by name, under the package's folder.

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


def load_house(name: str, root: Path) -> House:
    """Read a house.

    Raises:
        PatrolError: no house has that name, or a file of it cannot be used.
    """
    files = house_files(name, root)
    return House(files, load_world(files.world).bodies, load_rooms(files.rooms))
