"""amcl: where the robot is on the map, by a particle filter on odometry and a lidar.

Matches amcl of ROS Noetic's navigation 1.17: topics `scan`, `initialpose`, `map` (with `~use_map_topic`) in,
`amcl_pose` and `particlecloud` (latched), `/diagnostics` and tf map -> odom out; services `global_localization`,
`request_nomotion_update`, `set_map`; the map from the service `static_map`; parameters in `AmclParams`, with the pose
saved to them for a respawn. Written from Probabilistic Robotics and upstream's documentation.

Differs: within the best cluster particles that fit the newest scan count for more, where upstream takes the plain
mean: with the tutorial's few updates that is 5 cm off instead of 25. All particles in one bin ask for the fewest
particles, upstream's rule then asks for the most. The averages behind the recovery are of a beam's fit, so that more
or fewer beams are no cause for random poses. Draws follow an even sequence instead of independent numbers. A new map
keeps the pose that the filter has. A pose that was saved in another run of a simulation is not taken. An odometry that
jumps or a clock that goes back is a restart, not a motion. A turned map is refused with a sentence. No
dynamic_reconfigure.
"""

from __future__ import annotations

import logging
import math
import threading
import time

import numpy as np
import rospy
import tf2_ros
from geometry_msgs.msg import PoseArray, PoseWithCovarianceStamped
from nav_msgs.msg import OccupancyGrid
from nav_msgs.srv import SetMapRequest, SetMapResponse
from rospy.numpy_msg import numpy_msg
from sensor_msgs.msg import LaserScan as LaserScanMsg
from std_srvs.srv import Empty, EmptyResponse

from rosbot_patrol.amcl.localizer import Localizer, Outcome, scan_problem, start_of
from rosbot_patrol.amcl.parameters import AmclParams
from rosbot_patrol.errors import MapError, TransformError
from rosbot_patrol.geometry import Pose2D, compose, invert
from rosbot_patrol.ros.convert import (
    grid_from_msg,
    pose2d_from_pose,
    pose2d_to_pose,
    scan_from_msg,
    time_to_msg,
    transform_to_msg,
)
from rosbot_patrol.ros.diagnostics import ERROR, OK, WARN, Health
from rosbot_patrol.ros.grids import GetMapFast, GridMsg, SetMapFast
from rosbot_patrol.ros.node import Loop, Worker, load_params, now, run_node
from rosbot_patrol.ros.pose_arrays import pose_array_to_msg
from rosbot_patrol.ros.priority import Priority
from rosbot_patrol.ros.saved_pose import SavedPose
from rosbot_patrol.ros.scan_queue import PlacedScan, ScanQueue
from rosbot_patrol.ros.transforms import Transforms

log = logging.getLogger(__name__)

SILENT_S = 15.0  # as upstream: a lidar that says nothing for so long is warned of
ASK_AGAIN_S = 0.5


