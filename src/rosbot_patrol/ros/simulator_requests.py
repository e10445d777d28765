"""Services of the simulator: requests of other threads, done by the simulation's thread between two ticks."""

from __future__ import annotations

import queue
from collections.abc import Callable
from concurrent.futures import Future
from concurrent.futures import TimeoutError as FutureTimeout
from typing import Any

import rospy
from std_srvs.srv import Empty, EmptyResponse

from rosbot_patrol.errors import PatrolError
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.ros.packages import package_finder
from rosbot_patrol.simulation.engine import Engine
from rosbot_patrol.simulation.robot import parse_robot
from rosbot_patrol.srv import (
    MoveActor,
    MoveActorRequest,
    MoveActorResponse,
    RemoveActor,
    RemoveActorRequest,
    RemoveActorResponse,
    SpawnActor,
    SpawnActorRequest,
    SpawnActorResponse,
    SpawnRobot,
    SpawnRobotRequest,
    SpawnRobotResponse,
)

_PATIENCE = 10.0  # wall time that a request waits for the simulation [s]


class Requests:
    """Advertises the services; the simulation's thread calls `serve` between two ticks.

    Args:
        engine: what is asked to change.
        set_paused: pauses or goes on.
    """

    def __init__(self, engine: Engine, set_paused: Callable[[bool], None]) -> None:
        self._engine = engine
        self._set_paused = set_paused
        self._queue: queue.Queue[tuple[Callable[[], Any], Future[Any]]] = queue.Queue()
        rospy.Service("~spawn_actor", SpawnActor, self._spawn_actor)
        rospy.Service("~move_actor", MoveActor, self._move_actor)
        rospy.Service("~remove_actor", RemoveActor, self._remove_actor)
        rospy.Service("~spawn_robot", SpawnRobot, self._spawn_robot)
        rospy.Service("~pause", Empty, lambda _: self._empty(lambda: self._set_paused(True)))
        rospy.Service("~unpause", Empty, lambda _: self._empty(lambda: self._set_paused(False)))
        rospy.Service("~reset", Empty, lambda _: self._empty(self._engine.reset))

    def serve(self) -> None:
        """Do what has been asked for."""
        while not self._queue.empty():
            action, future = self._queue.get_nowait()
            if not future.set_running_or_notify_cancel():
                continue
            try:
                future.set_result(action())
            except PatrolError as err:
                future.set_exception(err)

    def _ask(self, action: Callable[[], Any]) -> Any:
        future: Future[Any] = Future()
        self._queue.put((action, future))
        try:
            return future.result(_PATIENCE)
        except FutureTimeout as err:
            future.cancel()
            raise PatrolError(f"the simulation did not answer within {_PATIENCE:.0f} s") from err

    def _empty(self, action: Callable[[], None]) -> EmptyResponse:
        self._ask(action)
        return EmptyResponse()

    def _spawn_actor(self, request: SpawnActorRequest) -> SpawnActorResponse:
        try:
            name = self._ask(
                lambda: self._engine.spawn_actor(
                    request.name, request.model, request.look, _pose(request.pose), posture=request.posture
                )
            )
        except PatrolError as err:
            return SpawnActorResponse(success=False, name=request.name, message=str(err))
        rospy.loginfo("%s '%s' stands at (%.2f, %.2f)", request.model, name, request.pose.x, request.pose.y)
        return SpawnActorResponse(success=True, name=name, message="")

    def _move_actor(self, request: MoveActorRequest) -> MoveActorResponse:
        path = [_pose(p) for p in request.path]
        try:
            self._ask(lambda: self._engine.move_actor(request.name, path, request.speed, request.loop))
        except PatrolError as err:
            return MoveActorResponse(success=False, message=str(err))
        return MoveActorResponse(success=True, message="")

    def _remove_actor(self, request: RemoveActorRequest) -> RemoveActorResponse:
        try:
            self._ask(lambda: self._engine.remove_actor(request.name))
        except PatrolError as err:
            return RemoveActorResponse(success=False, message=str(err))
        rospy.loginfo("'%s' is gone", request.name)
        return RemoveActorResponse(success=True, message="")

    def _spawn_robot(self, request: SpawnRobotRequest) -> SpawnRobotResponse:
        try:
            robot = parse_robot(request.urdf, source=f"robot '{request.name}'", find_package=package_finder())
            self._ask(lambda: self._engine.spawn_robot(robot, _pose(request.pose)))
        except PatrolError as err:
            return SpawnRobotResponse(success=False, message=str(err))
        rospy.loginfo("robot '%s' stands at (%.2f, %.2f)", request.name, request.pose.x, request.pose.y)
        return SpawnRobotResponse(success=True, message="")


def _pose(msg: Any) -> Pose2D:
    return Pose2D(msg.x, msg.y, msg.theta)
