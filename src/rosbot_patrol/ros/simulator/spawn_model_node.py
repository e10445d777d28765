"""gazebo_ros's spawn_model for our simulator: puts a URDF's robot into a running world.

Matches gazebo_ros 2.9 `spawn_model` where the tutorial needs it.

Differs: URDF only (`-urdf`), from a parameter (`-param`) or a file (`-file`). Joint, bond and physics options have no
effect, and a log line says so.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import rospy
from geometry_msgs.msg import Pose2D

from rosbot_patrol.errors import ParamError
from rosbot_patrol.ros.runtime.by_hand import PATIENCE, NobodyThere, is_launched
from rosbot_patrol.ros.runtime.node import run_node
from rosbot_patrol.srv import SpawnRobot

SERVICES = ("gazebo/spawn_robot", "simulator/spawn_robot", "/gazebo/spawn_robot")


def _parse(argv: list[str]) -> tuple[argparse.Namespace, list[str]]:
    parser = argparse.ArgumentParser(prog="spawn_model", description="put a robot into the simulator")
    parser.add_argument("-urdf", action="store_true", help="the description is a URDF")
    parser.add_argument("-param", help="parameter that holds the description")
    parser.add_argument("-file", help="file that holds the description")
    parser.add_argument("-model", default="rosbot", help="name of the robot")
    for axis in ("-x", "-y", "-z", "-R", "-P", "-Y"):
        parser.add_argument(axis, type=float, default=0.0)
    return parser.parse_known_args(argv)


def _description(options: argparse.Namespace) -> str:
    if options.param:
        urdf = rospy.get_param(options.param, None)
        if not isinstance(urdf, str):
            raise ParamError(options.param, "is missing, expected the robot's URDF as a text")
        return urdf
    if options.file:
        return Path(options.file).read_text(encoding="utf-8")
    raise ParamError("spawn_model", "expected -param NAME or -file FILE")


def _service() -> str:
    """Full name of the running simulator's service: in this namespace, or Gazebo's for all robots."""
    for service in SERVICES:
        name: str = rospy.resolve_name(service)
        try:
            rospy.wait_for_service(name, timeout=PATIENCE / len(SERVICES))
        except rospy.ROSException:
            continue
        return name
    return ""


def main() -> None:
    """Wait for the simulator, send it the description, end."""
    options, rest = _parse(rospy.myargv(sys.argv)[1:])

    def spawn() -> None:
        if rest:
            rospy.logwarn("spawn_model: %s has no effect here", " ".join(rest))
        urdf = _description(options)
        service = _service()
        if not service and not is_launched():
            names = " nor ".join(dict.fromkeys(map(rospy.resolve_name, SERVICES)))
            raise NobodyThere(f"neither {names} is offered: is the simulator running?")
        while not service and not rospy.is_shutdown():
            rospy.loginfo_throttle(5.0, "spawn_model waits for the simulator")
            service = _service()
        answer = rospy.ServiceProxy(service, SpawnRobot)(
            options.model, urdf, Pose2D(x=options.x, y=options.y, theta=options.Y)
        )
        if not answer.success:
            raise ParamError("spawn_model", answer.message)
        rospy.loginfo("spawn_model: %s", answer.message or f"{options.model} is in the world")

    run_node("spawn_model", spawn, by_hand=True, anonymous=True)
