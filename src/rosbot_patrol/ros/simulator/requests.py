"""Services of the simulator: the simulation's thread executes requests of other threads between two ticks."""

from __future__ import annotations

import queue
from collections.abc import Callable
from concurrent.futures import Future
from concurrent.futures import TimeoutError as FutureTimeout
from dataclasses import replace
from typing import Any

import rospy
from std_srvs.srv import Empty, EmptyResponse, Trigger, TriggerResponse

from rosbot_patrol.counts import count_of
from rosbot_patrol.errors import PatrolError, WorldError
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.ros.models.packages import model_folders, package_finder
from rosbot_patrol.simulation.engine import Engine
from rosbot_patrol.simulation.robot.description import parse_robot
from rosbot_patrol.simulation.scene.matrices import from_pose2d
from rosbot_patrol.simulation.sdf.world import World, parse_model
from rosbot_patrol.srv import (
    MoveActor,
    MoveActorRequest,
    MoveActorResponse,
    RemoveActor,
    RemoveActorRequest,
    RemoveActorResponse,
    SetPose,
    SetPoseRequest,
    SetPoseResponse,
    SpawnActor,
    SpawnActorRequest,
    SpawnActorResponse,
    SpawnRobot,
    SpawnRobotRequest,
    SpawnRobotResponse,
    StepSimulation,
    StepSimulationRequest,
    StepSimulationResponse,
)

_PATIENCE = 10.0  # longest wait of a request for the simulation, in wall time [s]
_MOST_TICKS = 1000


