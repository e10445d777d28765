"""The houses of a campaign: our own, drawn ones, or a strange world, which the robot explores first."""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from rosbot_patrol.campaign.floor import Floor
from rosbot_patrol.campaign.houses.drawn import drawn_house_files
from rosbot_patrol.campaign.houses.files import House, HouseFiles, house_files, load_house, read_house_folder
from rosbot_patrol.campaign.houses.strange import check_start, find_start, house_of_world, moved_map
from rosbot_patrol.campaign.houses.varied import vary
from rosbot_patrol.campaign.plan import house_of
from rosbot_patrol.campaign.record import Settings
from rosbot_patrol.errors import ParamError, WorldError
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.maps.map_io import read_map, write_map
from rosbot_patrol.ros.campaign.house import House as LaunchedHouse
from rosbot_patrol.ros.campaign.house import HouseError, Master
from rosbot_patrol.ros.campaign.runner import Job, Runner
from rosbot_patrol.ros.models.packages import read_world
from rosbot_patrol.simulation.plans.catalogue import load_catalogue
from rosbot_patrol.simulation.plans.drawn_house import SEEDS

FOLDER = "houses"  # in the campaign's folder
EXPLORED = "explored"  # map of a strange world, in the frame of its start
PER_CAMPAIGN = 1000  # seeds of drawn houses

_KEPT = 4  # floors in memory


@dataclass(frozen=True)
class Place:
    """Where a patrol takes place: the house and its floor."""

    house: House
    floor: Floor


class Houses:
    """The houses, in turns.

    Args:
        settings: of the campaign.
        root: folder of the package.
        folder: of the campaign.
    """

    def __init__(self, settings: Settings, root: Path, folder: Path) -> None:
        self._settings, self._root, self._folder = settings, root, folder
        self._places: dict[str, Place] = {}
        if settings.generated > PER_CAMPAIGN or not 0 <= settings.seed < SEEDS["campaign"][1] // PER_CAMPAIGN:
            most = SEEDS["campaign"][1] // PER_CAMPAIGN - 1
            raise ParamError("--generated", f"draws up to {PER_CAMPAIGN} houses, with a --seed from 0 to {most}")
        self._catalogue = load_catalogue(root / "config") if settings.generated else None

    def of(self, number: int) -> Place:
        """The house of a patrol; a strange one with some furniture moved, and doors. Raises PatrolError."""
        name = self.name_of(number)
        if name not in self._places:
            house = load_house(self._files(name), read_world)
            while len(self._places) >= _KEPT:
                del self._places[next(iter(self._places))]
            self._places[name] = Place(house, Floor(house.bodies, house.rooms))
        place = self._places[name]
        if not self._settings.world:
            return place
        rng = np.random.default_rng([self._settings.seed, number, 10])
        return Place(*vary(place.house, place.floor, rng))

    def name_of(self, number: int) -> str:
        """Name of a patrol's house."""
        settings = self._settings
        if settings.generated:
            return f"drawn_{settings.seed * PER_CAMPAIGN + number % settings.generated}"
        return Path(settings.world).stem if settings.world else house_of(settings.seed, number, settings.houses)

    def _files(self, name: str) -> HouseFiles:
        if self._catalogue is not None:
            seed = int(name.removeprefix("drawn_"))
            return drawn_house_files(seed, self._folder / FOLDER / name, self._catalogue)
        if not self._settings.world:
            return house_files(name, self._root)
        found = read_house_folder(self._folder / FOLDER / name)
        if found is None:
            raise WorldError(self._settings.world, "has not been explored yet")
        return found


def prepare_world(
    world: Path, folder: Path, *, start: Pose2D | None, map_file: Path | None, timeout: float, prefix: Sequence[str]
) -> HouseFiles:
    """Make a house of a strange world, once: find a start, explore it or take a map, part it into rooms.

    Args:
        world: SDF file.
        folder: of the campaign.
        start: of the robot; None: the origin, or the nearest roomy place.
        map_file: yaml of its map, in its frame; None: the robot explores.
        timeout: for the exploration [s] of real time.
        prefix: command that isolates the exploration, empty for none.

    Raises:
        PatrolError: the world cannot be used, or the exploration failed.
    """
    house_folder = folder / FOLDER / world.stem
    found = read_house_folder(house_folder)
    if found is not None:
        return found
    house_folder.mkdir(parents=True, exist_ok=True)
    if start is not None:
        check_start(read_world(world), world, start)
    place = start or find_start(read_world(world), world)
    if place != Pose2D():
        print(f"the robot starts at ({place.x:.2f}, {place.y:.2f})", flush=True)
    if map_file is None:
        stem = house_folder / EXPLORED
        if not stem.with_suffix(".yaml").exists():
            _explore_apart(world, house_folder, place, timeout, prefix)
        write_map(str(house_folder / "world_map"), moved_map(read_map(str(stem.with_suffix(".yaml"))), place))
        map_file = house_folder / "world_map.yaml"
    files = house_of_world(world, house_folder, place, map_file=map_file, read=read_world)
    print(f"{world.name}: {len(load_house(files, read_world).rooms) - 1} rooms", flush=True)
    return files


def _explore_apart(world: Path, folder: Path, start: Pose2D, timeout: float, prefix: Sequence[str]) -> None:
    """Explore in a process of its own, because ROS joins one master in a process."""
    print(f"exploring {world.name} ...", flush=True)
    where = [f"{value:.3f}" for value in start]
    command = [sys.executable, sys.argv[0], str(folder), "--explore", "--world", str(world), "--start", *where]
    command += ["--timeout", f"{timeout:g}", *(["--space"] if prefix else [])]
    problems: list[str] = []
    began = time.monotonic()
    job = Job("exploration", command, folder / "explore.log", timeout)
    Runner(1, prefix, (), lambda _, problem: problems.append(problem)).run([job])
    if problems[0] or not (folder / f"{EXPLORED}.yaml").exists():
        raise WorldError(world, f"the exploration failed: {problems[0] or 'no map'}; --map FILE takes a map instead")
    print(f"explored in {time.monotonic() - began:.0f} s", flush=True)


def explore(world: Path, folder: Path, start: Pose2D, timeout: float) -> None:
    """Explore a world in this process. Raises HouseError."""
    master = Master(folder / "roscore.log")
    stem = folder / EXPLORED
    given: dict[str, Any] = {
        "world": world,
        "headless": "true",
        "rate": 0,
        "x": start.x,
        "y": start.y,
        "yaw": start.yaw,
        "explore": "true",
        "save_map": stem,
    }
    house = LaunchedHouse(folder, "rosbot_patrol", "simulation_gmapping.launch", plain=True, **given)
    try:
        house.start()
        house.wait(lambda: stem.with_suffix(".yaml").exists(), timeout, f"the map of {world}")
        touched = sorted({other for kind, other in house.contacts if kind != "floor"})
        if touched:
            print(f"the robot touched {', '.join(touched)}")
    except HouseError as err:
        raise WorldError(world, str(err)) from err
    finally:
        house.stop()
        master.stop()
