"""Door services of the simulator: ~spawn_door and ~set_door."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import rospy

from rosbot_patrol.errors import PatrolError
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.simulation.actors.doors import SPEED, SWING, plain_door
from rosbot_patrol.simulation.engine import Engine
from rosbot_patrol.srv import (
    SetDoor,
    SetDoorRequest,
    SetDoorResponse,
    SpawnDoor,
    SpawnDoorRequest,
    SpawnDoorResponse,
)

_WIDTH, _HEIGHT = 0.9, 2.0  # default size of a door [m]


class DoorServices:
    """The services ~spawn_door and ~set_door.

    Args:
        engine: engine with the doors.
        ask: runs an action on the simulation's thread, returns its result or raises its PatrolError.
    """

    def __init__(self, engine: Engine, ask: Callable[[Callable[[], Any]], Any]) -> None:
        self._engine = engine
        self._ask = ask
        rospy.Service("~spawn_door", SpawnDoor, self._spawn)
        rospy.Service("~set_door", SetDoor, self._set)

    def _spawn(self, request: SpawnDoorRequest) -> SpawnDoorResponse:
        hinge = Pose2D(request.hinge.x, request.hinge.y, request.hinge.theta)
        sizes = {"width": request.width or _WIDTH, "height": request.height or _HEIGHT}
        try:
            place = plain_door(request.name, hinge, **sizes, swing=request.swing or SWING)
            self._ask(lambda: self._engine.population.spawn_door(place))
        except PatrolError as err:
            return SpawnDoorResponse(success=False, message=str(err))
        rospy.loginfo("door '%s' hangs at (%.2f, %.2f)", request.name, hinge.x, hinge.y)
        return SpawnDoorResponse(success=True, message="")

    def _set(self, request: SetDoorRequest) -> SetDoorResponse:
        speed = 0.0 if request.at_once else request.speed or SPEED
        try:
            self._ask(lambda: self._engine.population.set_door(request.name, request.opening, speed))
        except PatrolError as err:
            return SetDoorResponse(success=False, message=str(err))
        rospy.loginfo("door '%s' goes to %.0f %% open", request.name, 100.0 * request.opening)
        return SetDoorResponse(success=True, message="")
