#!/usr/bin/env python3
"""The node move_base in a patrol of the simulated house: its cost, and whether it keeps its rate.

    python3 benchmarks/navigation_node.py [--json FILE] [--quick] [--seconds 120]

For each profile the whole house runs in real time without the detector, and the robot is sent from room to room. CPU of
the process counts while the robot drives, as a share of one core; memory is the resident size at the end. `--busy N`
runs N other processes without a pause meanwhile, in sessions of their own. `missed` counts the lines "missed its
desired rate" since the start. If the package path has the original move_base instead of ours, that one is measured, and
the output says so.
"""

from __future__ import annotations

import in_workspace  # noqa: F401 - first: it finds the interpreter

# isort: split
import argparse
import json
import os
import sys
from pathlib import Path

from node_cost import PROFILES, measure_profiles, original

AIMS = {"tuned": (20.0, 250.0), "tutorial": (35.0, 400.0)}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the figures here")
    parser.add_argument("--quick", action="store_true", help="30 seconds of driving each")
    parser.add_argument("--seconds", type=float, default=120.0, help="of driving, for each profile")
    parser.add_argument("--busy", type=int, default=0, metavar="N", help="processes that keep the machine busy")
    parser.add_argument("--profiles", nargs="+", choices=PROFILES, default=PROFILES)
    options = parser.parse_args()
    elf = original("move_base")
    print(f"measured: {elf or 'move_base of rosbot_patrol; the original is not on the package path'}", flush=True)
    seconds = 30.0 if options.quick else options.seconds
    try:
        found = measure_profiles(["/move_base"], options.profiles, seconds, options.busy)
    except ImportError as err:
        print(f"{err}: `. scripts/env` first", file=sys.stderr)
        return 1
    costs = {profile: cost["/move_base"] for profile, cost in zip(options.profiles, found, strict=True)}
    print(f"\n{os.cpu_count()} cores, {options.busy} other busy processes\n")
    print("| profile | driven s (simulated) | % of a core | aim | MB | aim | peak MB | missed |")
    print("|---|---|---|---|---|---|---|---|")
    figures: dict[str, float] = {}
    for profile, cost in costs.items():
        aims = AIMS[profile]
        print(
            f"| {profile} | {cost.seconds:.0f} ({cost.simulated:.0f}) | {cost.percent:.1f} | {aims[0]:g} |"
            f" {cost.megabytes:.0f} | {aims[1]:g} | {cost.peak:.0f} | {cost.missed} |"
        )
        end = "" if profile == "tuned" else f"_{profile}"
        figures |= {
            f"move_base_cpu_percent{end}": cost.percent,
            f"move_base_mb{end}": cost.megabytes,
            f"move_base_missed_rate{end}": cost.missed,
        }
    if options.json:
        options.json.write_text(json.dumps(figures, indent=1) + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
