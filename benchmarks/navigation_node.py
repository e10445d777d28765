#!/usr/bin/env python3
"""The node move_base in a patrol of the simulated house: what it costs, and whether it keeps its rate.

    . scripts/env; .ws/venv/bin/python benchmarks/navigation_node.py [--json FILE] [--quick] [--seconds 120]

For each profile the whole house runs at real time without the detector, and the robot is sent from room to room.
CPU of the process counts while the robot drives, as a share of one core; memory is what is resident at the end.
`--busy N` lets N other processes run without a pause meanwhile, in sessions of their own. `missed` counts the lines
"missed its desired rate" since the start. Where the package path has the original move_base instead of ours, it is the
one that is measured, and said so.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path

TICKS = os.sysconf("SC_CLK_TCK")
PROFILES = ("tuned", "tutorial")
AIMS = {"tuned": (20.0, 250.0), "tutorial": (35.0, 400.0)}
ROOMS = (5, 1, 3)
CONTACT = "floor"


@dataclass
class Cost:
    """What was counted of one profile."""

    cpu: float = 0.0
    seconds: float = 0.0
    simulated: float = 0.0
    megabytes: float = 0.0
    peak: float = 0.0
    missed: int = 0
    rooms: list[str] = field(default_factory=list)

    @property
    def percent(self) -> float:
        """Of one core while driving."""
        return 100.0 * self.cpu / self.seconds if self.seconds else float("nan")


def cpu_seconds(pid: int) -> float:
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / TICKS


def megabytes(pid: int, key: str) -> float:
    for line in Path(f"/proc/{pid}/status").read_text().splitlines():
        if line.startswith(key + ":"):
            return int(line.split()[1]) / 1024.0
    raise OSError(f"/proc/{pid}/status has no {key}")


def original() -> str:
    """Path of a move_base that is not ours, "" where it is ours."""
    found = subprocess.run(["catkin_find", "--libexec", "move_base"], capture_output=True, text=True, check=False)
    for folder in found.stdout.split():
        program = Path(folder) / "move_base"
        if program.is_file() and program.read_bytes()[:4] == b"\x7fELF":
            return str(program)
    return ""


def measure(folder: Path, profile: str, seconds: float) -> Cost:
    """Patrol until the robot has driven for so many seconds."""
    import rospy
    from rosbot_patrol.msg import PatrolState
    from rosgraph_msgs.msg import Log

    from rosbot_patrol.ros.house import House

    cost = Cost()

    def on_log(message: Log) -> None:
        if message.name == "/move_base" and "missed its desired rate" in message.msg:
            cost.missed += 1

    listener = rospy.Subscriber("/rosout_agg", Log, on_log, queue_size=100)
    with House(folder, detector="pc", profile=profile) as house:
        house.wait_ready(120.0)
        pid = house.pids()["/move_base"]
        moving = (PatrolState.DRIVING, PatrolState.RETURNING)
        turn = 0
        while cost.seconds < seconds:
            assert house.state is not None
            if house.state.state == PatrolState.IDLE:
                house.trigger(ROOMS[turn % len(ROOMS)])
                cost.rooms.append(str(ROOMS[turn % len(ROOMS)]))
                turn += 1
                house.wait(lambda: house.state.state in moving, 30.0, "the robot driving")
                time.sleep(1.0)
            before = house.state.state, cpu_seconds(pid), time.monotonic(), house.pose_stamp
            time.sleep(0.5)
            if before[0] == house.state.state and before[0] in moving:
                cost.cpu += cpu_seconds(pid) - before[1]
                cost.seconds += time.monotonic() - before[2]
                cost.simulated += house.pose_stamp - before[3]
        cost.megabytes, cost.peak = megabytes(pid, "VmRSS"), megabytes(pid, "VmHWM")
        touched = [contact for contact in house.contacts if contact[0] != CONTACT]
    listener.unregister()
    if touched:
        print(f"{profile}: the robot touched {touched[:3]}", file=sys.stderr)
    return cost


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the figures here")
    parser.add_argument("--quick", action="store_true", help="30 seconds of driving each")
    parser.add_argument("--seconds", type=float, default=120.0, help="of driving, for each profile")
    parser.add_argument("--busy", type=int, default=0, metavar="N", help="processes that keep the machine busy")
    parser.add_argument("--profiles", nargs="+", choices=PROFILES, default=PROFILES)
    options = parser.parse_args()
    try:
        from rosbot_patrol.ros.house import Master
    except ImportError as err:
        print(f"{err}: `. scripts/env` first", file=sys.stderr)
        return 1
    elf = original()
    print(f"measured: {elf or 'move_base of rosbot_patrol; the original is not on the package path'}", flush=True)
    costs: dict[str, Cost] = {}
    spin = [sys.executable, "-c", "while True: pass"]
    # each in a session of its own: Linux shares the processor between sessions first, as between the nodes
    busy = [subprocess.Popen(spin, start_new_session=True) for _ in range(options.busy)]
    with tempfile.TemporaryDirectory(prefix="navigation-node-") as name:
        master = Master(Path(name) / "roscore.log")
        try:
            for profile in options.profiles:
                costs[profile] = measure(Path(name) / profile, profile, 30.0 if options.quick else options.seconds)
        finally:
            master.stop()
            for process in busy:
                process.kill()
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
