"""A strange world as a house: where the robot starts, its rooms, its motion sensors."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.campaign.floor import ROBOT_HEIGHTS, ROBOT_RADIUS, Floor, floor_info, shrunk
from rosbot_patrol.campaign.houses.files import HouseFiles, ReadWorld, load_house, write_house_folder
from rosbot_patrol.campaign.houses.hung_sensors import hang_sensors
from rosbot_patrol.errors import MapError, WorldError
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.grid import Grid, GridInfo
from rosbot_patrol.maps.map_io import read_map, write_map
from rosbot_patrol.maps.raster import flood
from rosbot_patrol.patrol.house.floor import floor_of
from rosbot_patrol.patrol.house.parting import suggest_rooms
from rosbot_patrol.patrol.house.rooms import save_rooms
from rosbot_patrol.simulation.scene.floor_plan import filled_cells
from rosbot_patrol.simulation.sdf.world import World

LEAST_FLOOR = 6.0  # floor that the robot has to reach from its start [m^2]
ROOMY = 0.35  # free space around a start that was looked for [m]


def find_start(world: World, source: Path) -> Pose2D:
    """A place for the robot: the origin, or the nearest roomy place, from which it reaches some floor.

    Raises:
        WorldError: there is no such place, or the world has no walls.
    """
    info, blocked = _blocked(world, source)
    open_to_robot = shrunk(~blocked, ROBOT_RADIUS)
    x, y, cells = _roomy(info, blocked, Pose2D())
    done = np.zeros(info.shape, bool)
    for k, (ix, iy) in enumerate(cells):
        if done[iy, ix]:
            continue
        reached = flood(open_to_robot, ix, iy)
        done |= reached
        if reached.sum() * info.resolution**2 >= LEAST_FLOOR:
            is_origin = math.hypot(x[k], y[k]) < info.resolution
            return Pose2D() if is_origin else Pose2D(round(float(x[k]), 2), round(float(y[k]), 2), 0.0)
    raise WorldError(source, f"has no place from which the robot reaches {LEAST_FLOOR:g} m2 of floor")


def check_start(world: World, source: Path, start: Pose2D) -> None:
    """Refuse a start where the robot cannot stand.

    Raises:
        WorldError: it is in or too near to something, or outside the walls; the text names the nearest place.
    """
    info, blocked = _blocked(world, source)
    ix, iy = info.cell_of(start.x, start.y)
    if info.contains_cell(ix, iy) and shrunk(~blocked, ROBOT_RADIUS)[iy, ix]:
        return
    x, y, _ = _roomy(info, blocked, start)
    instead = f"; the nearest place for it is ({x[0]:.2f}, {y[0]:.2f})" if len(x) else ""
    raise WorldError(source, f"has no room for the robot at ({start.x:.2f}, {start.y:.2f}){instead}")


def _blocked(world: World, source: Path) -> tuple[GridInfo, NDArray[np.bool_]]:
    """Cells in which something stands at the robot's height, doors included."""
    bodies = (*world.bodies, *(replace(door.body, static=True) for door in world.doors))
    info = floor_info(bodies, source)
    return info, np.logical_or.reduce([filled_cells(bodies, info, height) for height in ROBOT_HEIGHTS])


def _roomy(
    info: GridInfo, blocked: NDArray[np.bool_], near: Pose2D
) -> tuple[NDArray[np.float64], NDArray[np.float64], list[tuple[int, int]]]:
    """Places with some room around them, the nearest to a pose first: x, y [m] and cells."""
    iy, ix = np.nonzero(shrunk(~blocked, ROOMY))
    x, y = info.origin_x + (ix + 0.5) * info.resolution, info.origin_y + (iy + 0.5) * info.resolution
    order = np.argsort(np.hypot(x - near.x, y - near.y))
    return x[order], y[order], list(zip(ix[order].tolist(), iy[order].tolist(), strict=True))


def house_of_world(world: Path, folder: Path, start: Pose2D, *, map_file: Path, read: ReadWorld) -> HouseFiles:
    """Make a house of a world and its map: part it into rooms, hang motion sensors, and write the files.

    Args:
        world: SDF file.
        folder: for the files.
        start: of the robot, in the world.
        map_file: yaml of the map, in the world's frame.
        read: reads the world.

    Raises:
        PatrolError: a file cannot be used, or the map has no rooms.
    """
    folder.mkdir(parents=True, exist_ok=True)
    grid = read_map(str(map_file))
    write_map(str(folder / "map"), grid)
    rooms = suggest_rooms(floor_of(grid), start)
    save_rooms(folder / "rooms.yaml", rooms)
    robot = {"x": start.x, "y": start.y, "yaw": start.yaw}
    files = HouseFiles(
        world.stem, world, folder / "map.yaml", folder / "rooms.yaml", folder / "sensors.yaml", {"robot": robot}
    )
    loaded = load_house(files, read)
    try:
        floor = Floor(loaded.bodies, loaded.rooms)
    except MapError as err:
        raise WorldError(world, f"its map does not fit it: {err}") from err
    write_house_folder(files, folder, hang_sensors(floor))
    return files


def moved_map(grid: Grid, start: Pose2D) -> Grid:
    """Move a map into the frame of the world. Its own frame begins at the start, where the robot began to map.

    Raises:
        MapError: the robot did not look along the world's x axis, so that the map would lie askew.
    """
    if abs(start.yaw) > 1e-3:
        raise MapError("the map", f"was begun at a heading of {start.yaw:.2f} rad, expected 0")
    info = grid.info
    return Grid(
        GridInfo(
            resolution=info.resolution,
            width=info.width,
            height=info.height,
            origin_x=info.origin_x + start.x,
            origin_y=info.origin_y + start.y,
            yaw=info.yaw,
        ),
        grid.cells,
    )
