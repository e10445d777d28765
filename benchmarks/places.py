"""Random places of the robot in a simulated world, for the benchmarks."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from rosbot_patrol.campaign.houses.drawn import drawn_house_files
from rosbot_patrol.campaign.houses.files import HouseFiles, house_files
from rosbot_patrol.errors import WorldError
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.simulation.engine import Engine, EngineParams
from rosbot_patrol.simulation.plans.catalogue import load_catalogue
from rosbot_patrol.simulation.render.egl import make_renderer
from rosbot_patrol.simulation.robot.description import load_robot
from rosbot_patrol.simulation.sdf.world import World

ROOT = Path(__file__).resolve().parent.parent
LOOKS = ("intruder_test_balaclava", "intruder_test_violet", "intruder_test_orchid")


def world_files(name: str, folder: Path) -> HouseFiles:
    """Files of one of our houses, or of one drawn by chance (drawn_SEED), which is written into a folder."""
    if not name.startswith("drawn_"):
        return house_files(name, ROOT)
    return drawn_house_files(int(name.removeprefix("drawn_")), folder / name, load_catalogue(ROOT / "config"))


def make_engine(world: World, figures: str = "plain") -> Engine:
    """Make the world with the ROSbot at the origin, and plain or detailed people."""
    engine = Engine(world, EngineParams(seed=1, figures=figures), make_renderer=lambda: make_renderer("egl"))
    engine.spawn_robot(load_robot(ROOT / "urdf" / "rosbot.urdf"))
    return engine


def is_inside(engine: Engine, place: Pose2D) -> bool:
    """Whether a robot can stand and turn there, with walls around it."""
    try:
        engine.carry(place)
    except WorldError:
        return False
    ranges = engine.scan().ranges
    return bool(ranges.min() > 0.35 and np.isfinite(ranges).mean() > 0.9)


def draw_places(engine: Engine, rng: np.random.Generator, count: int) -> Iterator[Pose2D]:
    """Draw random places."""
    segments = engine.ways.cut(engine.robot.lidar_height).segments.reshape(-1, 2)
    low, high = segments.min(axis=0), segments.max(axis=0)
    while count:
        x, y = rng.uniform(low, high)
        place = Pose2D(float(x), float(y), float(rng.uniform(-math.pi, math.pi)))
        if is_inside(engine, place):
            count -= 1
            yield place
