"""The rooms that wait for a mission: which calls get on the list, and which leave it without a look."""

from __future__ import annotations

import logging
from collections.abc import Collection, Iterable, Sequence

from rosbot_patrol.patrol.calls.call_filter import CallFilter, Taken
from rosbot_patrol.patrol.calls.own_motion import OwnMotion
from rosbot_patrol.patrol.calls.queue import MissionQueue
from rosbot_patrol.patrol.house.regions import RoomRegions
from rosbot_patrol.patrol.house.rooms import Rooms
from rosbot_patrol.patrol.intruder.lidar_motion import LidarTrack
from rosbot_patrol.patrol.mission.params import ManagerParams
from rosbot_patrol.patrol.records.inputs import Inputs
from rosbot_patrol.patrol.records.mission import Mission, Verdict
from rosbot_patrol.patrol.records.request import Origin, Request

log = logging.getLogger(__name__)


class Agenda:
    """Takes calls and requests, and hands out one mission after the other.

    Args:
        rooms: of the points file.
        params: priorities, and how far the robot sets off sensors itself.
        count: missions before a restart.
        waiting: requests that waited before a restart.

    Attributes:
        queue: what waits.
    """

    def __init__(self, rooms: Rooms, params: ManagerParams, *, count: int = 0, waiting: Iterable[Request] = ()) -> None:
        self.queue = MissionQueue()
        self._rooms = rooms
        self._own_motion = OwnMotion(params.own_motion_radius, params.own_motion_memory)
        self._calls = CallFilter(rooms, self.queue, params.priorities, self._own_motion)
        self._calls.count = count
        for request in waiting:
            self.queue.add(request)

    @property
    def count(self) -> int:
        """Missions so far."""
        return self._calls.count

    def see_robot(self, now: float, inputs: Inputs, *, is_awake: bool) -> None:
        """Note where the robot is: sensors that it passes call, too.

        Args:
            now: steady time [s].
            inputs: of this step.
            is_awake: detector and camera speak.
        """
        self._own_motion.see(now, inputs.pose, awake=is_awake)

    def see_motion(self, now: float, tracks: Iterable[LidarTrack], house: RoomRegions | None) -> None:
        """Note in which rooms something moves: these go first.

        Args:
            now: steady time [s].
            tracks: what the lidar follows.
            house: the rooms on the map.
        """
        unrest = self._calls.unrest
        for track in tracks:
            if house is not None and track.has_moved:
                unrest.move(house.room_at(track.x, track.y), now)
        self.queue.stirring = unrest.stirring(now)

    def take(self, now: float, inputs: Inputs, mission: Mission | None, *, has_candidate: bool) -> Taken:
        """Take a step's calls; arguments as of `CallFilter.take`."""
        return self._calls.take(now, inputs, mission, has_candidate=has_candidate)

    def ask(self, requests: Sequence[Request], wall: float, mission: Mission | None) -> dict[int, str]:
        """Queue requests; the id of the mission that answers each room, "" if the room is refused."""
        return self._calls.ask(requests, wall, mission)

    def next_mission(self, wall: float) -> Mission:
        """Take the most urgent request off the list; `wall` in seconds since 1970."""
        return self._mission_of(self.queue.pop(), wall)

    def put_back(self, mission: Mission) -> None:
        """Put a mission that has begun before all others of its priority."""
        self.queue.put_back(
            Request(
                room_id=mission.room.id,
                origin=mission.origin,
                note=mission.note,
                wall=mission.called,
                priority=mission.priority,
                id=mission.id,
                triggers=mission.triggers,
                times=mission.times,
            )
        )

    def drop_called_before(self, wall: float) -> list[Request]:
        """Take off what was called for before a moment [s since 1970]."""
        return self._drop(request for request in self.queue if request.wall < wall)

    def drop_asked(self, missions: Collection[str]) -> list[Request]:
        """Take off missions that a program asked for, by id; those that a sensor calls for, too, stay."""
        asked = (r for r in self.queue if r.id in missions and r.origin is Origin.ACTION)
        return self._drop(asked)

    def give_up(self, requests: Iterable[Request], why: str, wall: float) -> list[Mission]:
        """The unverified missions of requests that are not followed."""
        missions = []
        for request in requests:
            mission = self._mission_of(request, wall)
            mission.verdict, mission.reason = Verdict.UNVERIFIED, f"{mission.room.title} was not looked at: {why}"
            log.warning("%s", mission.reason)
            missions.append(mission)
        return missions

    def _drop(self, requests: Iterable[Request]) -> list[Request]:
        dropped = list(requests)
        for request in dropped:
            self.queue.remove(request)
        return dropped

    def _mission_of(self, request: Request, wall: float) -> Mission:
        room = self._rooms.get(request.room_id)
        waited = max(wall - request.wall, 0.0)
        return Mission(
            id=request.id,
            room=room,
            origin=request.origin,
            priority=request.priority,
            called=request.wall,
            note=request.note,
            wall=wall,
            triggers=request.triggers,
            times={"waiting": waited, **{name: s for name, s in request.times.items() if name != "waiting"}},
            began={"waiting": request.wall},
        )
