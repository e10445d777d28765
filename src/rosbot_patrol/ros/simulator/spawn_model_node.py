"""gazebo_ros's spawn_model for our simulator: puts a robot or a thing into a running world.

Matches gazebo_ros 2.9 `spawn_model`: a URDF (`-urdf`) or SDF (`-sdf`) text from a parameter (`-param`) or a file
(`-file`), or a model of Gazebo's by name (`-database`).

Differs: a URDF with driven wheels is the robot, of which there is one; every other model is a thing that stays where it
is. Things stand upright. Joint, bond and physics options have no effect, and a log line says so.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import rospy
from geometry_msgs.msg import Pose2D

from rosbot_patrol.errors import ParamError
from rosbot_patrol.ros.models.packages import model_folders, package_finder
from rosbot_patrol.ros.runtime.by_hand import PATIENCE, NobodyThere, is_launched
from rosbot_patrol.ros.runtime.node import run_node
from rosbot_patrol.simulation.sdf.files import ModelPath, model_file
from rosbot_patrol.simulation.sdf.values import Place
from rosbot_patrol.srv import SpawnRobot

SERVICES = ("gazebo/spawn_robot", "simulator/spawn_robot", "/gazebo/spawn_robot")


def _parse(argv: list[str]) -> tuple[argparse.Namespace, list[str]]:
    parser = argparse.ArgumentParser(prog="spawn_model", description="put a robot or a thing into the simulator")
    parser.add_argument("-urdf", action="store_true", help="the description is a URDF")
    parser.add_argument("-sdf", action="store_true", help="the description is SDF")
    parser.add_argument("-database", help="name of a model in a folder of models, such as GAZEBO_MODEL_PATH")
    parser.add_argument("-param", help="parameter that holds the description")
    parser.add_argument("-file", help="file that holds the description")
    parser.add_argument("-model", default="rosbot", help="name of the robot or thing")
    for axis in ("-x", "-y", "-z", "-R", "-P", "-Y"):
        parser.add_argument(axis, type=float, default=0.0)
    return parser.parse_known_args(argv)


def _description(options: argparse.Namespace) -> tuple[str, str]:
    """The text, and the file that it comes from, "" for none. Raises PatrolError."""
    if options.param:
        urdf = rospy.get_param(options.param, None)
        if not isinstance(urdf, str):
            raise ParamError(options.param, "is missing, expected the model's URDF or SDF as a text")
        return urdf, ""
    if options.database:
        here = Path.cwd()
        path, place = ModelPath(tuple(map(Path, model_folders())), package_finder()), Place(here, "-database")
        file = model_file(path.find(f"model://{options.database}", here, place), place)
    elif options.file:
        file = Path(options.file)
    else:
        raise ParamError("spawn_model", "expected -param NAME, -file FILE or -database MODEL")
    try:
        return file.read_bytes().decode("utf-8", errors="replace"), str(file.resolve())
    except OSError as err:
        raise ParamError("spawn_model", f"{file} cannot be read: {err.strerror}") from err


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
        if options.R or options.P:
            rospy.logwarn("spawn_model: -R and -P have no effect here, things stand upright")
        text, file = _description(options)
        service = _service()
        if not service and not is_launched():
            names = " nor ".join(dict.fromkeys(map(rospy.resolve_name, SERVICES)))
            raise NobodyThere(f"neither {names} is offered: is the simulator running?")
        while not service and not rospy.is_shutdown():
            rospy.loginfo_throttle(5.0, "spawn_model waits for the simulator")
            service = _service()
        pose = Pose2D(x=options.x, y=options.y, theta=options.Y)
        answer = rospy.ServiceProxy(service, SpawnRobot)(options.model, text, file, pose, options.z)
        if not answer.success:
            raise ParamError("spawn_model", answer.message)
        rospy.loginfo("spawn_model: %s", answer.message or f"{options.model} is in the world")

    run_node("spawn_model", spawn, by_hand=True, anonymous=True)
