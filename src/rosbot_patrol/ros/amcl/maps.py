"""Source of amcl's map: the service `static_map`, or the topic `map`."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable

import rospy
from nav_msgs.msg import OccupancyGrid

from rosbot_patrol.amcl.parameters import AmclParams
from rosbot_patrol.errors import MapError
from rosbot_patrol.grid import Grid
from rosbot_patrol.ros.messages.convert import grid_from_msg
from rosbot_patrol.ros.messages.fast_arrays import GetMapFast, GridMsg
from rosbot_patrol.ros.runtime.node import Worker

log = logging.getLogger(__name__)

ASK_AGAIN_S = 0.5


class MapSource:
    """Fetch the map and pass it on.

    Args:
        params: amcl's parameters.
        take: receives a map; raises MapError if it cannot be used.
    """

    def __init__(self, params: AmclParams, take: Callable[[Grid], None]) -> None:
        self._params = params
        self._frame = params.global_frame_id.lstrip("/")
        self._hand_on = take
        self._subscriber: rospy.Subscriber | None = None

    def start(self) -> None:
        """Call the service or subscribe to the topic."""
        if self._params.use_map_topic:
            self._subscriber = rospy.Subscriber("map", GridMsg, self._message, queue_size=1)
        else:
            Worker(self._ask, name="map").start()

    def _ask(self) -> None:
        name = rospy.resolve_name("static_map")
        log.info("Requesting the map from %s", name)
        ask = rospy.ServiceProxy(name, GetMapFast)
        while not rospy.is_shutdown():
            try:
                if self.take(ask().map, name):
                    return
            except rospy.ServiceException as err:
                rospy.logwarn_throttle(10.0, f"no map from {name} yet ({err}), trying again")
            time.sleep(ASK_AGAIN_S)

    def _message(self, message: OccupancyGrid) -> None:
        if self.take(message, rospy.resolve_name("map")) and self._params.first_map_only:
            assert self._subscriber is not None
            self._subscriber.unregister()

    def take(self, message: OccupancyGrid, source: str) -> bool:
        """Take a map; False, with a sentence that names the source, if it cannot be used."""
        frame = message.header.frame_id
        if frame.lstrip("/") != self._frame:
            log.warning(
                "the map of %s is in frame '%s', expected '%s': it is taken for that", source, frame, self._frame
            )
        try:
            grid = grid_from_msg(message, source)
            self._hand_on(grid)
        except MapError as err:
            log.error("the map of %s cannot be used: %s", source, err)
            return False
        info = grid.info
        log.info("Received a %d X %d map @ %.3f m/pix", info.width, info.height, info.resolution)
        if not (grid.cells == 0).any():
            log.warning("the map of %s has no free cell: the robot cannot be anywhere on it", source)
        return True
