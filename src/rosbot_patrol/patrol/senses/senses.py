"""The patrol's inputs: what arrives is heard, and each step takes what is known.

One thread hears and takes; a node keeps what its callbacks got until its step. Only `house_map` may be fed by another.
"""

from __future__ import annotations

import logging
from collections.abc import Iterable
from dataclasses import replace

from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.maps.zones import Zone
from rosbot_patrol.patrol.house.rooms import Rooms
from rosbot_patrol.patrol.records.inputs import Battery, Frame, Guarded, Inputs
from rosbot_patrol.patrol.records.request import Request
from rosbot_patrol.patrol.senses.camera import Camera
from rosbot_patrol.patrol.senses.depth import DepthRing
from rosbot_patrol.patrol.senses.health import OK, WARN, Health
from rosbot_patrol.patrol.senses.house_map import HouseMap
from rosbot_patrol.patrol.senses.lidar import Lidar
from rosbot_patrol.patrol.senses.params import EyesTopics, InputParams
from rosbot_patrol.patrol.senses.records import BoxesRecord, CountRecord, Moment
from rosbot_patrol.patrol.senses.robot_place import RobotPlace
from rosbot_patrol.tf.frames import Frames

log = logging.getLogger(__name__)


class PatrolSenses:
    """Turns what arrives into the inputs of a step.

    Args:
        params: frames and time-outs.
        eyes: heights and distances; its `depth_topic` is empty if there is no depth camera.
        transforms: of the robot.
        rooms: of the points file.
        alarm_classes: boxes of other classes are not measured.
        health: told how the senses are.
        zones: that the robot keeps out of.

    Attributes:
        lidar, depth, camera, house_map: hear scans; depth pictures; lens and boxes; maps.
    """

    def __init__(
        self,
        params: InputParams,
        eyes: EyesTopics,
        transforms: Frames,
        *,
        rooms: Rooms,
        alarm_classes: Iterable[str],
        health: Health,
        zones: tuple[Zone, ...] = (),
    ) -> None:
        self._health = health
        self._place = RobotPlace(transforms, params)
        self.lidar = Lidar(params, transforms, health)
        self.depth = DepthRing(eyes.depth_topic, health)
        self.house_map = HouseMap(rooms, health, zones)
        self.camera = Camera(
            eyes,
            params,
            transforms,
            place=self._place,
            alarm_classes=alarm_classes,
            lidar=self.lidar,
            depth=self.depth,
            house_map=self.house_map,
        )
        self._is_lost: bool | None = None
        self._calls: list[int] = []
        self._requests: list[Request] = []
        self._battery: Battery | None = None
        self._detector_at = float("-inf")

    # -- what arrives

    def hear_call(self, room: int) -> None:
        """Take a call of a room's motion sensor."""
        self._calls.append(room)

    def ask(self, request: Request | None) -> None:
        """Take a request from elsewhere, if there is one."""
        if request is not None:
            self._requests.append(request)

    def hear_detector(self, record: BoxesRecord | CountRecord, moment: Moment) -> None:
        """Take what the detector said of a picture; boxes and their count both come, and only one of them counts."""
        self._detector_at = moment.now
        if isinstance(record, CountRecord):
            if record.objects == 0:  # other counts come with their boxes
                self.camera.hear(Frame(), record.stamp, moment.steady)
        elif record.boxes:  # the count says so if there are none
            stamp = record.stamp or moment.now
            self.camera.hear(Frame(stamp=stamp, boxes=record.boxes), stamp, moment.steady)

    def hear_battery(self, battery: Battery, now: float) -> None:
        """Take what the battery said at a time [s]."""
        self._battery = replace(battery, at=now)

    # -- what a step takes

    def take(
        self, moment: Moment, guarded: Guarded, stop: str, *, is_busy: bool, has_depth_publisher: bool = True
    ) -> Inputs:
        """Take what is known now, and what was heard since the last step; links and pictures are left to the caller.

        Args:
            moment: of the step.
            guarded: what is armed.
            stop: why the emergency stop holds the robot, "" if it does not.
            is_busy: a mission runs, so that scans and pictures are looked at.
            has_depth_publisher: somebody publishes depth.
        """
        now = moment.now
        scan = self.lidar.usable(now) if is_busy else None
        view = self.lidar.place(scan, now)
        self.depth.tend(moment.steady, is_over=not is_busy, has_publisher=has_depth_publisher)
        if not is_busy:
            self.lidar.rest()
        calls, self._calls = tuple(self._calls), []
        requests, self._requests = tuple(self._requests), []
        return Inputs(
            wall=moment.wall,
            triggers=calls,
            requests=requests,
            frames=self.camera.take(moment.steady, is_busy=is_busy),
            yaw=self._place.yaw(now),
            pose=self._pose(now),
            clearance=self.lidar.clearance(scan, now),
            scan=view,
            house=self.house_map.house,
            detector_at=self._detector_at,
            battery=self._battery,
            guarded=guarded,
            stop=stop,
        )

    def _pose(self, now: float) -> Pose2D | None:
        pose = self._place.pose(now)
        if (pose is None) != self._is_lost or self._is_lost is None:
            self._is_lost = pose is None
            level, text = (WARN, self._place.problem) if pose is None else (OK, "the robot's pose is known")
            self._health.set("pose", level, text)
            (log.warning if pose is None else log.info)("%s", text)
        return pose
