#!/usr/bin/env python3
"""amcl: time per update, and quality of its localisation.

    python3 benchmarks/localization.py [--json FILE] [--quick] [--parts NAME ...]
        [--seeds 3] [--starts 100] [--carried 30] [--seconds 120]

update: amcl_update_NxK_ms is the time of motion, sensor model and resampling together, for N particles and K beams of
the likelihood field on the house map, with upstream's other defaults. It is pinned to one core; the figure is the
median of the repeats after a warm-up. KLD sampling would change the number of particles, so its bounds are set to N.
The particles are spread as after a patrol; for the column `spread` they cover the whole house, where every look-up
misses the cache. `least` is the fastest update, which other work on the machine affects least.

accuracy: patrols of the three houses (each room, a full turn in each) with encoder odometry, both profiles, by seeds.
starts: global localisation at random places, driving to random places for 60 s. A result within 0.3 m and 15 degrees
that stays so until the end is right. carried: a driving robot is moved elsewhere, and has 60 s. Drives:
`localization_drives.py`.

node: amcl's share of a core while the robot patrols the whole house in real time, and its memory. If the package path
has the original amcl, that one is measured, and the output says so.
"""

from __future__ import annotations

import in_workspace  # first: it finds the interpreter

# isort: split
import argparse
import json
import math
import os
import statistics
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from localization_quality import accuracy, global_starts, kidnappings
from node_cost import PROFILES, measure_profiles, original

from rosbot_patrol.amcl.localizer import Localizer
from rosbot_patrol.amcl.parameters import AmclParams
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.maps.map_io import read_map
from rosbot_patrol.scan import LaserScan

ROOT = Path(__file__).resolve().parents[1]

AIMS = {
    "amcl_update_2000x60_ms": "<= 0.8",
    "amcl_update_5000x180_ms": "<= 4",
    "rms_position_m": "<= 0.05",
    "rms_heading_deg": "<= 2",
    "global_localization_rate": ">= 0.95",
    "kidnap_recovery_rate": ">= 0.9",
    "amcl_cpu_percent": "<= 8",
    "amcl_mb": "<= 200",
}
PARTS = ("update", "accuracy", "starts", "carried", "node")
STEP = Pose2D(0.12, 0.0, 0.0)


def room_scan(beams: int) -> LaserScan:
    """A synthetic scan in which each beam hits."""
    angles = np.linspace(-math.pi, math.pi, beams)
    return LaserScan(
        stamp=0.0,
        frame_id="laser",
        angle_min=-math.pi,
        angle_increment=float(angles[1] - angles[0]),
        range_min=0.2,
        range_max=12.0,
        ranges=3.0 + 2.0 * np.cos(3.0 * angles),
    )


def update_times(particles: int, beams: int, repeats: int, *, spread: bool) -> list[float]:
    """Milliseconds of each update."""
    params = AmclParams(
        odom_model_type="diff-corrected",
        min_particles=particles,
        max_particles=particles,
        laser_max_beams=beams,
        update_min_d=0.1,
        resample_interval=1,
        seek="never",  # the synthetic scan fits nowhere
    )
    localizer = Localizer(params, np.random.default_rng(1))
    localizer.set_map(read_map(ROOT / "maps" / "rosbot_map.yaml"))
    scan, mount, times = room_scan(beams), Pose2D(), []
    scans = [replace(scan, stamp=0.3 * i) for i in range(repeats + 5)]  # so that each is also matched with the map
    localizer.update(scan, Pose2D(), mount)
    for i in range(repeats + 5):
        if spread:
            localizer.localize_globally()
            localizer.update(scans[i], Pose2D(), mount)
        else:  # keep the cloud of a patrol: the synthetic scan would move it
            localizer.filter.spread_about(Pose2D(), np.diag([0.01, 0.01, 0.005]))
        odometry = STEP if spread else Pose2D(0.12 * (i + 1), 0.0, 0.0)
        before = time.perf_counter()
        outcome = localizer.update(scans[i], odometry, mount)
        times.append(1e3 * (time.perf_counter() - before))
        assert outcome.resampled
        assert len(localizer.filter.poses) == particles
    return times[5:]


def update_figures(repeats: int) -> dict[str, float]:
    """Measure the times of an update and print them as a table."""
    figures = {}
    print(f"medians of {repeats} updates")
    print(f"{'figure':32s} {'ms':>8s} {'least':>8s} {'aim':>8s} {'spread, ms':>11s}")
    for particles, beams in ((2000, 60), (5000, 180)):
        name = f"amcl_update_{particles}x{beams}_ms"
        times = update_times(particles, beams, repeats, spread=False)
        figures[name] = round(statistics.median(times), 3)
        wide = statistics.median(update_times(particles, beams, repeats, spread=True))
        print(f"{name:32s} {figures[name]:8.3f} {min(times):8.3f} {AIMS[name]:>8s} {wide:11.3f}")
    return figures


def node_figures(seconds: float) -> dict[str, float]:
    """Measure the node's cost in patrols with either profile."""
    print(
        f"measured: {original('amcl') or 'amcl of rosbot_patrol; the original is not on the package path'}", flush=True
    )
    figures = {}
    for profile, costs in zip(PROFILES, measure_profiles(["/amcl"], PROFILES, seconds), strict=True):
        end, cost = "" if profile == "tuned" else f"_{profile}", costs["/amcl"]
        figures |= {f"amcl_cpu_percent{end}": round(cost.percent, 2), f"amcl_mb{end}": round(cost.megabytes, 1)}
        print(f"{profile}: {cost.seconds:.0f} s of driving, peak {cost.peak:.0f} MB")
    return figures


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", type=Path, metavar="FILE")
    parser.add_argument("--quick", action="store_true", help="one of each, short")
    parser.add_argument("--parts", nargs="+", choices=PARTS, default=PARTS)
    parser.add_argument("--seeds", type=int, default=3, help="patrols of each house")
    parser.add_argument("--starts", type=int, default=100)
    parser.add_argument("--carried", type=int, default=30)
    parser.add_argument("--seconds", type=float, default=120.0, help="of driving, for each profile")
    wanted = parser.parse_args()
    figures: dict[str, float] = {}
    if "node" in wanted.parts:  # first: it uses all cores
        figures |= node_figures(20.0 if wanted.quick else wanted.seconds)
    os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    print(f"1 core of {os.cpu_count()}")
    if "update" in wanted.parts:
        figures |= update_figures(30 if wanted.quick else 300)
    if "accuracy" in wanted.parts:
        figures |= accuracy(1 if wanted.quick else wanted.seeds, rooms=1 if wanted.quick else None)
    if "starts" in wanted.parts:
        figures |= global_starts(3 if wanted.quick else wanted.starts)
    if "carried" in wanted.parts:
        figures |= kidnappings(3 if wanted.quick else wanted.carried)
    in_workspace.require_figures(figures)
    print(f"\n{'figure':34s} {'value':>9s} {'aim':>9s}")
    for name, value in figures.items():
        print(f"{name:34s} {value:9.3f} {AIMS.get(name, ''):>9s}")
    if wanted.json:
        wanted.json.write_text(json.dumps(figures, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
