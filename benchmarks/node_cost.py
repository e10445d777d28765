"""Cost of the house's nodes while the robot patrols: share of a core, memory.

The whole house runs in real time without the detector, and the robot is sent from room to room. CPU counts while it
drives; memory is the resident size at the end.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

TICKS = os.sysconf("SC_CLK_TCK")
PROFILES = ("tuned", "tutorial")
ROOMS = (5, 1, 3)
CONTACT = "floor"


@dataclass
class Cost:
    """Measurements of one node in one profile."""

    cpu: float = 0.0
    seconds: float = 0.0
    simulated: float = 0.0
    megabytes: float = 0.0
    peak: float = 0.0
    missed: int = 0

    @property
    def percent(self) -> float:
        """Share of one core while driving [%]."""
        return 100.0 * self.cpu / self.seconds if self.seconds else float("nan")


def cpu_seconds(pid: int) -> float:
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / TICKS


def megabytes(pid: int, key: str) -> float:
    for line in Path(f"/proc/{pid}/status").read_text().splitlines():
        if line.startswith(key + ":"):
            return int(line.split()[1]) / 1024.0
    raise OSError(f"/proc/{pid}/status has no {key}")


def require_idle(most: float = 0.15, seconds: float = 3.0) -> None:
    """End the program with a sentence if other programs use more than a share of the processors."""
    before = _ticks()
    time.sleep(seconds)
    busy, total = (after - earlier for after, earlier in zip(_ticks(), before, strict=True))
    if busy > most * total:
        raise SystemExit(
            f"{100.0 * busy / total:.0f} % of the processors are in use, {100.0 * most:.0f} % at most are expected:"
            " nothing is compared on a busy machine"
        )


def _ticks() -> tuple[int, int]:
    """Clock ticks of all processors since the start: busy ones, and all."""
    fields = [int(word) for word in Path("/proc/stat").read_text(encoding="ascii").split("\n", 1)[0].split()[1:9]]
    return sum(fields) - fields[3] - fields[4], sum(fields)


def original(package: str, name: str = "") -> str:
    """Path of a package's node (default: of its name) if it is the original, "" if it is ours."""
    found = subprocess.run(["catkin_find", "--libexec", package], capture_output=True, text=True, check=False)
    for folder in found.stdout.split():
        program = Path(folder) / (name or package)
        if program.is_file() and program.read_bytes()[:4] == b"\x7fELF":
            return str(program)
    return ""


@contextmanager
def busy_master(folder: Path, busy: int) -> Iterator[None]:
    """Start a master, and `busy` processes that run without a pause."""
    from rosbot_patrol.ros.campaign.house import Master

    master = Master(folder / "roscore.log")
    spin = [sys.executable, "-c", "while True: pass"]
    # each in a session of its own, like the nodes: Linux shares the processor between sessions first
    processes = [subprocess.Popen(spin, start_new_session=True) for _ in range(busy)]
    try:
        yield
    finally:
        master.stop()
        for process in processes:
            process.kill()


def measure(folder: Path, profile: str, seconds: float, nodes: Sequence[str]) -> dict[str, Cost]:
    """Patrol until the robot has driven for `seconds`; returns the cost of each node, named as in "/amcl"."""
    import rospy
    from rosbot_patrol.msg import PatrolState
    from rosgraph_msgs.msg import Log

    from rosbot_patrol.ros.campaign.house import House

    costs = {node: Cost() for node in nodes}

    def on_log(message: Log) -> None:
        if message.name in costs and "missed its desired rate" in message.msg:
            costs[message.name].missed += 1

    listener = rospy.Subscriber("/rosout_agg", Log, on_log, queue_size=100)
    with House(folder, detector="pc", standby="false", profile=profile) as house:
        house.wait_ready(120.0)
        pids = {node: house.pids()[node] for node in nodes}
        moving = (PatrolState.DRIVING, PatrolState.RETURNING)
        turn = 0
        while any(cost.seconds < seconds for cost in costs.values()):
            assert house.state is not None
            if house.state.state == PatrolState.IDLE:
                room = ROOMS[turn % len(ROOMS)]
                house.trigger(room)
                turn += 1
                house.wait(lambda: house.state.state in moving, 30.0, "the robot driving")
                time.sleep(1.0)
            state, began, stamp = house.state.state, time.monotonic(), house.pose_stamp
            before = {node: cpu_seconds(pid) for node, pid in pids.items()}
            time.sleep(0.5)
            if state != house.state.state or state not in moving:
                continue
            for node, cost in costs.items():
                cost.cpu += cpu_seconds(pids[node]) - before[node]
                cost.seconds += time.monotonic() - began
                cost.simulated += house.pose_stamp - stamp
        for node, cost in costs.items():
            cost.megabytes, cost.peak = megabytes(pids[node], "VmRSS"), megabytes(pids[node], "VmHWM")
        touched = [contact for contact in house.contacts if contact[0] != CONTACT]
    listener.unregister()
    if touched:
        print(f"{profile}: the robot touched {touched[:3]}", file=sys.stderr)
    return costs


def measure_profiles(
    nodes: Sequence[str], profiles: Sequence[str], seconds: float, busy: int = 0
) -> list[dict[str, Cost]]:
    """The costs of each profile, each with a master of its own."""
    with tempfile.TemporaryDirectory(prefix="node-cost-") as name, busy_master(Path(name), busy):
        return [measure(Path(name) / profile, profile, seconds, nodes) for profile in profiles]
