"""sensors: prints a table of all motion sensors from sensor_watch's messages.

rosrun rosbot_patrol sensors [--follow]

Exit status: 0 if all are well, 1 if one is not, 2 if no message comes.
"""

from __future__ import annotations

import argparse
import os
import sys
import threading

import rospy

from rosbot_patrol.msg import SensorState, SensorStates
from rosbot_patrol.ros.runtime.by_hand import PATIENCE, require_master
from rosbot_patrol.sensors.problems import duration

HEAD = ("id", "room", "state", "heard", "motion", "triggers", "from")
WELL = ("ok", "waiting", "disabled", "unwatched")


def table(message: SensorStates) -> str:
    """Format one line per sensor, its problems below, and the sentence about all of them."""
    rows = [HEAD, *(_row(sensor) for sensor in message.sensors)]
    widths = [max(len(row[i]) for row in rows) for i in range(len(HEAD))]
    lines = ["  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows]
    lines += ["", message.text] if message.text else []
    lines += [f"! {sensor.text}" for sensor in message.sensors if sensor.state not in WELL]
    return "\n".join(lines)


def _row(sensor: SensorState) -> tuple[str, ...]:
    room = f"{sensor.room} {sensor.room_name}" if sensor.room >= 0 else "?"
    name = f' "{sensor.name}"' if sensor.name else ""
    source = f"{sensor.peer}{' (key)' if sensor.proven else ''}" if sensor.peer else ""
    return (
        str(sensor.id),
        room + name,
        sensor.state,
        _ago(sensor.heard),
        _ago(sensor.motion),
        str(sensor.triggers),
        source,
    )


def _ago(seconds: float) -> str:
    return "never" if seconds < 0.0 else f"{duration(seconds)} ago"


def main() -> None:
    """Print once, or after each change with --follow."""
    parser = argparse.ArgumentParser(prog="sensors", description="Prints all motion sensors and how they are.")
    parser.add_argument("--follow", action="store_true", help="print again whenever something is told")
    parser.add_argument(
        "--wait", type=float, default=PATIENCE, metavar="S", help="for sensor_watch (default: %(default)s)"
    )
    arguments = parser.parse_args(rospy.myargv()[1:])
    status, came = 2, threading.Event()

    def show(message: SensorStates) -> None:
        nonlocal status
        if arguments.follow or not came.is_set():
            print(table(message) + ("\n" if arguments.follow else ""), flush=True)
        status = 1 if any(sensor.state not in WELL for sensor in message.sensors) or message.bridges_gone else 0
        came.set()

    require_master("sensors", status=2)
    rospy.init_node("sensors", anonymous=True)
    rospy.Subscriber("sensors/states", SensorStates, show, queue_size=1)
    if not came.wait(arguments.wait):
        topic = rospy.resolve_name("sensors/states")
        print(f"nothing on {topic} within {arguments.wait:g} s: is sensor_watch running?", file=sys.stderr)
    elif arguments.follow:
        rospy.spin()
    sys.stdout.flush()
    os._exit(status)
