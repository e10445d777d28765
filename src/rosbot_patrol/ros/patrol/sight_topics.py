"""Topics of the camera's calibration, of depth images and of the map."""

from __future__ import annotations

import logging
import threading
from collections import deque

import rospy
from nav_msgs.msg import OccupancyGrid
from sensor_msgs.msg import CameraInfo, Image

from rosbot_patrol.errors import MapError
from rosbot_patrol.patrol.senses.depth import KEPT, DepthRing
from rosbot_patrol.patrol.senses.house_map import HouseMap
from rosbot_patrol.patrol.senses.records import LensRecord
from rosbot_patrol.ros.messages.convert import grid_from_msg
from rosbot_patrol.ros.messages.fast_arrays import GridMsg
from rosbot_patrol.ros.messages.senses import image_from_msg, lens_from_msg
from rosbot_patrol.ros.runtime.latest import Latest, drain
from rosbot_patrol.ros.runtime.node import Worker, now

log = logging.getLogger(__name__)


class LensTopic:
    """The lens of a camera, from its first valid camera_info.

    Args:
        topic: topic of the camera_info, "" for none.

    Attributes:
        record: the lens, None before its message.
    """

    def __init__(self, topic: str) -> None:
        self.record: LensRecord | None = None
        self._subscriber = rospy.Subscriber(topic, CameraInfo, self._on_info, queue_size=1) if topic else None

    def _on_info(self, message: CameraInfo) -> None:
        try:
            self.record = lens_from_msg(message)
        except ValueError as err:
            log.warning("%s", err)
            return
        if self._subscriber is not None:
            self._subscriber.unregister()
            self._subscriber = None


class DepthTopic:
    """Depth pictures, subscribed to only while the ring needs them.

    Args:
        topic: topic of the pictures, "" for none.
        info_topic: topic of their camera_info.
        ring: receives them.
    """

    def __init__(self, topic: str, info_topic: str, ring: DepthRing) -> None:
        self._topic, self._ring = topic, ring
        self._lens = LensTopic(info_topic if topic else "")
        self._came: deque[Image] = deque(maxlen=KEPT)
        self._subscriber: rospy.Subscriber | None = None

    @property
    def has_publisher(self) -> bool:
        """Whether depth has a publisher; valid while subscribed."""
        return self._subscriber is not None and self._subscriber.get_num_connections() > 0

    def deliver(self) -> None:
        """Pass the received pictures on."""
        if self._lens.record is not None:
            self._ring.hear_lens(self._lens.record)
        for message in drain(self._came):
            self._ring.hear(image_from_msg(message))

    def follow(self) -> None:
        """Subscribe or unsubscribe, as the ring needs."""
        if self._ring.is_on and self._subscriber is None:
            self._came.clear()
            self._subscriber = rospy.Subscriber(
                self._topic, Image, self._came.append, queue_size=2, buff_size=1 << 23, tcp_nodelay=True
            )
        elif not self._ring.is_on and self._subscriber is not None:
            self._subscriber.unregister()
            self._subscriber = None
            self._came.clear()


class MapTopic:
    """The map, divided into rooms on a thread of its own.

    Args:
        house_map: receives the map.
    """

    def __init__(self, house_map: HouseMap) -> None:
        self._house_map = house_map
        self._maps: Latest[OccupancyGrid] = Latest()
        self._has_map = threading.Event()
        Worker(self._part_maps, name="rooms").start()
        rospy.Subscriber("map", GridMsg, self._on_map, queue_size=1, buff_size=1 << 24)

    def _on_map(self, message: OccupancyGrid) -> None:
        self._maps.set(message, now())
        self._has_map.set()

    def _part_maps(self) -> None:
        while not rospy.is_shutdown():
            self._has_map.wait(1.0)
            self._has_map.clear()
            message = self._maps.take()
            if message is not None:
                self._part(message)

    def _part(self, message: OccupancyGrid) -> None:
        try:
            grid = grid_from_msg(message, rospy.resolve_name("map"))
        except MapError as err:
            self._house_map.refuse(err)
            return
        self._house_map.hear(grid)
