#!/usr/bin/env python3
"""slam_gmapping: real robots' logs against their references, the house against its walls, speed and memory.

    python3 benchmarks/mapping.py [--json FILE] [--only logs|house|moved|nodes] [--seeds 5]
        [--loop-closure] [--quick] [--datasets FOLDER] [--log FILE ...] [--pictures FOLDER] [--keep FILE] [--anew]

The logs run with the tutorial's parameters (config/gmapping.yaml). Their odometry is made from the reference's
increments with noise by seed. Errors are those of relations (Kuemmerle et al. 2009), between consecutive scans and
between revisits (within 3 m and more than 100 scans apart), their mean over the seeds. The references are not the
truth: walls_deg and walls_reference_deg are the mean errors of our and the reference's headings against the right
angles of the building (right_angles.py). A finished run is stored in `--keep` and not repeated while the sources of
gmapping, the parameters and the log are the same. NAME_revisit_worst_m is the largest error of a seed, NAME_ms the mean
processor time of an update. `--loop-closure` runs all with the back end (`loop_closure`).

In the house the robot drives at 0.3 m/s with 720 beams at 10 Hz (mapping_house.py). gmapping_update_ms is the median of
the updates on one core. gmapping_rtf is the duration of the drive divided by the duration of the mapping. gmapping_mb
is the program's peak memory.

`--only moved` goes on with the house's map (`map_file`) after two pieces of furniture were moved. moved_left is the
share of their old wall cells that the map still has.

If the package path has the C++ original, the logs go by topics through it and through our node, one seed each
(mapping_node.py). NAME_node_* are our errors and costs, NAME_original_* the original's: `ms` is the processor time of a
scan. `--only nodes` measures ours alone if there is no original. A busy machine is refused, because a node that is
starved is not slow.
"""

from __future__ import annotations

import in_workspace  # first: it finds the interpreter

# isort: split
import argparse
import hashlib
import json
import math
import os
import statistics
import tempfile
import time
from pathlib import Path

import cv2
import numpy as np
import yaml
from mapping_house import measure_house, measure_moved
from node_cost import original, require_idle
from numpy.typing import NDArray
from right_angles import heading_errors

from rosbot_patrol import params
from rosbot_patrol.files import write_atomic
from rosbot_patrol.geometry import Pose2D, compose, invert, transform_points
from rosbot_patrol.gmapping.parameters import GmappingParams
from rosbot_patrol.grid import Grid
from rosbot_patrol.maps.known_part import known_part
from rosbot_patrol.maps.map_io import write_map
from rosbot_patrol.replay.bags.carmen import CarmenLog, noisy_odometry, read_log
from rosbot_patrol.replay.results.mapping import map_log
from rosbot_patrol.replay.results.plots import map_picture
from rosbot_patrol.replay.results.relations import consecutive_pairs, relation_errors, revisit_pairs

ROOT = Path(__file__).resolve().parents[1]

LOGS = {
    "intel": "intel-corrected",
    "fhw": "fhw-corrected",
    "csail": "csail-corrected",
    "orebro": "orebro-corrected",
    "fr079": "freiburg-079-corrected",
}
AIMS = {
    "intel_consecutive_m": 0.03,
    "intel_revisit_m": 0.045,
    "intel_revisit_deg": 0.7,
    "fhw_consecutive_m": 0.045,
    "fhw_revisit_m": 0.07,
    "fhw_revisit_deg": 0.7,
    "csail_revisit_m": 0.05,
    "csail_revisit_worst_m": 0.08,
    "csail_revisit_deg": 1.5,
    "orebro_revisit_m": 0.08,
    "fr079_revisit_m": 0.06,
    "fr079_revisit_deg": 0.7,
    "gmapping_update_ms": 30.0,
    "gmapping_rtf": 5.0,
    "gmapping_mb": 200.0,
    "house_wall_f1": 0.97,
    "house_wall_error_m": 0.015,
}
AT_LEAST = {"gmapping_rtf", "house_wall_f1"}
ZOOM = 3  # pixels of a cell in pictures

Poses = NDArray[np.float64]


def tutorial(seed: int, *, loop_closure: bool = False) -> GmappingParams:
    tree = yaml.safe_load((ROOT / "config" / "gmapping.yaml").read_text(encoding="utf-8"))
    return params.load(GmappingParams, tree | {"seed": seed, "loop_closure": loop_closure})


