#!/usr/bin/env python3
"""The costmap on the tutorial's 3500 x 3500 cells: a full inflation, and an update after 0.1 m of motion.

    PYTHONPATH=src .ws/venv/bin/python benchmarks/navigation_costmap.py [--json FILE] [--quick]

Content: the tutorial's rolling global costmap (drop_in/tutorial_pkg, 35 x 35 m at 0.01 m, inflation 2.5 m = 250 cells)
after a patrol through all rooms of worlds/house.world with the simulator's lidar (720 beams, 1 cm of noise). Walls are
ragged lines of marks, as in the robot's costmap, and each new scan moves some of them by a cell. With the tutorial's
`cost_scaling_factor` (upstream's 10) costs end after 0.69 m, so that 250 cells take no longer than 69. Therefore the
figures are measured at a factor of 1, where all 250 cells have a cost, and `..._tutorial_ms` at 10. An update after
0.1 m is all of `LayeredCostmap.update`: shift, clearing, marking, inflation; each has its own scan.
"""

from __future__ import annotations

import in_workspace  # noqa: F401 - first: it finds the interpreter

# isort: split
import itertools
import math
import statistics
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import yaml

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "src"))

from one_core import run  # noqa: E402

from rosbot_patrol.costmap.bounds import Bounds  # noqa: E402
from rosbot_patrol.costmap.layered import LayeredCostmap  # noqa: E402
from rosbot_patrol.costmap.layers.inflation import InflationLayer  # noqa: E402
from rosbot_patrol.costmap.layers.obstacle import observe  # noqa: E402
from rosbot_patrol.costmap.params import read_costmap  # noqa: E402
from rosbot_patrol.geometry import Pose2D  # noqa: E402
from rosbot_patrol.maps.map_io import read_map  # noqa: E402
from rosbot_patrol.planning.registry import make_global_planner  # noqa: E402
from rosbot_patrol.simulation.scene.slices import slice_bodies  # noqa: E402
from rosbot_patrol.simulation.sdf.world import load_world  # noqa: E402
from rosbot_patrol.simulation.sensors.lidar import LidarParams, measure_scan  # noqa: E402

AIMS = {"inflation_full_ms": 60.0, "inflation_shift_ms": 20.0}
ROUND = (0, 1, 2, 3, 4, 5, 6, 7, 0)  # rooms in the order of the patrol
LIDAR_HEIGHT = 0.15
STEP = 0.1


def tutorial_costmap(factor: float) -> LayeredCostmap:
    """The tutorial's global costmap in the simulation."""
    common = ROOT / "drop_in" / "tutorial_pkg" / "config" / "costmap_common_params.yaml"
    tree: dict[str, Any] = yaml.safe_load(common.read_text(encoding="utf-8"))
    own = yaml.safe_load((ROOT / "config" / "global_costmap_params.yaml").read_text(encoding="utf-8"))
    return LayeredCostmap(read_costmap({**tree, **own["global_costmap"], "cost_scaling_factor": factor}))


def patrol_poses() -> list[Pose2D]:
    """Poses every 0.1 m of a path through all rooms and home."""
    tree = {
        "plugins": [{"name": "s", "type": "StaticLayer"}, {"name": "i", "type": "InflationLayer"}],
        "s": {},
        "i": {"inflation_radius": 0.6},
        "robot_radius": 0.2,
    }
    costmap = LayeredCostmap(read_costmap(tree))
    costmap.static_layers[0].set_map(read_map(ROOT / "maps" / "rosbot_map.yaml"))
    costmap.update(0.0, Pose2D())
    rooms = yaml.safe_load((ROOT / "params" / "room_points.yaml").read_text(encoding="utf-8"))["rooms"]
    stops = [Pose2D(float(rooms[f"room{k}"]["x"]), float(rooms[f"room{k}"]["y"])) for k in ROUND]
    planner = make_global_planner("navfn/NavfnROS", {})
    ways = [np.asarray(planner.plan(costmap.grid, a, b)) for a, b in itertools.pairwise(stops)]
    points = np.concatenate(ways)[:, :2]
    along = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))))
    at = np.arange(0.0, along[-1], STEP)
    x, y = np.interp(at, along, points[:, 0]), np.interp(at, along, points[:, 1])
    yaw = np.arctan2(np.gradient(y), np.gradient(x))
    return [Pose2D(*pose) for pose in np.column_stack((x, y, yaw)).tolist()]


def drive(costmap: LayeredCostmap, poses: list[Pose2D]) -> list[float]:
    """Milliseconds of each update along the poses, with a new scan at each."""
    scene = slice_bodies(load_world(ROOT / "worlds" / "house.world").bodies, LIDAR_HEIGHT)
    lidar, rng, times = LidarParams(), np.random.default_rng(1), []
    buffer = costmap.obstacle_layers[0].buffers["laser_scan_sensor"]
    for i, pose in enumerate(poses):
        now = 0.5 * i
        buffer.add(observe(measure_scan(lidar, scene, pose, now, rng), pose))
        before = time.perf_counter()
        costmap.update(now, pose)
        times.append(1e3 * (time.perf_counter() - before))
    return times[1:]


def full_times(costmap: LayeredCostmap, repeats: int) -> list[float]:
    """Milliseconds of the inflation alone over the whole costmap."""
    layer = next(layer for layer in costmap.layers if isinstance(layer, InflationLayer))
    marks = np.where(costmap.cells == 254, np.uint8(254), np.uint8(0))
    cells, times = np.empty_like(marks), []
    for _ in range(repeats + 1):
        cells[:] = marks
        before = time.perf_counter()
        layer.update_costs(cells, Bounds(0, 0, costmap.info.width, costmap.info.height))
        times.append(1e3 * (time.perf_counter() - before))
    assert np.array_equal(cells, costmap.cells)  # equal to the result of the partial updates
    return times[1:]


def figures(*, repeats: int = 20, every: int = 1) -> dict[str, float]:
    """Medians by the names of FIGURES.md; prints a row for each."""
    print(f"{'figure':28s} {'ms':>8s} {'least':>8s} {'99 %':>8s} {'aim':>6s}")
    poses = patrol_poses()[::every] if every > 1 else patrol_poses()
    found: dict[str, float] = {}
    for factor, ending in ((1.0, ""), (10.0, "_tutorial")):
        costmap = tutorial_costmap(factor)
        shifts = drive(costmap, poses)
        lethal, raised = int((costmap.cells == 254).sum()), float((costmap.cells > 0).mean())
        for name, times in (("inflation_shift", shifts), ("inflation_full", full_times(costmap, repeats))):
            key = f"{name}{ending}_ms"
            found[key] = round(statistics.median(times), 2)
            high = sorted(times)[math.ceil(0.99 * len(times)) - 1]
            aim = f"{AIMS[key]:6.0f}" if key in AIMS else " " * 6
            print(f"{key:28s} {found[key]:8.2f} {min(times):8.2f} {high:8.2f} {aim}  of {len(times)}")
        print(f"  cost_scaling_factor {factor:g}: {lethal} lethal cells, {100 * raised:.0f} % of the cells have a cost")
    return found


def main() -> None:
    run(__doc__, lambda quick: figures(repeats=5 if quick else 20, every=5 if quick else 1))


if __name__ == "__main__":
    main()
