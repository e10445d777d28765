#!/usr/bin/env python3
"""Navigation: one table with the cost of its parts and the performance of the whole.

    python3 benchmarks/navigation.py [--json FILE] [--quick] [--goals N] [--only PART ...]

It runs the programs beside it, each in a process of its own, one after the other: navigation_costmap (inflation),
navigation_planning (global planners), navigation_control (local planners), navigation_node (the node move_base in a
patrol: needs `. scripts/env`) and navigation_goals (200 random goals in three houses). The head of each says what it
measures. The column `C++` has the originals' times on a machine of this size with the tutorial's parameters. If the
original C++ nodes are on the ROS package path, navigation_node also measures them on the same patrol.
"""

from __future__ import annotations

import in_workspace  # first: it finds the interpreter

# isort: split
import argparse
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).resolve().parent

PARTS = ("costmap", "planning", "control", "node", "goals")
# name: (aim, whether more is better)
AIMS = {
    "inflation_full_ms": (60.0, False),
    "inflation_shift_ms": (20.0, False),
    "plan_room7_ms": (100.0, False),
    "plan_corner_ms": (350.0, False),
    "plan_house_map_ms": (25.0, False),
    "plan_excess_percent": (1.0, False),
    "control_cycle_ms": (4.0, False),
    "move_base_cpu_percent": (20.0, False),
    "move_base_mb": (250.0, False),
    "move_base_cpu_percent_tutorial": (35.0, False),
    "move_base_mb_tutorial": (400.0, False),
    "goals_reached_rate": (0.995, True),
    "contacts": (0.0, False),
}
CPP = {
    "plan_room7_ms": 610.0,
    "plan_room2_ms": 100.0,
    "move_base_cpu_percent_tutorial": 38.5,
    "move_base_mb_tutorial": 335.0,
}


def run_part(part: str, arguments: list[str]) -> dict[str, float]:
    """Run one program, show its output, and return its figures."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "figures.json"
        command = [sys.executable, "-u", str(HERE / f"navigation_{part}.py"), "--json", str(file), *arguments]
        print(f"\n== {part}", flush=True)
        status = subprocess.run(command, check=False).returncode
        if status or not file.exists():
            print(f"navigation_{part}.py ended with {status}: no figures of it", file=sys.stderr)
            return {}
        found: dict[str, float] = json.loads(file.read_text(encoding="utf-8"))
        return found


def table(found: dict[str, float]) -> str:
    """Figures with aims and ratios: factors by which they beat the aim, and C++."""
    lines = ["| figure | value | aim | times the aim | C++ | times C++ |", "|---|---|---|---|---|---|"]
    for name, value in found.items():
        aim, ratio, original, against = "", "", "", ""
        if name in AIMS:
            limit, more = AIMS[name]
            aim = f"{'>=' if more else '<='} {limit:g}"
            better = (value / limit) if more else (limit / value if value else float("inf"))
            ratio = f"{better:.2f}" if limit else ("met" if value <= limit else "missed")
        if name in CPP:
            original, against = f"{CPP[name]:g}", f"{CPP[name] / value:.1f}" if value else ""
        lines.append(f"| {name} | {value:.4g} | {aim} | {ratio} | {original} | {against} |")
    return "\n".join(lines)


def main() -> None:
    """Run the wanted parts, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", type=Path, metavar="FILE")
    parser.add_argument("--quick", action="store_true", help="few repeats, 12 goals")
    parser.add_argument("--goals", type=int, default=200)
    parser.add_argument("--only", nargs="+", choices=PARTS, default=PARTS, metavar="PART")
    wanted = parser.parse_args()
    found: dict[str, float] = {}
    failed: list[str] = []
    for part in wanted.only:
        if part == "node" and "ROS_PACKAGE_PATH" not in os.environ:
            print("\n== node: left out, it needs `. scripts/env`", file=sys.stderr)
            continue
        arguments = ["--quick"] if wanted.quick and part != "goals" else []
        if part == "goals":
            arguments = ["--goals", str(12 if wanted.quick else wanted.goals)]
        figures = run_part(part, arguments)
        failed += [] if figures else [part]
        found.update(figures)
    in_workspace.require_figures(found, "no part gave figures")
    print(f"\n{os.cpu_count()} cores\n\n{table(found)}")
    if wanted.json:
        wanted.json.write_text(json.dumps(found, indent=2) + "\n", encoding="utf-8")
    if failed:
        sys.exit(f"navigation.py: no figures of: {', '.join(failed)}")


if __name__ == "__main__":
    main()
