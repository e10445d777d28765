"""One costmap of move_base as a ROS node's part: its update loop and its topics."""

from __future__ import annotations

import logging
import time
from functools import partial

import numpy as np
import rospy
from geometry_msgs.msg import Point32, PolygonStamped
from map_msgs.msg import OccupancyGridUpdate
from nav_msgs.msg import OccupancyGrid
from rospy.numpy_msg import numpy_msg

from rosbot_patrol.costmap.bounds import NOTHING, Bounds
from rosbot_patrol.costmap.costs import occupancy_of
from rosbot_patrol.costmap.fed import Fault, FedCostmap
from rosbot_patrol.costmap.layers.static import StaticLayer
from rosbot_patrol.costmap.params import CostmapParams
from rosbot_patrol.errors import MapError
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.grid import Grid, GridInfo
from rosbot_patrol.ros.messages.convert import grid_from_msg, grid_to_msg, time_to_msg
from rosbot_patrol.ros.move_base.sources import subscribe_inputs
from rosbot_patrol.ros.runtime.logs import LineThrottle
from rosbot_patrol.ros.runtime.node import Loop

log = logging.getLogger(__name__)

_REPEAT_S = 10.0  # between two lines about one problem
_START_GRACE_S = 3.0  # wall time in which a missing transform is no fault


class CostmapNode:
    """The update loop of a costmap and its topics: maps and sensors in, `~<name>/` out.

    Args:
        costmap: the costmap to feed and update.
    """

    def __init__(self, costmap: FedCostmap) -> None:
        self.costmap = costmap
        self._name, self._frame = costmap.name, costmap.frame
        self._born = time.monotonic()
        self._said: Fault | None = None
        self._repeats = LineThrottle(_REPEAT_S)
        self._maps: list[tuple[StaticLayer, rospy.Subscriber]] = []
        self._pending = NOTHING
        self._published_info: GridInfo | None = None
        self._last_published = float("-inf")
        self._listeners = 0
        self._loop = Loop(costmap.params.update_frequency or 1.0, self.update, name=self._name)
        self._advertise()
        self._subscribe()

    # ---- topics

    def _advertise(self) -> None:
        base = f"~{self._name}"
        self._pub_grid = rospy.Publisher(f"{base}/costmap", numpy_msg(OccupancyGrid), queue_size=1, latch=False)
        self._pub_update = rospy.Publisher(f"{base}/costmap_updates", numpy_msg(OccupancyGridUpdate), queue_size=5)
        self._pub_footprint = rospy.Publisher(f"{base}/footprint", PolygonStamped, queue_size=1)

    def _subscribe(self) -> None:
        for layer in self.costmap.map_layers:
            topic = layer.params.map_topic
            on_map = partial(self._on_map, layer)
            subscriber = rospy.Subscriber(topic, numpy_msg(OccupancyGrid), on_map, queue_size=1, buff_size=2**24)
            self._maps.append((layer, subscriber))
            if layer.params.subscribe_to_updates:
                callback = partial(self._on_map_update, layer)
                rospy.Subscriber(f"{topic}_updates", numpy_msg(OccupancyGridUpdate), callback, queue_size=10)
        subscribe_inputs(self.costmap)

    def _on_map(self, layer: StaticLayer, msg: OccupancyGrid) -> None:
        topic = rospy.resolve_name(layer.params.map_topic)
        try:
            grid = grid_from_msg(msg, topic)
            self.costmap.hear_map(layer, grid, msg.header.frame_id.lstrip("/"))
        except MapError as err:
            log.error("%s: a map on %s cannot be used: %s", self._name, topic, err)
            return
        info = grid.info
        log.info("%s: map of %d x %d cells at %.3f m", self._name, info.width, info.height, info.resolution)

    def _on_map_update(self, layer: StaticLayer, msg: OccupancyGridUpdate) -> None:
        size = msg.width * msg.height
        if len(msg.data) != size:
            log.error("%s: a map update of %d cells says that it has %d", self._name, len(msg.data), size)
            return
        cells = np.array(msg.data, dtype=np.int8).reshape(msg.height, msg.width)
        self.costmap.hear_map_update(layer, msg.x, msg.y, cells)

    @property
    def departed_map(self) -> str:
        """Topic of a map that has lost its publisher, "" for none."""
        for layer, subscriber in self._maps:
            if self.costmap.has_map(layer) and subscriber.get_num_connections() == 0:
                return str(subscriber.resolved_name)
        return ""

    # ---- updates

    def start(self) -> None:
        """Start the updates."""
        self._loop.start()

    def configure(self, params: CostmapParams) -> None:
        """Set new parameters; the caller holds the costmap's lock. Raises ParamError."""
        self.costmap.configure(params)
        self._loop.set_rate(params.update_frequency or 1.0)

    def update(self, now: float) -> None:
        """Update once, and publish what is due."""
        if self.costmap.params.update_frequency == 0.0:
            return
        found = self.costmap.update(now)
        if self.costmap.map_problem:
            self._complain(Fault.NO_MAP_POSE, self.costmap.map_problem)
        self._complain(self.costmap.fault, self.costmap.problem)
        if found is None:
            return
        pose, areas = found
        for area in areas:
            self._pending = self._pending.union(area)
        self._show(now, pose)

    def _complain(self, fault: Fault | None, problem: str) -> None:
        """Log a fault when it begins."""
        if fault and self.costmap.updates == 0 and time.monotonic() - self._born < _START_GRACE_S:
            return  # the other nodes are still starting
        if fault and fault is not self._said:
            more = self._repeats.due(fault.name, time.monotonic())
            if more is not None:
                log.warning("%s: %s%s", self._name, problem, more)
        self._said = fault

    # ---- showing

    def _show(self, now: float, pose: Pose2D) -> None:
        frequency = self.costmap.params.publish_frequency
        if frequency <= 0.0 or (now - self._last_published < 0.99 / frequency and now >= self._last_published):
            return
        self._last_published = now
        if self._pub_footprint.get_num_connections():
            self._pub_footprint.publish(self._footprint(pose, now))
        listeners = self._pub_grid.get_num_connections() + self._pub_update.get_num_connections()
        is_new = listeners > self._listeners
        self._listeners = listeners
        if not listeners:
            self._pending = NOTHING
            return
        self._publish_cells(now, whole=is_new)

    def _publish_cells(self, now: float, *, whole: bool) -> None:
        with self.costmap.lock:
            info = self.costmap.costmap.info
            whole = whole or info != self._published_info or self.costmap.params.always_send_full_costmap
            area = Bounds(0, 0, info.width, info.height) if whole else self._pending.clipped(info.width, info.height)
            cells = occupancy_of(self.costmap.costmap.cells[area.y0 : area.y1, area.x0 : area.x1])
            self._pending = NOTHING
        if area.is_empty:
            return
        self._published_info = info
        if whole:
            self._pub_grid.publish(grid_to_msg(Grid(info, cells), self._frame, now))
            return
        update = OccupancyGridUpdate()
        update.header.stamp, update.header.frame_id = time_to_msg(now), self._frame
        update.x, update.y = area.x0, area.y0
        update.width, update.height = area.x1 - area.x0, area.y1 - area.y0
        update.data = np.ascontiguousarray(cells).ravel()
        self._pub_update.publish(update)

    def _footprint(self, pose: Pose2D, now: float) -> PolygonStamped:
        msg = PolygonStamped()
        msg.header.stamp, msg.header.frame_id = time_to_msg(now), self._frame
        msg.polygon.points = [Point32(x, y, 0.0) for x, y in self.costmap.costmap.footprint.at(pose).tolist()]
        return msg
