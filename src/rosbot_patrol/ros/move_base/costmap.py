"""One costmap of move_base on ROS: its map, scans, robot pose, update loop and topics."""

from __future__ import annotations

import logging
import threading
import time
from functools import partial
from pathlib import Path

import numpy as np
import rospy
from geometry_msgs.msg import Point32, PolygonStamped
from map_msgs.msg import OccupancyGridUpdate
from nav_msgs.msg import OccupancyGrid
from rospy.numpy_msg import numpy_msg

from rosbot_patrol.costmap.bounds import NOTHING, Bounds
from rosbot_patrol.costmap.costs import occupancy_of
from rosbot_patrol.costmap.layered import LayeredCostmap
from rosbot_patrol.costmap.layers.keepout import KeepoutLayer
from rosbot_patrol.costmap.layers.static import StaticLayer
from rosbot_patrol.costmap.params import CostmapConfig, CostmapParams
from rosbot_patrol.errors import MapError, TransformError
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.grid import Grid, GridInfo
from rosbot_patrol.maps.map_io import read_map
from rosbot_patrol.ros.messages.convert import grid_from_msg, grid_to_msg, time_to_msg
from rosbot_patrol.ros.move_base.sources import Source, subscribe_sources
from rosbot_patrol.ros.runtime.logs import LineThrottle
from rosbot_patrol.ros.runtime.node import Loop
from rosbot_patrol.ros.runtime.transforms import Transforms

log = logging.getLogger(__name__)

_REPEAT_S = 10.0  # between two lines about one problem
_START_GRACE_S = 3.0  # wall time in which a transform that is not there yet is no fault


