"""slam_gmapping: a map of the surroundings and the robot's pose on it, from odometry and a lidar.

Matches slam_gmapping of ROS Noetic (gmapping 1.4): topic `scan` and tf in; `map` and `map_metadata` (latched),
`~entropy` and tf map -> odom out, stamped now + tf_delay, every transform_publish_period; service `dynamic_map`;
parameters in `GmappingParams`. Written from Grisetti, Stachniss, Burgard 2007 and upstream's documentation.

Differs:
- A map's cells lie as its origin says; upstream's are half a cell off.
- Gauss-Newton across the walls refines the search for the best fit, where the pose does not become less likely.
- If a scan fits worse than usual, the surroundings of the odometry's guess are searched: wheels may have slipped.
- The odometry's noise is learned; the parameters are its upper bound, apart from slips.
- The proposal is the Gaussian of match and odometry. The odometry's error grows with the distance between updates, not
  with the number of scans.
- Beams that graze a wall do not erase it within a scan.
- A scan with another number of beams is used; upstream drops it.
- A beam without a return (inf) frees the floor if `maxRange` is at least range_max.
- The entropy is of the weights and comes with each update.
- A saved map can be continued (`map_file`, `initial_pose_x`, `_y`, `_a`).
- A clock that goes back or an odometry jump is a restart, not a motion.
- The parameters llsample* and lasample* are accepted without effect.
"""

from __future__ import annotations

import logging
import math
import threading

import rospy
import tf2_ros
from nav_msgs.msg import MapMetaData
from nav_msgs.srv import GetMapResponse
from rospy.numpy_msg import numpy_msg
from sensor_msgs.msg import LaserScan as LaserScanMsg
from std_msgs.msg import Float64

from rosbot_patrol.gmapping.core import GmappingCore
from rosbot_patrol.gmapping.parameters import GmappingParams
from rosbot_patrol.grid import Grid
from rosbot_patrol.ros.messages.convert import grid_to_msg, scan_from_msg, transform_to_msg
from rosbot_patrol.ros.messages.fast_arrays import GetMapFast, GridMsg
from rosbot_patrol.ros.runtime.diagnostics import ERROR, OK, WARN, Health
from rosbot_patrol.ros.runtime.node import Loop, load_params, run_node
from rosbot_patrol.ros.runtime.scans import ScanQueue, ScanWatch
from rosbot_patrol.ros.runtime.transforms import Transforms

log = logging.getLogger(__name__)


class GmappingNode:
    """The topics, the service and the threads of a GmappingCore.

    Args:
        params: slam_gmapping's parameters.

    Raises:
        MapError: the extent or the saved map is invalid.
    """

    def __init__(self, params: GmappingParams) -> None:
        self._params = params
        self._map_frame = params.map_frame.lstrip("/")
        self._transforms = Transforms()
        self._core = GmappingCore(params, self._transforms)
        self._scans = ScanQueue(self._core.feed)
        self._watch = ScanWatch(self._transforms, self._core.feed.check)
        self._map: GridMsg | None = None
        self._sent_stamp = -math.inf  # stamp of the last transform sent
        self._lock = threading.Lock()  # protects the map message
        self._health = Health()
        self._broadcaster = tf2_ros.TransformBroadcaster()
        self._grid = rospy.Publisher("map", GridMsg, queue_size=1, latch=True)
        self._metadata = rospy.Publisher("map_metadata", MapMetaData, queue_size=1, latch=True)
        self._entropy = rospy.Publisher("~entropy", Float64, queue_size=1, latch=True)
        self._service = rospy.Service("dynamic_map", GetMapFast, self._get_map)
        self._subscriber = rospy.Subscriber(
            "scan", numpy_msg(LaserScanMsg), self._scan, queue_size=5, buff_size=1 << 20
        )

    def run(self) -> None:
        """Run until shutdown."""
        info, p = self._core.slam.maps.info, self._params
        log.info("Mapping %d X %d cells @ %.3f m with %d particles", info.width, info.height, p.delta, p.particles)
        Loop(1.0, self._tell_health, name="health").start()
        if self._params.transform_publish_period > 0.0:
            Loop(1.0 / self._params.transform_publish_period, self._send_transform, name="transform").start()
        while not rospy.is_shutdown():
            placed = self._scans.take()
            if placed is None:
                continue
            step = self._core.step(placed)
            if step.outcome.updated:
                self._entropy.publish(Float64(data=self._core.slam.entropy))
            if step.grid is not None:
                self._publish_map(step.grid, step.stamp)

    # Inputs

    def _scan(self, message: LaserScanMsg) -> None:
        self._watch.hear()
        if self._core.is_wanted():
            self._scans.put(scan_from_msg(message))

    def _get_map(self, _request: object) -> GetMapResponse:
        with self._lock:
            if self._map is None:
                raise rospy.ServiceException("there is no map yet: no scan has been taken in")
            return GetMapFast._response_class(map=self._map)

    # Outputs

    def _publish_map(self, grid: Grid, stamp: float) -> None:
        plain = grid_to_msg(grid, self._map_frame, stamp, load_time=stamp)
        message = GridMsg()
        message.header, message.info, message.data = plain.header, plain.info, plain.data
        with self._lock:
            self._map = message
        self._grid.publish(message)
        self._metadata.publish(message.info)

    def _send_transform(self, current: float) -> None:
        delay = self._params.tf_delay
        stamp = current + (delay if delay >= 0.0 else self._params.transform_publish_period)
        if stamp == self._sent_stamp:  # the clock stood still, and tf warns of repeated stamps
            return
        self._sent_stamp = stamp
        self._broadcaster.sendTransform(
            transform_to_msg(self._core.correction, self._map_frame, self._core.feed.odom, stamp)
        )

    def _tell_health(self, current: float) -> None:
        silence = self._watch.tend(current)
        level, text = (WARN, silence) if silence else self._state()
        maps = self._core.slam.maps
        values = {
            "updates": len(self._core.slam.stamps),
            "scans dropped": self._core.feed.dropped,
            "tiles": maps.tiles_used,
            "map [MB]": f"{maps.megabytes:.1f}",
        }
        self._health.set("", level, text, values)

    def _state(self) -> tuple[int, str]:
        core = self._core
        if core.feed.problem:
            rospy.logwarn_throttle(10.0, f"scans are dropped: {core.feed.problem}")
            return ERROR, f"scans are dropped: {core.feed.problem}"
        if core.slam.map_from_odom is None:
            return WARN, "waiting for the first scan"
        if core.problem:
            return WARN, core.problem
        return OK, "mapping"


def body() -> None:
    """Load, build and run the node."""
    GmappingNode(load_params(GmappingParams)).run()


def main() -> None:
    """Run the program."""
    run_node("slam_gmapping", body)
