"""Intruder of the demonstration: once the robot is on guard, a person walks into a room of the simulated house."""

from __future__ import annotations

import threading
from dataclasses import dataclass
from pathlib import Path

import rospy
from geometry_msgs.msg import Pose2D

from rosbot_patrol import params
from rosbot_patrol.errors import ParamError, WorldError
from rosbot_patrol.msg import PatrolState
from rosbot_patrol.params import param
from rosbot_patrol.ros.runtime.by_hand import PATIENCE, NobodyThere, is_launched, require_publisher
from rosbot_patrol.ros.runtime.node import load_params, run_node
from rosbot_patrol.srv import MoveActor, SpawnActor
from rosbot_patrol.yaml_files import read_mapping


@dataclass(frozen=True, kw_only=True)
class WalkParams:
    """Path and speed of the intruder."""

    path: list[list[float]] = param(doc="points x, y of the walk in the map frame; the intruder appears at the first")
    speed: float = param(0.8, unit="m/s", lo=0.05, hi=3.0, doc="walking speed")


@dataclass(frozen=True, kw_only=True)
class DemoParams:
    """Parameters of the node demo_intruder."""

    walks: str = param(doc="yaml file with a path and a speed for each room")
    room: int = param(5, lo=0, doc="room that the intruder enters")
    delay: float = param(3.0, unit="s", lo=0.0, doc="time on guard before the intruder appears")
    look: str = param("", doc="name of the intruder's appearance; empty: drawn from the simulator's seed")
    simulator: str = param("simulator", doc="node name of the simulator")


def read_walk(path: Path, room: int) -> WalkParams:
    """Read the walk into a room.

    Raises:
        WorldError: the file has no such room.
        ParamError: the file cannot be read or a key is wrong.
    """
    walks = read_mapping(path, keys="walks").get("walks")
    if not isinstance(walks, dict):
        raise ParamError(f"{path}: walks", f"expected a walk for each room, got {walks!r}")
    if room not in walks:
        raise WorldError(path, f"has no walk into room {room}, only into {', '.join(map(str, sorted(walks)))}")
    walk = params.load(WalkParams, walks[room], name=f"{path}: walks/{room}/")
    if not walk.path or any(len(point) != 2 for point in walk.path):
        raise ParamError(f"{path}: walks/{room}/path", f"expected points [x, y], got {walk.path}")
    return walk


def _wait_until_on_guard() -> None:
    on_guard = threading.Event()

    def look(state: PatrolState) -> None:
        if state.state == PatrolState.IDLE:
            on_guard.set()

    subscriber = rospy.Subscriber("patrol/state", PatrolState, look, queue_size=1)
    if not is_launched():
        require_publisher(subscriber, "patrol_robot")
    while not rospy.is_shutdown() and not on_guard.wait(0.2):
        pass
    subscriber.unregister()


def _body() -> None:
    demo = load_params(DemoParams)
    walk = read_walk(Path(demo.walks), demo.room)
    spawn_name, move_name = f"{demo.simulator}/spawn_actor", f"{demo.simulator}/move_actor"
    _wait_until_on_guard()
    rospy.sleep(demo.delay)
    try:
        rospy.wait_for_service(spawn_name, None if is_launched() else PATIENCE)
    except rospy.ROSException as err:
        raise NobodyThere(f"nobody offers {spawn_name}: is the simulator running?") from err
    x, y = walk.path[0]
    placed = rospy.ServiceProxy(spawn_name, SpawnActor)("intruder", "person", demo.look, "", Pose2D(x, y, 0.0))
    if not placed.success:
        raise WorldError(spawn_name, placed.message)
    rospy.loginfo("an intruder walks into room %d", demo.room)
    points = [Pose2D(x, y, 0.0) for x, y in walk.path[1:]]
    if points:
        moved = rospy.ServiceProxy(move_name, MoveActor)(name=placed.name, path=points, speed=walk.speed)
        if not moved.success:
            raise WorldError(move_name, moved.message)


def main() -> None:
    """Wait for the guard, send the intruder, end."""
    run_node("demo_intruder", _body, by_hand=True)