class Requests:
    """The services; the simulation's thread calls `serve` between two ticks.

    Args:
        engine: engine that the requests change.
        set_paused: pauses or resumes.
        advance: advances a paused simulation by some ticks; raises PatrolError if it is not paused.
    """

    def __init__(self, engine: Engine, set_paused: Callable[[bool], None], advance: Callable[[int], None]) -> None:
        self._engine = engine
        self._set_paused = set_paused
        self._advance = advance
        self._queue: queue.Queue[tuple[Callable[[], Any], Future[Any]]] = queue.Queue()
        rospy.Service("~spawn_actor", SpawnActor, self._spawn_actor)
        rospy.Service("~move_actor", MoveActor, self._move_actor)
        rospy.Service("~remove_actor", RemoveActor, self._remove_actor)
        rospy.Service("~spawn_robot", SpawnRobot, self._spawn_robot)
        rospy.Service("~pause", Empty, lambda _: self._empty(lambda: self._set_paused(True)))
        rospy.Service("~unpause", Empty, lambda _: self._empty(lambda: self._set_paused(False)))
        rospy.Service("~reset", Empty, lambda _: self._empty(self._engine.reset))
        rospy.Service("~step", StepSimulation, self._step)
        rospy.Service("~set_pose", SetPose, self._set_pose)
        rospy.Service("~remove_robot", Trigger, self._remove_robot)
        for name in ("reset_simulation", "reset_world"):
            rospy.Service(f"gazebo/{name}", Empty, lambda _: self._empty(self._engine.reset))
        rospy.Service("gazebo/pause_physics", Empty, lambda _: self._empty(lambda: self._set_paused(True)))
        rospy.Service("gazebo/unpause_physics", Empty, lambda _: self._empty(lambda: self._set_paused(False)))

    def serve(self) -> None:
        """Execute the waiting requests."""
        while not self._queue.empty():
            action, future = self._queue.get_nowait()
            if not future.set_running_or_notify_cancel():
                continue
            try:
                future.set_result(action())
            except PatrolError as err:
                future.set_exception(err)

    def ask(self, action: Callable[[], Any]) -> Any:
        """Run an action on the simulation's thread; returns its result or raises its PatrolError."""
        future: Future[Any] = Future()
        self._queue.put((action, future))
        try:
            return future.result(_PATIENCE)
        except FutureTimeout as err:
            future.cancel()
            raise PatrolError(f"the simulation did not answer within {_PATIENCE:.0f} s") from err

    def _empty(self, action: Callable[[], None]) -> EmptyResponse:
        try:
            self.ask(action)
        except PatrolError as err:
            raise rospy.ServiceException(str(err)) from err
        return EmptyResponse()

    def _step(self, request: StepSimulationRequest) -> StepSimulationResponse:
        if not 0 < request.ticks <= _MOST_TICKS:
            problem = f"cannot step {count_of(request.ticks, 'tick')}, expected 1 to {_MOST_TICKS}"
            return StepSimulationResponse(success=False, message=problem)
        try:
            self.ask(lambda: self._advance(request.ticks))
        except PatrolError as err:
            return StepSimulationResponse(success=False, now=self._engine.now, message=str(err))
        return StepSimulationResponse(success=True, now=self._engine.now, message="")

    def _set_pose(self, request: SetPoseRequest) -> SetPoseResponse:
        try:
            self.ask(lambda: self._put(request.name, _pose(request.pose)))
        except PatrolError as err:
            return SetPoseResponse(success=False, message=str(err))
        name, place = request.name or "the robot", f"({request.pose.x:.2f}, {request.pose.y:.2f})"
        rospy.loginfo("%s was put at %s", name, place)
        return SetPoseResponse(success=True, message="")

    def _put(self, name: str, pose: Pose2D) -> None:
        engine = self._engine
        if not name or (engine.has_robot and name == engine.robot.description.name):
            engine.carry(pose)
        else:
            engine.population.move_actor(name, [pose], 0.0)

    def _remove_robot(self, _: object) -> TriggerResponse:
        try:
            self.ask(self._engine.remove_robot)
        except PatrolError as err:
            return TriggerResponse(success=False, message=str(err))
        rospy.loginfo("the robot is gone")
        return TriggerResponse(success=True, message="")

    def _spawn_actor(self, request: SpawnActorRequest) -> SpawnActorResponse:
        try:
            name = self.ask(
                lambda: self._engine.population.spawn_actor(
                    request.name, request.model, request.look, _pose(request.pose), posture=request.posture
                )
            )
        except PatrolError as err:
            return SpawnActorResponse(success=False, name=request.name, message=str(err))
        rospy.loginfo("%s '%s' stands at (%.2f, %.2f)", request.model, name, request.pose.x, request.pose.y)
        return SpawnActorResponse(success=True, name=name, message="")

    def _move_actor(self, request: MoveActorRequest) -> MoveActorResponse:
        try:
            self.ask(lambda: self._walk(request))
        except PatrolError as err:
            return MoveActorResponse(success=False, message=str(err))
        return MoveActorResponse(success=True, message="")

    def _walk(self, request: MoveActorRequest) -> None:
        if request.roam:
            if request.path:
                raise WorldError(f"actor '{request.name}'", "walks along a path or wanders, not both")
            self._engine.population.roam_actor(request.name, request.roam, request.speed, pause=request.pause)
            return
        path = [_pose(p) for p in request.path]
        self._engine.population.move_actor(request.name, path, request.speed, request.loop, pause=request.pause)

    def _remove_actor(self, request: RemoveActorRequest) -> RemoveActorResponse:
        try:
            self.ask(lambda: self._engine.population.remove(request.name))
        except PatrolError as err:
            return RemoveActorResponse(success=False, message=str(err))
        rospy.loginfo("'%s' is gone", request.name)
        return RemoveActorResponse(success=True, message="")

    def _spawn_robot(self, request: SpawnRobotRequest) -> SpawnRobotResponse:
        try:
            what = self._spawn_sdf(request) if "<sdf" in request.urdf else self._spawn_urdf(request)
        except PatrolError as err:
            return SpawnRobotResponse(success=False, message=str(err))
        rospy.loginfo("%s '%s' stands at (%.2f, %.2f)", what, request.name, request.pose.x, request.pose.y)
        return SpawnRobotResponse(success=True, message="")

    def _spawn_urdf(self, request: SpawnRobotRequest) -> str:
        source = request.file or f"robot '{request.name}'"
        robot, pose = parse_robot(request.urdf, source=source, find_package=package_finder()), _pose(request.pose)
        drive = self._engine.params.drive
        if (robot.left or drive.left_joints) and (robot.right or drive.right_joints):
            self.ask(lambda: self._engine.spawn_robot(robot, pose))
            return "robot"
        world_from_thing = from_pose2d(pose, request.z)
        thing = replace(robot.body, name=request.name, kind="furniture", static=True, pose=world_from_thing)
        if not thing.visuals and not thing.collisions:
            raise WorldError(source, "has neither wheels to drive by nor any shape")
        self.ask(lambda: self._engine.population.place_thing(thing))
        return "thing"

    def _spawn_sdf(self, request: SpawnRobotRequest) -> str:
        p = request.pose
        found = parse_model(
            request.urdf,
            request.name,
            (p.x, p.y, request.z, 0.0, 0.0, p.theta),
            source=request.file,
            model_path=model_folders(),
            find_package=package_finder(),
        )
        self.ask(lambda: self._place_all(found))
        return "model"

    def _place_all(self, model: World) -> None:
        """Place the parts of a model; if one cannot stand there, none does."""
        population, placed = self._engine.population, []
        try:
            for body in model.bodies:
                population.place_thing(body, "model")
                placed.append(body.name)
        except WorldError:
            for name in placed:
                population.remove_box(name)
            raise
        population.begin(model.actors, model.doors)


def _pose(msg: Any) -> Pose2D:
    return Pose2D(msg.x, msg.y, msg.theta)
