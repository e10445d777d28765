#!/usr/bin/env python3
"""The filter of the ROSbot's motion: what it costs, and where it ends on upstream's bags.

    python3 benchmarks/ekf.py [--json FILE]

- cpu_percent: share of one core at 40 measurements a second (a ROSbot: wheels 20, IMU 10 x 2), without ROS.
- test1_m, test2_m: distance of the last position from upstream's, on the bags of robot_localization's own tests; left
  out where ../shared is absent.
"""

from __future__ import annotations

import in_workspace  # noqa: F401 - first: it finds the interpreter

# isort: split
import argparse
import json
import os
import sys
import time
from pathlib import Path

import numpy as np

from rosbot_patrol.ekf.filter import Ekf, Measurement
from rosbot_patrol.ekf.state import SIZE

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "test" / "unit" / "ekf"))
import test_ekf_bags as bags

UPDATES = 4000
PER_SECOND = 40


def cost() -> float:
    """CPU time of the updates, as a share of the time in which they come [%]."""
    mask = np.zeros(SIZE, bool)
    mask[[0, 1, 5, 6, 11]] = True
    ekf = Ekf(np.eye(SIZE) * 0.05, np.eye(SIZE) * 1e-9)
    began = time.process_time()
    for tick in range(UPDATES):
        values = np.zeros(SIZE)
        values[0] = values[6] = 0.01 * tick
        ekf.take(Measurement(tick / PER_SECOND, "", values, np.eye(SIZE) * 0.01, mask))
    return 100.0 * (time.process_time() - began) / (UPDATES / PER_SECOND)


def main() -> None:
    """Print the table, and write the figures."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    figures = {"cpu_percent": cost()}
    expected = {"test1": (bags.husky, (-40.0454, -76.9988, -2.6974)), "test2": (bags.jackal, (1.0206, 3.4292, 0.7419))}
    for name, (setting, end) in expected.items():
        path = bags.SHARED / f"robot_localization_{name}.bag"
        if path.exists():
            core, rate, odometry, imu = setting()
            found = bags.drive(path, core, rate, odometry, imu)
            figures[f"{name}_m"] = float(np.linalg.norm(found - np.array(end)))
    print(f"{os.cpu_count()} cores")
    for name, value in figures.items():
        print(f"{name:12} {value:8.4f}")
    if options.json:
        options.json.write_text(json.dumps({"ekf": figures}, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