class CostmapNode:
    """A LayeredCostmap kept up to date by its own loop, and shown under `~<name>/`.

    Args:
        config: parameters and layers.
        transforms: the node's tf listener.
        name: "global_costmap" or "local_costmap".
        keeps_last: whether `last` is kept: for small costmaps that are looked at in each control cycle.
    """

    def __init__(self, config: CostmapConfig, transforms: Transforms, name: str, *, keeps_last: bool = False) -> None:
        self.name = name
        self.params = config.params
        self.frame = config.params.global_frame.lstrip("/")
        self.base_frame = config.params.robot_base_frame.lstrip("/")
        self.lock = threading.RLock()
        self.costmap = LayeredCostmap(config)
        self._keeps_last = keeps_last
        self._keep_last()
        self.problem = "has not been updated yet"
        self.updates = 0
        self._born = time.monotonic()
        self._transforms = transforms
        self._said: str = ""
        self._repeats = LineThrottle(_REPEAT_S)
        self._sources: list[Source] = []
        self._map_frames: dict[int, str] = {}
        self._map_subscribers: dict[int, rospy.Subscriber] = {}
        self._pending = NOTHING
        self._published_info: GridInfo | None = None
        self._last_published = float("-inf")
        self._listeners = 0
        self._loop = Loop(self.params.update_frequency or 1.0, self.update, name=name)
        self._advertise()
        self._subscribe()

    # ---- topics

    def _advertise(self) -> None:
        base = f"~{self.name}"
        self._pub_grid = rospy.Publisher(f"{base}/costmap", numpy_msg(OccupancyGrid), queue_size=1, latch=False)
        self._pub_update = rospy.Publisher(f"{base}/costmap_updates", numpy_msg(OccupancyGridUpdate), queue_size=5)
        self._pub_footprint = rospy.Publisher(f"{base}/footprint", PolygonStamped, queue_size=1)

    def _subscribe(self) -> None:
        for layer in self.costmap.static_layers:
            if isinstance(layer, KeepoutLayer) and layer.mask_file:
                self._take_mask(layer)
                continue
            topic = layer.params.map_topic
            self._map_subscribers[id(layer)] = rospy.Subscriber(
                topic, numpy_msg(OccupancyGrid), partial(self._on_map, layer), queue_size=1, buff_size=2**24
            )
            if layer.params.subscribe_to_updates:
                callback = partial(self._on_map_update, layer)
                rospy.Subscriber(f"{topic}_updates", numpy_msg(OccupancyGridUpdate), callback, queue_size=10)
        self._sources = subscribe_sources(self.costmap)

    def _take_mask(self, layer: KeepoutLayer) -> None:
        """Read the mask of a keep-out layer; raises MapError, which names the file."""
        grid = read_map(Path(layer.mask_file).expanduser())
        layer.set_map(grid)
        self._map_frames[id(layer)] = layer.mask_frame
        log.info("%s: keep-out mask of %d x %d cells from %s", self.name, *grid.cells.shape[::-1], layer.mask_file)

    def _on_map(self, layer: StaticLayer, msg: OccupancyGrid) -> None:
        topic = rospy.resolve_name(layer.params.map_topic)
        try:
            grid = grid_from_msg(msg, topic)
            with self.lock:
                layer.set_map(grid)
                self._map_frames[id(layer)] = msg.header.frame_id.lstrip("/")
        except MapError as err:
            log.error("%s: a map on %s cannot be used: %s", self.name, topic, err)
            return
        info = grid.info
        log.info("%s: map of %d x %d cells at %.3f m", self.name, info.width, info.height, info.resolution)

    def _on_map_update(self, layer: StaticLayer, msg: OccupancyGridUpdate) -> None:
        if len(msg.data) != msg.width * msg.height:
            log.error(
                "%s: a map update of %d cells says that it has %d", self.name, len(msg.data), msg.width * msg.height
            )
            return
        cells = np.array(msg.data, dtype=np.int8).reshape(msg.height, msg.width)
        with self.lock:
            layer.update_map(msg.x, msg.y, cells)

    @property
    def departed_map(self) -> str:
        """The topic of a map that came from somebody who has gone, empty where there is none."""
        for key in self._map_frames:
            subscriber = self._map_subscribers[key]
            if subscriber.get_num_connections() == 0:
                return str(subscriber.resolved_name)
        return ""

    # ---- pose

    def robot_pose(self, now: float) -> Pose2D:
        """The robot in this costmap's frame.

        Raises:
            TransformError: it is not known, or older than `transform_tolerance`.
        """
        pose, stamp = self._transforms.lookup_stamped(self.frame, self.base_frame)
        age = now - stamp
        if self.params.transform_tolerance > 0.0 and age > self.params.transform_tolerance:
            raise TransformError(self.frame, self.base_frame, f"the newest is {age:.2f} s old")
        return pose

    # ---- updates

    def start(self) -> None:
        """Begin to update."""
        self._loop.start()

    def configure(self, params: CostmapParams) -> None:
        """Take other parameters, `lock` being held; raises ParamError."""
        before = self.costmap.info
        self.costmap.configure(params)
        if self.costmap.info != before:
            self.problem = "has another size and has not been updated yet"
        self._keep_last()
        self.params = params
        self._loop.set_rate(params.update_frequency or 1.0)

    def update(self, now: float) -> None:
        """One update, and what is to be shown; none where `update_frequency` is 0."""
        if self.params.update_frequency == 0.0:
            return
        try:
            pose = self.robot_pose(now)
        except TransformError as err:
            self._complain(str(err))
            return
        with self.lock:
            for source in self._sources:
                source.take(self._transforms, self.frame)
            self._place_maps()
            areas = self.costmap.update(now, pose)
            self._keep_last()
            self.updates += 1
            for area in areas:
                self._pending = self._pending.union(area)
        self._complain("")
        self._show(now, pose)

    def _complain(self, problem: str) -> None:
        self.problem = problem
        kind = problem.split(":")[0]
        if problem and self.updates == 0 and time.monotonic() - self._born < _START_GRACE_S:
            return  # the other nodes are starting too
        more = self._repeats.due(kind, time.monotonic()) if problem and kind != self._said else None
        if more is not None:
            log.warning("%s: %s%s", self.name, problem, more)
        self._said = kind

    def _place_maps(self) -> None:
        for layer in self.costmap.static_layers:
            frame = self._map_frames.get(id(layer), self.frame)
            if frame and frame != self.frame:
                try:
                    layer.master_from_map = self._transforms.lookup(self.frame, frame)
                except TransformError as err:
                    self._complain(str(err))

    def copy(self) -> Grid:
        """Place and costs now; waits for an update that is under way."""
        with self.lock:
            return Grid(self.costmap.info, self.costmap.cells.copy())

    def _keep_last(self) -> None:
        if self._keeps_last:
            self.last = Grid(self.costmap.info, self.costmap.cells.copy())  # nobody changes it, so nobody waits for it

    def is_current(self, now: float) -> bool:
        """Whether what drives by this costmap can trust it."""
        is_blind = any(source.blind(now) for source in self._sources)
        return not self.problem and not is_blind and self.costmap.is_current(now)

    def troubles(self, now: float) -> list[str]:
        """Which inputs are silent or cannot be used."""
        return [f"{self.name}/{text}" for text in (source.trouble(now) for source in self._sources) if text]

    # ---- showing

    def _show(self, now: float, pose: Pose2D) -> None:
        frequency = self.params.publish_frequency
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
        with self.lock:
            info = self.costmap.info
            whole = whole or info != self._published_info or self.params.always_send_full_costmap
            area = Bounds(0, 0, info.width, info.height) if whole else self._pending.clipped(info.width, info.height)
            cells = occupancy_of(self.costmap.cells[area.y0 : area.y1, area.x0 : area.x1])
            self._pending = NOTHING
        if area.is_empty:
            return
        self._published_info = info
        if whole:
            self._pub_grid.publish(grid_to_msg(Grid(info, cells), self.frame, now))
            return
        update = OccupancyGridUpdate()
        update.header.stamp, update.header.frame_id = time_to_msg(now), self.frame
        update.x, update.y = area.x0, area.y0
        update.width, update.height = area.x1 - area.x0, area.y1 - area.y0
        update.data = np.ascontiguousarray(cells).ravel()
        self._pub_update.publish(update)

    def _footprint(self, pose: Pose2D, now: float) -> PolygonStamped:
        msg = PolygonStamped()
        msg.header.stamp, msg.header.frame_id = time_to_msg(now), self.frame
        msg.polygon.points = [Point32(x, y, 0.0) for x, y in self.costmap.footprint.at(pose).tolist()]
        return msg
