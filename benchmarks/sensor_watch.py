#!/usr/bin/env python3
"""sensor_watch and its cost to the bridge, over loopback, with a real master, with 12 and with 250 sensors at 2 Hz.

    python3 benchmarks/sensor_watch.py [--json FILE] [--sensors 12 250] [--seconds 30]

The sensors (rosserial_fleet.py) are a process of their own and do not count. CPU is the share of one core; the bridge's
is given without and with sensor_watch, its only subscriber.
"""

from __future__ import annotations

import in_workspace  # first: it finds the interpreter

# isort: split
import argparse
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from rosserial import HERE, Bridge, Child, free_port, program

POINTS = HERE.parent / "params" / "room_points.yaml"


class Watch(Bridge):
    """The node sensor_watch, measured like the bridge."""

    def __init__(self, folder: Path, sensors: int) -> None:
        file = folder / "sensors.yaml"
        file.write_text(json.dumps({"sensors": [{"id": i, "room": 1} for i in range(sensors)]}))
        params = {"path_to_params": POINTS, "sensors": file, "state_dir": folder, "maildir": folder / "mail"}
        self._out = (folder / "watch.log").open("wb")
        self.popen = subprocess.Popen(
            [sys.executable, str(Path(program()).with_name("sensor_watch"))]
            + [f"_{name}:={value}" for name, value in params.items()],
            stdout=self._out,
            stderr=subprocess.STDOUT,
        )


def measure(folder: Path, sensors: int, seconds: float) -> dict[str, float]:
    """Measure one number of sensors."""
    port, fleet = free_port(), Child(str(HERE / "rosserial_fleet.py"))
    bridge = Bridge(program(), port, folder / "bridge.log")
    fleet.ask(connect=sensors, port=port)
    without = percent(fleet, seconds, bridge)[0]
    watch = Watch(folder, sensors)
    fleet.ask(steady=5.0, save="/dev/null")
    both = percent(fleet, seconds, bridge, watch)
    figures = {
        f"bridge_without_{sensors}": without,
        f"bridge_with_{sensors}": both[0],
        f"watch_{sensors}": both[1],
        f"watch_mb_{sensors}": watch.megabytes("Rss"),
    }
    for process in (watch, bridge):
        process.popen.send_signal(signal.SIGINT)
        process.popen.wait(10.0)
    fleet.ask(bye=True)
    fleet.stop()
    log = (folder / "watch.log").read_text()
    wrong = [line for line in log.splitlines() if "silent" in line or "Traceback" in line]
    print(
        f"{sensors} sensors: bridge {without:.1f} % of a core, {both[0]:.1f} % with sensor_watch; sensor_watch"
        f" {both[1]:.1f} %, {figures[f'watch_mb_{sensors}']:.0f} MB; told wrongly: {len(wrong)}",
        flush=True,
    )
    return figures


def percent(fleet: Child, seconds: float, *processes: Bridge) -> list[float]:
    """CPU of processes while the sensors send [% of a core]."""
    before, began = [p.cpu_seconds() for p in processes], time.monotonic()
    fleet.ask(steady=seconds, save="/dev/null")
    wall = time.monotonic() - began
    return [100.0 * (p.cpu_seconds() - b) / wall for p, b in zip(processes, before, strict=True)]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the figures here")
    parser.add_argument("--sensors", type=int, nargs="+", default=[12, 250])
    parser.add_argument("--seconds", type=float, default=30.0, help="of heartbeats")
    options = parser.parse_args()
    try:
        from rosbot_patrol.ros.campaign.house import Master
    except ImportError as err:
        print(f"{err}: `. scripts/env` first", file=sys.stderr)
        return 1
    print(f"{os.cpu_count()} cores, load average {os.getloadavg()[0]:.1f}", flush=True)
    figures: dict[str, float] = {}
    with tempfile.TemporaryDirectory(prefix="sensor_watch-") as name:
        master = Master(Path(name) / "roscore.log")
        try:
            for sensors in options.sensors:
                folder = Path(name) / str(sensors)
                folder.mkdir()
                figures |= measure(folder, sensors, options.seconds)
        finally:
            master.stop()
    in_workspace.require_figures(figures)
    if options.json:
        options.json.write_text(json.dumps(figures, indent=1) + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
