#!/usr/bin/env python3
"""The local planners: duration of a control cycle.

    PYTHONPATH=src .ws/venv/bin/python benchmarks/navigation_control.py [--json FILE] [--quick]

control_cycle_ms: `compute` of TrajectoryPlannerROS with the tutorial's parameters (20 x 20 samples over 1.7 s) on its
local costmap (3 x 3 m in cells of 0.01 m, inflated by 1.0 m), with the cut of the plan and all distance fields.
The situations are from a drive through the house: from the base through the door (0.90 m) to room 2, and to room 7,
every 0.5 m along the global plan, which has a pose every 0.01 m. The costmap has the view of a 720-beam lidar there. It
is pinned to one core; the figure is the median over the places of the median of each place's repeats. `worst` is the
slowest place. control_cycle_DWAPlannerROS_ms is the same for DWAPlannerROS with its defaults (0.55 m/s) and 20 x 20
samples.
"""

from __future__ import annotations

import in_workspace  # noqa: F401 - first: it finds the interpreter

# isort: split
import logging
import math
import statistics
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "src"))

from one_core import run  # noqa: E402

from rosbot_patrol.costmap.layered import LayeredCostmap  # noqa: E402
from rosbot_patrol.costmap.layers.obstacle import observe  # noqa: E402
from rosbot_patrol.costmap.params import read_costmap  # noqa: E402
from rosbot_patrol.errors import ControlError  # noqa: E402
from rosbot_patrol.geometry import Pose2D, Twist2D  # noqa: E402
from rosbot_patrol.grid import Grid  # noqa: E402
from rosbot_patrol.maps.map_io import read_map  # noqa: E402
from rosbot_patrol.planning.interfaces import LocalPlanner, LocalView  # noqa: E402
from rosbot_patrol.planning.registry import (  # noqa: E402
    LOCAL_PLANNERS,
    make_global_planner,
    make_local_planner,
    short_name,
)
from rosbot_patrol.scan import LaserScan  # noqa: E402

AIMS = {"control_cycle_ms": 4.0}
CONFIG = ROOT / "drop_in" / "tutorial_pkg" / "config"
OWN = ("TrajectoryPlannerROS",)  # the tutorial has parameters for it
DWA_VALUES = {"max_vel_y": 0.0, "min_vel_y": 0.0, "vx_samples": 20, "vth_samples": 20}
ROOMS = ((-3.489, 0.306), (14.75, 11.48))  # 2, behind the door, and 7, at the end of the house


@dataclass(frozen=True)
class Place:
    """One situation: the planner's inputs, the plan that it follows, and its local costmap."""

    view: LocalView
    plan: np.ndarray
    costmap: LayeredCostmap


def tutorial(name: str) -> dict[str, Any]:
    return yaml.safe_load((CONFIG / name).read_text(encoding="utf-8"))


def local_costmap() -> LayeredCostmap:
    """The tutorial's local costmap, over an obstacle layer that also clears along beams without a hit."""
    tree = {**tutorial("costmap_common_params.yaml"), **tutorial("local_costmap_params.yaml")["local_costmap"]}
    return LayeredCostmap(read_costmap(tree))


def global_plan(house: Grid, goal: tuple[float, float]) -> np.ndarray:
    """Make poses 0.01 m apart from the base to a place."""
    tree = {
        "plugins": [
            {"name": "static", "type": "costmap_2d::StaticLayer"},
            {"name": "inflation", "type": "costmap_2d::InflationLayer"},
        ],
        "footprint": [[0.12, 0.14], [0.12, -0.14], [-0.12, -0.14], [-0.12, 0.14]],
        "inflation": {"inflation_radius": 1.0, "cost_scaling_factor": 6.0},
    }
    costmap = LayeredCostmap(read_costmap(tree))
    costmap.static_layers[0].set_map(house)
    costmap.update(0.0, Pose2D())
    path = make_global_planner("navfn/NavfnROS", {}).plan(costmap.grid, Pose2D(), Pose2D(*goal, 0.0))
    along = np.append(0.0, np.cumsum(np.hypot(*np.diff(path[:, :2], axis=0).T)))
    at = np.arange(0.0, along[-1], 0.01)
    yaw = np.interp(at, along, np.unwrap(path[:, 2]))
    return np.column_stack((np.interp(at, along, path[:, 0]), np.interp(at, along, path[:, 1]), yaw))