def digest_of(path: Path) -> str:
    """Digest of everything that a run of a log depends on."""
    found = hashlib.sha256(path.read_bytes())
    code = ROOT / "src" / "rosbot_patrol"
    others = code / "replay" / "bags" / "carmen.py", code / "scan.py", code / "geometry.py"
    for source in (*sorted((code / "gmapping").rglob("*.py")), *others):
        found.update(source.read_bytes())
    found.update((ROOT / "config" / "gmapping.yaml").read_bytes())
    return found.hexdigest()[:16]


class Kept:
    """Finished runs, stored in a file."""

    def __init__(self, path: Path, *, anew: bool) -> None:
        self._path = path
        has_some = path.exists() and not anew
        self._runs: dict[str, dict[str, float]] = json.loads(path.read_text(encoding="utf-8")) if has_some else {}

    def get(self, key: str) -> dict[str, float] | None:
        """A run's errors, None if it is not finished."""
        return self._runs.get(key)

    def put(self, key: str, run: dict[str, float]) -> None:
        """Store a finished run."""
        self._runs[key] = run
        write_atomic(self._path, (json.dumps(self._runs, indent=1) + "\n").encode())


def picture(grid: Grid, folder: Path | None, name: str, found: Poses, reference: Poses) -> None:
    """Draw the known part of a map with both trajectories (green: reference, red: result); write pgm and yaml."""
    if folder is None:
        return
    folder.mkdir(parents=True, exist_ok=True)
    write_map(str(folder / name), grid)
    known = known_part(grid, 1.0)
    drawing = np.repeat(np.repeat(map_picture(known), ZOOM, axis=0), ZOOM, axis=1)
    turned = transform_points(compose(Pose2D(*found[0]), invert(Pose2D(*reference[0]))), reference[:, :2])
    for way, colour in ((turned, (0, 160, 0)), (found[:, :2], (220, 0, 0))):
        places = (way - (known.info.origin_x, known.info.origin_y)) / known.info.resolution * ZOOM
        places[:, 1] = len(drawing) - places[:, 1]
        cv2.polylines(drawing, [np.round(places).astype(np.int32)], isClosed=False, color=colour, lineType=cv2.LINE_AA)
    cv2.imwrite(str(folder / f"{name}.png"), drawing[:, :, ::-1])


def errors_of(found: Poses, reference: Poses) -> dict[str, float]:
    """Errors of the relations between consecutive scans and, if there are any, between revisits."""
    consecutive = relation_errors(found, reference, consecutive_pairs(len(reference)))
    errors = {"consecutive_m": consecutive.shift, "consecutive_deg": math.degrees(consecutive.turn)}
    pairs = revisit_pairs(reference)
    if len(pairs):
        revisits = relation_errors(found, reference, pairs)
        errors |= {"revisit_m": revisits.shift, "revisit_deg": math.degrees(revisits.turn)}
    return errors


def run_log(log: CarmenLog, tuning: GmappingParams, folder: Path | None, name: str) -> dict[str, float]:
    """Errors of one seed."""
    seed = tuning.seed
    odometry = noisy_odometry(log.poses, np.random.default_rng(seed))
    began = time.process_time()
    found = map_log(log.scans, odometry, tuning)
    errors = errors_of(found.poses, log.poses) | {"ms": 1e3 * (time.process_time() - began) / found.updates}
    ours, theirs = heading_errors(log.scans, (found.poses, log.poses))
    errors |= {"walls_deg": ours, "walls_reference_deg": theirs}
    picture(found.slam.grid(), folder, f"{name}_{seed}", found.poses, log.poses)
    if folder is not None:
        np.savetxt(folder / f"{name}_{seed}_trajectory.txt", np.hstack((found.poses, log.poses)), fmt="%.4f")
    return errors


def logs_of(options: argparse.Namespace) -> dict[str, Path]:
    """The available logs."""
    logs = {name: options.datasets / f"{file}.log.gz" for name, file in LOGS.items()}
    logs |= {path.name.split(".")[0]: path for path in options.log}
    for name, path in logs.items():
        if not path.exists():
            print(f"{name}: {path} is not there, it is left out")
    return {name: path for name, path in logs.items() if path.exists()}