class AmclNode:
    """The edge of a Localizer.

    Args:
        params: of amcl.
    """

    def __init__(self, params: AmclParams) -> None:
        self._params = params
        self._global = params.global_frame_id.lstrip("/")
        self._odom = params.odom_frame_id.lstrip("/")
        self._base = params.base_frame_id.lstrip("/")
        self._lock = threading.Lock()  # of the localizer
        self._localizer = Localizer(params, np.random.default_rng())
        self._transforms = Transforms()
        self._scans = ScanQueue(self._transforms, self._odom, self._base)
        self._last_scan = now()
        self._last_time = now()
        self._last_cloud = -math.inf
        self._odom_from_base: Pose2D | None = None
        self._stamp = -math.inf  # of the newest scan taken in
        self._was_placed = False  # by initialpose, set_map or global_localization
        self._saved = SavedPose()
        self._is_first = True
        self._health = Health()
        self._broadcaster = tf2_ros.TransformBroadcaster()
        self._pose = rospy.Publisher("amcl_pose", PoseWithCovarianceStamped, queue_size=2, latch=True)
        self._cloud = rospy.Publisher("particlecloud", PoseArray, queue_size=2, latch=True)
        self._services = [
            rospy.Service("global_localization", Empty, self._localize_globally),
            rospy.Service("request_nomotion_update", Empty, self._request_update),
            rospy.Service("set_map", SetMapFast, self._set_map),
        ]
        self._map_subscriber: rospy.Subscriber | None = None
        self._subscribers = [
            rospy.Subscriber("initialpose", PoseWithCovarianceStamped, self._initial_pose, queue_size=2),
            rospy.Subscriber("scan", numpy_msg(LaserScanMsg), self._scan, queue_size=100, buff_size=1 << 20),
        ]

    def run(self) -> None:
        """Work until shutdown."""
        rospy.on_shutdown(self._save_pose)
        if self._params.use_map_topic:
            self._map_subscriber = rospy.Subscriber("map", GridMsg, self._map_message, queue_size=1)
        else:
            Worker(self._ask_for_map, name="map").start()
        Loop(1.0, self._tell_health, name="health").start()
        if self._params.save_pose_rate > 0.0:
            Loop(self._params.save_pose_rate, lambda _: self._save_pose(), name="save").start()
        while not rospy.is_shutdown():
            placed = self._scans.take()
            if placed is not None:
                self._step(placed)

    # Inputs

    def _scan(self, message: LaserScanMsg) -> None:
        scan = scan_from_msg(message)
        self._last_scan = now()
        problem = scan_problem(scan)
        if problem:
            rospy.logwarn_throttle(10.0, f"scan of frame '{scan.frame_id}': {problem}; it is left out")
            return
        self._scans.put(scan)

    def _ask_for_map(self) -> None:
        name = rospy.resolve_name("static_map")
        log.info("Requesting the map from %s", name)
        ask = rospy.ServiceProxy(name, GetMapFast)
        while not rospy.is_shutdown():
            try:
                if self._take_map(ask().map, name):
                    return
            except rospy.ServiceException as err:
                rospy.logwarn_throttle(10.0, f"no map from {name} yet ({err}), trying again")
            time.sleep(ASK_AGAIN_S)

    def _map_message(self, message: OccupancyGrid) -> None:
        if self._take_map(message, rospy.resolve_name("map")) and self._params.first_map_only:
            assert self._map_subscriber is not None
            self._map_subscriber.unregister()

    def _take_map(self, message: OccupancyGrid, source: str) -> bool:
        if message.header.frame_id.lstrip("/") != self._global:
            log.warning(
                "the map of %s is in frame '%s', expected '%s': it is taken for that",
                source,
                message.header.frame_id,
                self._global,
            )
        try:
            grid = grid_from_msg(message)
            with self._lock:
                self._localizer.set_map(grid)
        except (MapError, ValueError) as err:
            log.error("the map of %s cannot be used: %s", source, err)
            return False
        info = grid.info
        log.info("Received a %d X %d map @ %.3f m/pix", info.width, info.height, info.resolution)
        if not (grid.cells == 0).any():
            log.warning("the map of %s has no free cell: the robot cannot be anywhere on it", source)
        return True

    def _set_map(self, request: SetMapRequest) -> SetMapResponse:
        taken = self._take_map(request.map, "set_map")
        if taken:
            self._initial_pose(request.initial_pose)
            if self._params.force_update_after_set_map:
                self._request_update(None)
        return SetMapResponse(success=taken)

    def _initial_pose(self, message: PoseWithCovarianceStamped) -> None:
        frame = message.header.frame_id.lstrip("/")
        if not frame:
            log.warning("received an initial pose without a frame, it is taken as in '%s'", self._global)
        elif frame != self._global:
            log.warning("initial pose in frame '%s' is ignored, expected frame '%s'", frame, self._global)
            return
        covariance = np.array(message.pose.covariance).reshape(6, 6)[np.ix_([0, 1, 5], [0, 1, 5])]
        try:
            pose = pose2d_from_pose(message.pose.pose)
            if not np.isfinite(covariance).all():
                raise ValueError("its covariance is not finite")
        except ValueError as err:
            log.warning("initial pose is ignored: %s", err)
            return
        pose = compose(pose, self._motion_since(message.header.stamp.to_sec()))
        log.info("Setting pose (%.6f): %.3f %.3f %.3f", now(), pose.x, pose.y, pose.yaw)
        covariance[2, :2] = covariance[:2, 2] = 0.0  # as upstream
        with self._lock:
            self._was_placed = True
            self._localizer.set_pose(pose, covariance)
            if self._params.force_update_after_initialpose:
                self._localizer.request_update()

    def _motion_since(self, stamp: float) -> Pose2D:
        """How the robot moved since a pose was clicked."""
        try:
            then = self._transforms.lookup(self._odom, self._base, stamp if stamp > 0.0 else None)
            newest = self._transforms.lookup(self._odom, self._base)
        except TransformError as err:
            if stamp > 0.0:
                log.warning("the motion since the initial pose's stamp is not known, taken as none: %s", err)
            return Pose2D()
        return compose(invert(then), newest)

    def _localize_globally(self, _request: object) -> EmptyResponse:
        with self._lock:
            started = self._was_placed = self._localizer.localize_globally()
        if started:
            log.info("Initializing with uniform distribution")
        else:
            log.error("global_localization: there is no map with free floor yet")
        return EmptyResponse()

    def _request_update(self, _request: object) -> EmptyResponse:
        with self._lock:
            self._localizer.request_update()
        return EmptyResponse()

    # Step and outputs

    def _step(self, placed: PlacedScan) -> None:
        scan = placed.scan
        if self._is_first:
            self._is_first = False
            self._forget_other_runs(scan.stamp)
        with self._lock:
            outcome = self._localizer.update(scan, placed.odom_from_base, placed.mount)
            correction = self._localizer.map_from_odom
            poses = self._localizer.filter.poses
            self._odom_from_base, self._stamp = placed.odom_from_base, scan.stamp
        if correction is not None and self._params.tf_broadcast:
            stamp = scan.stamp + self._params.transform_tolerance
            self._broadcaster.sendTransform(transform_to_msg(correction, self._global, self._odom, stamp))
        if outcome.is_blind:
            rospy.logwarn_throttle(
                10.0, f"no beam of the scan of frame '{scan.frame_id}' measured anything: only the odometry is followed"
            )
        self._publish(outcome, poses, scan.stamp)

    def _forget_other_runs(self, stamp: float) -> None:
        own = self._saved.own(self._params, stamp)
        if own is not None and not self._was_placed:
            with self._lock:
                self._localizer.set_pose(*start_of(own))

    def _publish(self, outcome: Outcome, poses: np.ndarray, stamp: float) -> None:
        if outcome.estimate is not None:
            message = PoseWithCovarianceStamped()
            message.header.frame_id, message.header.stamp = self._global, time_to_msg(stamp)
            message.pose.pose = pose2d_to_pose(outcome.estimate.pose)
            covariance = np.zeros((6, 6))
            covariance[np.ix_([0, 1], [0, 1])] = outcome.estimate.covariance[:2, :2]
            covariance[5, 5] = outcome.estimate.covariance[2, 2]
            message.pose.covariance = covariance.ravel().tolist()
            self._pose.publish(message)
        rate = self._params.gui_publish_rate
        due = rate <= 0.0 or not 0.0 <= stamp - self._last_cloud < 1.0 / rate
        if outcome.updated and due:
            self._last_cloud = stamp
            self._cloud.publish(pose_array_to_msg(poses, self._global, stamp))

    def _save_pose(self) -> None:
        with self._lock:
            correction, estimate = self._localizer.map_from_odom, self._localizer.estimate
            odometry, stamp = self._odom_from_base, self._stamp
        if correction is None or estimate is None or odometry is None:
            return
        pose = compose(correction, odometry)
        values = (*pose, *(float(v) for v in np.diag(estimate.covariance)))
        try:
            self._saved.save(values, stamp)
        except (OSError, rospy.ROSException) as err:
            rospy.logwarn_throttle(30.0, f"the pose cannot be saved on the parameter server: {err}")

    def _tell_health(self, current: float) -> None:
        if current < self._last_time - 1.0:
            log.warning("time went back by %.1f s: old transforms are forgotten", self._last_time - current)
            self._transforms.buffer.clear()
        if abs(current - self._last_time) > SILENT_S:  # the clock was set, nobody was silent for so long
            self._last_scan = current
        self._last_time = current
        level, message = self._state(current)
        values: dict[str, object] = {"scans dropped": self._scans.dropped}
        estimate = self._localizer.estimate
        if estimate is not None:
            std = np.sqrt(np.maximum(np.diag(estimate.covariance), 0.0))
            values |= {
                "std_x": f"{std[0]:.3f}",
                "std_y": f"{std[1]:.3f}",
                "std_yaw": f"{std[2]:.3f}",
                "particles": estimate.particles,
                "best cluster": f"{estimate.cluster_weight:.2f}",
            }
            p = self._params
            if level == OK and (std > [p.std_warn_level_x, p.std_warn_level_y, p.std_warn_level_yaw]).any():
                level, message = WARN, "the pose is not sure: the particles are spread widely"
        self._health.set("Standard deviation", level, message, values)

    def _state(self, current: float) -> tuple[int, str]:
        silent = current - self._last_scan
        if silent > SILENT_S:
            topic = rospy.resolve_name("scan")
            text = f"no laser scan received on {topic} for {silent:.0f} seconds: no pose is published"
            rospy.logwarn_throttle(SILENT_S, text[0].upper() + text[1:])
            return WARN, text
        if not self._localizer.has_map:
            return ERROR, "there is no map yet"
        if self._scans.problem:
            rospy.logwarn_throttle(10.0, f"scans are dropped: {self._scans.problem}")
            return ERROR, f"scans are dropped: {self._scans.problem}"
        if self._localizer.map_from_odom is None:
            return WARN, "waiting for the first scan"
        return OK, "localised"


def body() -> None:
    """Load, build, run."""
    AmclNode(load_params(AmclParams)).run()


def main() -> None:
    """The program."""
    run_node("amcl", body, priority=Priority.CONTROL)
