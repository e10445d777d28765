"""A drawn house as files: its world as it is, the map from before furniture was moved, rooms, sensors, doors."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from rosbot_patrol.campaign.floor import Floor
from rosbot_patrol.campaign.houses.files import HouseFiles, load_house, read_house_folder, write_house_folder
from rosbot_patrol.campaign.houses.hung_sensors import hang_sensors
from rosbot_patrol.errors import MapError
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.grid import GridInfo
from rosbot_patrol.maps.map_io import write_map
from rosbot_patrol.patrol.house.floor import floor_of
from rosbot_patrol.patrol.house.parting import point_of, reached_from
from rosbot_patrol.patrol.house.rooms import Room, save_rooms
from rosbot_patrol.simulation.plans.catalogue import Catalogue
from rosbot_patrol.simulation.plans.drawn_house import DrawnHouse, draw_house
from rosbot_patrol.simulation.plans.layout import Opening
from rosbot_patrol.simulation.plans.world_file import write_world
from rosbot_patrol.simulation.scene.floor_plan import floor_plan
from rosbot_patrol.simulation.sdf.world import load_world

LIDAR_HEIGHT = 0.158  # of the ROSbot [m]
RESOLUTION = 0.05  # of the map [m]

_ATTEMPTS = 5  # of houses for a seed
_DOORS = 0.35  # share of the doorways with a door, which stands open
_LEAF_MOST = 1.2  # wider openings have no door [m]
_DETOUR = 1.2  # longest way with a door, as a share of the one without it
_HOME = 0.5  # from the robot's place to a leaf [m]


def drawn_house_files(seed: int, folder: Path, catalogue: Catalogue) -> HouseFiles:
    """Draw a house and write its files, if they are not there yet.

    Raises:
        MapError: a room has no place for the robot.
        OSError: a file cannot be written.
    """
    found = read_house_folder(folder)
    if found is not None:
        return found
    folder.mkdir(parents=True, exist_ok=True)
    for attempt in range(_ATTEMPTS):
        try:
            return _write(draw_house(seed, catalogue, attempt), folder)
        except MapError as err:
            problem = err
    raise problem


def _write(house: DrawnHouse, folder: Path) -> HouseFiles:
    """Write a house's files. Raises MapError if the robot cannot get into every room."""
    head = f"Drawn by chance with the seed {house.seed}."
    write_world(house.plan, folder / "before.world", head=f"{head} As it was when the map was made.")
    write_world(house.plan_now, folder / "house.world", head=head)
    _map_and_rooms(house, folder)
    openings = enumerate(house.layout.openings)
    doors = [_open_door(house, opening, i) for i, opening in openings if _has_door(opening, i, house.seed)]
    files, floor = _with_doors(house.plan["name"], folder, [door for door in doors if not _is_at_home(door)])
    write_house_folder(files, folder, hang_sensors(floor))
    return files


def _with_doors(name: str, folder: Path, doors: list[dict[str, Any]]) -> tuple[HouseFiles, Floor]:
    """The house with its doors, but for those that would bar the robot's way."""
    kept: list[dict[str, Any]] = []
    files, floor = _house(name, folder, kept)
    ways = {room.id: len(floor.drive_to(room.id)) for room in floor.rooms}
    if not all(ways.values()):
        raise MapError(str(folder), "the robot cannot get into every room")
    for door in doors:
        more, other = _house(name, folder, [*kept, door])
        if all(0 < len(other.drive_to(room)) <= _DETOUR * way for room, way in ways.items()):
            kept, files, floor = [*kept, door], more, other
    return files, floor


def _house(name: str, folder: Path, doors: list[dict[str, Any]]) -> tuple[HouseFiles, Floor]:
    world, grid, rooms, sensors = (folder / f for f in ("house.world", "map.yaml", "rooms.yaml", "sensors.yaml"))
    files = HouseFiles(name, world, grid, rooms, sensors, {"doors": doors} if doors else {})
    house = load_house(files)
    return files, Floor(house.bodies, house.rooms)


def _map_and_rooms(house: DrawnHouse, folder: Path) -> None:
    bounds = house.layout.bounds.grown(0.5)
    info = GridInfo(
        resolution=RESOLUTION,
        width=math.ceil((bounds.x1 - bounds.x0) / RESOLUTION),
        height=math.ceil((bounds.y1 - bounds.y0) / RESOLUTION),
        origin_x=bounds.x0,
        origin_y=bounds.y0,
    )
    bodies = load_world(folder / "before.world").bodies
    grid = floor_plan(bodies, info, height=LIDAR_HEIGHT, start=(0.0, 0.0))
    write_map(str(folder / "map"), grid)
    floor = floor_of(grid)
    reached = reached_from(floor, Pose2D())
    rooms = [Room(id=0, name=f"base in the {house.names[0]}", pose=Pose2D())]
    x, y = floor.centres(*np.meshgrid(np.arange(floor.info.width), np.arange(floor.info.height)))
    for name, rect in house.rooms[1:]:
        mask = reached & (x > rect.x0) & (x < rect.x1) & (y > rect.y0) & (y < rect.y1)
        if not mask.any():
            raise MapError(str(folder), f"the {name} has no place for the robot")
        px, py = point_of(floor, mask)
        rooms.append(Room(id=len(rooms), name=name, pose=Pose2D(px, py, 0.0)))
    save_rooms(folder / "rooms.yaml", rooms)


def _has_door(opening: Opening, number: int, seed: int) -> bool:
    return opening.width <= _LEAF_MOST and float(np.random.default_rng([seed, number, 6]).random()) < _DOORS


def _is_at_home(door: dict[str, Any]) -> bool:
    """Whether the leaf is near the robot's place."""
    x, y, _ = door["hinge"]
    return math.hypot(x, y) < float(door["width"]) + _HOME


def _open_door(house: DrawnHouse, opening: Opening, number: int) -> dict[str, Any]:
    """A door as a scenario's entry: hinged at either jamb, open into the larger room."""
    rng = np.random.default_rng([house.seed, number, 7])
    rooms = house.layout.rooms
    into = max((rooms[k] for k in opening.rooms), key=lambda room: room.area if room is not rooms[0] else 0.0)
    end = 1.0 if rng.random() < 0.5 else -1.0
    along = opening.middle + end * opening.width / 2.0
    is_x = opening.axis == "x"
    x, y = (opening.at, along) if is_x else (along, opening.at)
    closed = -end * math.pi / 2.0 if is_x else math.pi / 2.0 * (1.0 + end)
    side = math.copysign(1.0, into.middle[0 if is_x else 1] - opening.at)
    swing = (side * end if is_x else -side * end) * float(rng.uniform(1.45, 1.7))
    return {
        "name": f"door_{number}",
        "hinge": [round(x, 3), round(y, 3), round(closed, 4)],
        "width": round(opening.width - 0.04, 3),
        "swing": round(swing, 3),
        "opening": 1.0,
    }
