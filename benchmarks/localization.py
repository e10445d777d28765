#!/usr/bin/env python3
"""amcl: how long an update takes, and how well it knows where the robot is.

    PYTHONPATH=src .ws/venv/bin/python benchmarks/localization.py [--json FILE] [--quick]

amcl_update_NxK_ms: motion, sensor model and resampling together for N particles and K beams of the likelihood field on
the house map, with upstream's other defaults, pinned to one core; median of the repeats after a warm-up. KLD sampling
would change the number of particles, so its bounds are set to N. The particles are spread as after a patrol, and for
the column `spread` over the whole house, where every look-up misses the cache; `least` is the
fastest update, which other work on the machine disturbs least.
"""

from __future__ import annotations

import math
import statistics
import sys
import time
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "src"))

from one_core import run  # noqa: E402

from rosbot_patrol.amcl.localizer import Localizer  # noqa: E402
from rosbot_patrol.amcl.parameters import AmclParams  # noqa: E402
from rosbot_patrol.amcl.sensor_model import Mount  # noqa: E402
from rosbot_patrol.geometry import Pose2D  # noqa: E402
from rosbot_patrol.maps.map_io import read_map  # noqa: E402
from rosbot_patrol.scan import LaserScan  # noqa: E402

AIMS = {"amcl_update_2000x60_ms": 0.8, "amcl_update_5000x180_ms": 4.0}
STEP = Pose2D(0.12, 0.0, 0.0)


def room_scan(beams: int) -> LaserScan:
    """A made-up scan in which each beam hits."""
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
    )
    localizer = Localizer(params, np.random.default_rng(1))
    localizer.set_map(read_map(ROOT / "maps" / "rosbot_map.yaml"))
    scan, mount, times = room_scan(beams), Mount(), []
    localizer.update(scan, Pose2D(), mount)
    for i in range(repeats + 5):
        if spread:
            localizer.localize_globally()
            localizer.update(scan, Pose2D(), mount)
        else:  # keep the cloud of a patrol: the made-up scan would move it
            localizer.filter.spread_about(Pose2D(), np.diag([0.01, 0.01, 0.005]))
        odometry = STEP if spread else Pose2D(0.12 * (i + 1), 0.0, 0.0)
        before = time.perf_counter()
        outcome = localizer.update(scan, odometry, mount)
        times.append(1e3 * (time.perf_counter() - before))
        assert outcome.resampled
        assert len(localizer.filter.poses) == particles
    return times[5:]


def measured(quick: bool) -> dict[str, float]:
    """The figures of FIGURES.md that this program knows, printed as a table."""
    repeats = 30 if quick else 300
    figures = {}
    print(f"medians of {repeats} updates")
    print(f"{'figure':32s} {'ms':>8s} {'least':>8s} {'aim':>6s} {'spread, ms':>11s}")
    for particles, beams in ((2000, 60), (5000, 180)):
        name = f"amcl_update_{particles}x{beams}_ms"
        times = update_times(particles, beams, repeats, spread=False)
        figures[name] = round(statistics.median(times), 3)
        wide = statistics.median(update_times(particles, beams, repeats, spread=True))
        print(f"{name:32s} {figures[name]:8.3f} {min(times):8.3f} {AIMS[name]:6.1f} {wide:11.3f}")
    return figures


def main() -> None:
    run(__doc__, measured)


if __name__ == "__main__":
    main()
