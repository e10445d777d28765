#!/usr/bin/env python3
"""The whole house: time until on guard, speed, and the cost of each node.

    python3 benchmarks/house.py [--json FILE] [--runs 3] [--room 7] [--setup]

- ready_s: from `roslaunch` to on guard, in real time, median of the runs; the first run warms the caches and is not
  counted.
- realtime_factor: simulated over wall time of a whole mission with a person in the room, rate:=0, with subscribers of
  colour and depth.
- table of nodes, over that mission: CPU as a share of one core per wall second and per simulated second, resident
  memory at the end.
- setup_min (--setup): `scripts/bootstrap` in a fresh clone, with the apt packages already installed.
"""

from __future__ import annotations

import in_workspace  # noqa: F401 - first: it finds the interpreter

# isort: split
import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
TICKS = os.sysconf("SC_CLK_TCK")
PAGE = os.sysconf("SC_PAGE_SIZE")


@dataclass
class Cost:
    """CPU seconds and resident bytes of one process."""

    cpu: float
    memory: int


def cost_of(pid: int) -> Cost | None:
    """Read /proc; None if the process has gone."""
    try:
        stat = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
        pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    except (OSError, IndexError):
        return None
    return Cost((int(stat[11]) + int(stat[12])) / TICKS, pages * PAGE)


def ready_times(folder: Path, runs: int) -> list[float]:
    from rosbot_patrol.ros.campaign.house import House

    times = []
    for i in range(runs + 1):
        with House(folder / f"ready{i}") as house:
            seconds = house.wait_ready(120.0)
        print(f"  ready after {seconds:.1f} s{' (warm-up, not counted)' if i == 0 else ''}", flush=True)
        times.append(seconds)
    return times[1:]


def mission_run(folder: Path, room: int) -> tuple[float, list[tuple[str, float, float, float]], str]:
    import rospy

    from rosbot_patrol.ros.campaign.house import House
    from rosbot_patrol.ros.simulator.demo_intruder_node import read_walk

    walk = read_walk(ROOT / "config" / "house_demo.yaml", room).path
    with House(folder / "mission", rate=0) as house:
        house.wait_ready(120.0)
        house.spawn("intruder", *walk[-1])
        # the second camera stream; detector and rgb_compress subscribe to the first
        rospy.Subscriber("/camera/depth/image_raw", rospy.AnyMsg, lambda _: None, queue_size=1, buff_size=1 << 23)
        before = {name: cost_of(pid) for name, pid in house.pids().items()}
        mission = house.mission(room, timeout=900.0)
        pids = house.pids()
        rows = []
        for name, pid in pids.items():
            start, end = before.get(name), cost_of(pid)
            if start and end and name.strip("/") and "house_watch" not in name:
                cpu = end.cpu - start.cpu
                rows.append((name, 100 * cpu / mission.wall_seconds, 100 * cpu / mission.sim_seconds, end.memory / 1e6))
        house.wait(lambda: any(a.delivered for a in house.alerts) or mission.verdict != "confirmed", 10.0, "the mail")
    factor = mission.sim_seconds / mission.wall_seconds
    said = (
        f"room {room}: {mission.verdict}, {mission.sim_seconds:.0f} simulated seconds in {mission.wall_seconds:.0f}, "
        f"{len(mission.contacts)} contacts, {len(house.mails())} mail(s)"
    )
    return factor, sorted(rows, key=lambda row: -row[1]), said


def setup_minutes(folder: Path) -> float:
    clone = folder / "clone"
    subprocess.run(["git", "clone", "--quiet", str(ROOT), str(clone)], check=True)
    start = time.monotonic()
    subprocess.run([str(clone / "scripts" / "bootstrap")], check=True)
    return (time.monotonic() - start) / 60.0


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", type=Path, help="write the figures here")
    parser.add_argument("--runs", type=int, default=3, help="starts that count for ready_s")
    parser.add_argument("--room", type=int, default=7, help="room of the mission")
    parser.add_argument("--setup", action="store_true", help="time scripts/bootstrap in a fresh clone too")
    options = parser.parse_args()
    try:
        from rosbot_patrol.ros.campaign.house import Master
    except ImportError as err:
        print(f"{err}: `. scripts/env` first", file=sys.stderr)
        return 1

    figures: dict[str, float] = {}
    with tempfile.TemporaryDirectory(prefix="house-") as name:
        folder = Path(name)
        if options.setup:
            figures["setup_min"] = setup_minutes(folder)
        master = Master(folder / "roscore.log")
        try:
            figures["ready_s"] = statistics.median(ready_times(folder, options.runs))
            figures["realtime_factor"], rows, said = mission_run(folder, options.room)
        finally:
            master.stop()

    print(f"\n{os.cpu_count()} cores; {said}\n")
    print("| node | % of a core (wall) | % of a core (simulated) | MB |\n|---|---|---|---|")
    for node, wall, simulated, memory in rows:
        print(f"| {node} | {wall:.1f} | {simulated:.1f} | {memory:.0f} |")
    print(f"| all | {sum(r[1] for r in rows):.0f} | {sum(r[2] for r in rows):.0f} | {sum(r[3] for r in rows):.0f} |\n")
    aims = {"ready_s": "<= 12", "realtime_factor": ">= 1.5", "setup_min": "<= 8"}
    for figure, value in figures.items():
        print(f"{figure}: {value:.2f} (aim {aims[figure]})")
    if options.json:
        options.json.write_text(json.dumps(figures, indent=1) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
