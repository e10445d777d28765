"""rplidarNodeClient: prints the scans that come, as upstream's example does."""

from __future__ import annotations

import math
import sys

import rospy
from sensor_msgs.msg import LaserScan

from rosbot_patrol.ros.runtime.node import run_node


def _print(scan: LaserScan) -> None:
    count = round(scan.scan_time / scan.time_increment) if scan.time_increment > 0.0 else len(scan.ranges)
    lines = [f"I heard a laser scan {scan.header.frame_id}[{count}]:"]
    first, last = math.degrees(scan.angle_min), math.degrees(scan.angle_max)
    lines.append(f"angle_range, {first:f}, {last:f}")
    for at, distance in enumerate(scan.ranges):
        lines.append(f": [{math.degrees(scan.angle_min + scan.angle_increment * at):f}, {distance:f}]")
    sys.stdout.write("\n".join(lines) + "\n")
    sys.stdout.flush()


def _body() -> None:
    rospy.Subscriber("scan", LaserScan, _print, queue_size=1)
    rospy.spin()


def main() -> None:
    """Run the node."""
    run_node("rplidarNodeClient", _body)