def measure_logs(options: argparse.Namespace) -> dict[str, float]:
    """Measure means over the seeds; prints each run."""
    kept, figures = Kept(options.keep, anew=options.anew), {}
    for name, path in logs_of(options).items():
        log, digest, runs = read_log(path), digest_of(path), []
        for seed in range(1, (1 if options.quick else options.seeds) + 1):
            key = f"{digest}-{seed}" + ("-closed" if options.loop_closure else "")
            run = kept.get(key)
            if run is None:
                run = run_log(log, tutorial(seed, loop_closure=options.loop_closure), options.pictures, name)
                kept.put(key, run)
            runs.append(run)
            print(f"{name} seed {seed}: " + ", ".join(f"{key} {value:.4f}" for key, value in run.items()), flush=True)
        for key in runs[0]:
            figures[f"{name}_{key}"] = round(statistics.mean(run[key] for run in runs), 4)
        if "revisit_m" in runs[0]:
            figures[f"{name}_revisit_worst_m"] = round(max(run["revisit_m"] for run in runs), 4)
    return figures


def measure_nodes(options: argparse.Namespace) -> dict[str, float]:
    """Measure the logs through our node and the original."""
    from mapping_node import through_node

    from rosbot_patrol.ros.campaign.house import Master

    require_idle()
    elf, figures = original("gmapping", "slam_gmapping"), {}
    print(f"original: {elf or 'not on the package path'}")
    nodes = {"node": ["rosrun", "rosbot_patrol", "slam_gmapping"]} | ({"original": [elf]} if elf else {})
    tree = yaml.safe_load((ROOT / "config" / "gmapping.yaml").read_text(encoding="utf-8"))
    with tempfile.TemporaryDirectory(prefix="mapping-node-") as folder:
        master = Master(Path(folder) / "roscore.log")
        try:
            for name, path in logs_of(options).items():
                log = read_log(path)
                odometry = noisy_odometry(log.poses, np.random.default_rng(1))
                for which, command in nodes.items():
                    run = through_node(command, log, odometry, tree)
                    errors = {k: round(v, 4) for k, v in errors_of(run.poses, log.poses).items()}
                    costs = {"ms": round(run.ms, 1), "mb": round(run.mb, 1)}
                    print(f"{name}, {' '.join(command)}: {errors} {costs}", flush=True)
                    figures |= {f"{name}_{which}_{key}": value for key, value in (errors | costs).items()}
        finally:
            master.stop()
    return figures


def show(figures: dict[str, float]) -> None:
    print(f"\n{'figure':28s} {'found':>9s} {'aim':>12s} {'x aim':>7s}")
    for name, value in figures.items():
        aim = AIMS.get(name)
        is_more = name in AT_LEAST
        wanted = f"{'>=' if is_more else '<='} {aim:g}" if aim else ""
        ratio = "" if not aim or not value else f"{value / aim if is_more else aim / value:.2f}"
        print(f"{name:28s} {value:9.4f} {wanted:>12s} {ratio:>7s}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", type=Path, metavar="FILE")
    parser.add_argument("--only", choices=("logs", "house", "moved", "nodes"))
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--loop-closure", action="store_true", help="with the back end, as in exploring")
    parser.add_argument("--quick", action="store_true", help="one seed, one room")
    parser.add_argument("--datasets", type=Path, default=ROOT.parent / "shared" / "datasets", metavar="FOLDER")
    parser.add_argument("--log", type=Path, action="append", default=[], metavar="FILE", help="a further CARMEN log")
    parser.add_argument("--pictures", type=Path, metavar="FOLDER", help="write maps and trajectories there")
    parser.add_argument("--keep", type=Path, default=ROOT / ".ws" / "mapping_benchmark.json", metavar="FILE")
    parser.add_argument("--anew", action="store_true", help="forget the runs that are kept")
    options = parser.parse_args()
    os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    print(f"1 core of {os.cpu_count()}")
    figures: dict[str, float] = {}
    if options.only in (None, "house"):
        house, grid, found, true = measure_house(tutorial(1, loop_closure=options.loop_closure), quick=options.quick)
        figures |= house
        picture(grid, options.pictures, "house", found, true)
    if options.only == "moved":
        _, grid, found, true = measure_house(tutorial(1), quick=False)
        with tempfile.TemporaryDirectory(prefix="mapping-moved-") as folder:
            moved, again = measure_moved(tutorial(2), grid, Path(folder))
        figures |= moved
        picture(grid, options.pictures, "before", found, true)
        picture(again, options.pictures, "after", found, true)
    if options.only in (None, "logs"):
        figures |= measure_logs(options)
    if options.only == "nodes" or (options.only is None and original("gmapping", "slam_gmapping")):
        figures |= measure_nodes(options)
    in_workspace.require_figures(figures)
    show(figures)
    if options.json:
        options.json.write_text(json.dumps(figures, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