def scan_at(house: Grid, pose: Pose2D) -> LaserScan:
    """Cast 720 beams over the map's occupied cells."""
    angles = -math.pi + np.arange(720) * math.tau / 720
    reach = np.arange(0.0, 6.0, 0.01)
    x = pose.x + np.outer(np.cos(angles + pose.yaw), reach)
    y = pose.y + np.outer(np.sin(angles + pose.yaw), reach)
    info = house.info
    ix = ((x - info.origin_x) / info.resolution).astype(int)
    iy = ((y - info.origin_y) / info.resolution).astype(int)
    hit = house.cells[iy, ix] == 100
    ranges = np.where(hit.any(axis=1), reach[hit.argmax(axis=1)], np.inf)
    return LaserScan(
        stamp=0.0,
        frame_id="laser",
        angle_min=-math.pi,
        angle_increment=math.tau / 720,
        range_min=0.1,
        range_max=12.0,
        ranges=ranges,
    )


def places(spacing: float = 0.5) -> Iterator[Place]:
    """The situations of the drives."""
    house = read_map(ROOT / "maps" / "rosbot_map.yaml")
    for goal in ROOMS:
        plan = global_plan(house, goal)
        for start in range(0, len(plan) - 50, round(spacing / 0.01)):
            x, y, yaw = plan[start]
            pose = Pose2D(float(x), float(y), float(yaw) + 0.1)
            costmap = local_costmap()
            costmap.update(0.0, pose)
            for layer in costmap.obstacle_layers:
                for buffer in layer.buffers.values():
                    buffer.add(observe(scan_at(house, pose), pose))
            costmap.update(0.1, pose)
            grid = Grid(costmap.info, costmap.cells)
            # the global plan is made once a second: it starts up to some decimetres behind the robot
            yield Place(
                view=LocalView(now=0.0, pose=pose, velocity=Twist2D(0.1, 0.0, 0.1), costmap=grid),
                plan=plan[max(0, start - 20) :],
                costmap=costmap,
            )


def make_planner(plugin: str, place: Place, **changes: Any) -> LocalPlanner:
    own = tutorial("trajectory_planner.yaml")["TrajectoryPlannerROS"] if short_name(plugin) in OWN else DWA_VALUES
    tree = {short_name(plugin): {**own, **changes}}
    return make_local_planner(plugin, tree, place.costmap, controller_frequency=25.0)


def cycle_times(plugin: str, repeats: int, **changes: Any) -> tuple[list[float], int]:
    """Milliseconds of `compute` at each place (median of the repeats), and the number of places without a path."""
    times, refused = [], 0
    for place in places():
        planner = make_planner(plugin, place, **changes)
        own = []
        for i in range(repeats + 2):
            planner.set_plan(place.plan)
            before = time.perf_counter()
            try:
                planner.compute(place.view)
            except ControlError:
                refused += i == 0
            own.append(1e3 * (time.perf_counter() - before))
        times.append(statistics.median(own[2:]))
    return times, refused


def figures(*, quick: bool = False) -> dict[str, float]:
    """This module's figures of FIGURES.md, printed as a table."""
    repeats = 5 if quick else 50
    logging.disable(logging.WARNING)
    found: dict[str, float] = {}
    print(f"{'figure':32s} {'ms':>8s} {'worst':>8s} {'aim':>6s} {'places':>7s} {'no way':>7s}")
    for plugin in LOCAL_PLANNERS:
        times, refused = cycle_times(plugin, repeats)
        name = "control_cycle_ms" if short_name(plugin) in OWN else f"control_cycle_{short_name(plugin)}_ms"
        found[name] = round(statistics.median(times), 3)
        found[name.replace("_ms", "_worst_ms")] = round(max(times), 3)
        aim = f"{AIMS[name]:6.1f}" if name in AIMS else ""
        print(f"{name:32s} {found[name]:8.3f} {max(times):8.3f} {aim:>6s} {len(times):7d} {refused:7d}")
    return found


def main() -> None:
    run(__doc__, lambda quick: figures(quick=quick))


if __name__ == "__main__":
    main()
