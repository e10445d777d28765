"""devices: which lidar, base and camera are plugged in.

rosrun rosbot_patrol devices           # what is found, and what is missing
rosrun rosbot_patrol devices --rules   # udev rules that name /dev/rplidar and /dev/rosbot
"""

from __future__ import annotations

import argparse

from rosbot_patrol.drivers.attached import RULES, find_attached, report


def main() -> None:
    """Print it."""
    parser = argparse.ArgumentParser(description="which lidar, base and camera are plugged in")
    parser.add_argument("--rules", action="store_true", help="print udev rules that name the devices")
    print(RULES if parser.parse_args().rules else report(find_attached()))
