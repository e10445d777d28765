"""scenario_arguments FILE: checks a scenario and prints its settings as arguments for roslaunch, one per line."""

from __future__ import annotations

import sys
from pathlib import Path

from rosbot_patrol.errors import PatrolError
from rosbot_patrol.simulation.scenario.file import read_scenario


def main() -> None:
    """Print `name:=value` lines; exit status 1 and a sentence if the file is wrong."""
    if len(sys.argv) != 2:
        sys.exit("usage: scenario_arguments FILE")
    try:
        scenario = read_scenario(Path(sys.argv[1]))
    except PatrolError as err:
        sys.exit(str(err))
    print(f"scenario:={Path(sys.argv[1]).resolve()}")
    start = scenario.robot
    at = {"start_x": start.x, "start_y": start.y, "start_yaw": start.yaw} if start else {}
    for name, value in {**scenario.launch_arguments, **at}.items():
        print(f"{name}:={value}")
