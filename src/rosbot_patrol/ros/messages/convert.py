"""Conversion between messages and plain records, in pairs, without further computation."""

from __future__ import annotations

import math

import numpy as np
import rospy
from geometry_msgs.msg import Pose, PoseStamped, PoseWithCovarianceStamped, Quaternion, TransformStamped, Twist
from nav_msgs.msg import MapMetaData, OccupancyGrid, Odometry, Path
from numpy.typing import NDArray
from sensor_msgs.msg import LaserScan as LaserScanMsg

from rosbot_patrol.amcl.initial_pose import PoseRecord
from rosbot_patrol.errors import MapError
from rosbot_patrol.geometry import Pose2D, Twist2D, quaternion_from_yaw, yaw_from_quaternion
from rosbot_patrol.grid import Grid, GridInfo, occupancy_grid
from rosbot_patrol.scan import LaserScan


def time_to_msg(stamp: float) -> rospy.Time:
    """Convert seconds to a ROS time."""
    return rospy.Time.from_sec(max(stamp, 0.0))


def pose2d_to_pose(pose: Pose2D) -> Pose:
    """A planar pose as geometry_msgs/Pose."""
    msg = Pose()
    msg.position.x, msg.position.y = pose.x, pose.y
    msg.orientation = Quaternion(*quaternion_from_yaw(pose.yaw))
    return msg


def pose2d_from_pose(msg: Pose, what: str = "a pose's orientation") -> Pose2D:
    """The planar part of a pose; ValueError if a value is not finite. `what` names it in the warning of a zero one."""
    if not (math.isfinite(msg.position.x) and math.isfinite(msg.position.y)):
        raise ValueError(f"({msg.position.x}, {msg.position.y}) is no position")
    q = msg.orientation
    return Pose2D(msg.position.x, msg.position.y, yaw_from_quaternion(q.x, q.y, q.z, q.w, what=what))


def pose_to_msg(pose: Pose2D, frame: str, stamp: float) -> PoseStamped:
    """A planar pose with frame and time [s]."""
    msg = PoseStamped()
    msg.header.frame_id, msg.header.stamp = frame, time_to_msg(stamp)
    msg.pose = pose2d_to_pose(pose)
    return msg


def pose_from_msg(msg: PoseStamped) -> tuple[Pose2D, str, float]:
    """Pose, frame (no leading slash), stamp [s]; ValueError as in `pose2d_from_pose`."""
    return pose2d_from_pose(msg.pose), msg.header.frame_id.lstrip("/"), msg.header.stamp.to_sec()


def initial_pose_from_msg(msg: PoseWithCovarianceStamped) -> PoseRecord:
    """A pose with its covariance for amcl; ValueError as in `pose2d_from_pose`."""
    pose = pose2d_from_pose(msg.pose.pose, "the orientation of an initial pose")
    covariance = np.array(msg.pose.covariance, dtype=np.float64).reshape(6, 6)
    return PoseRecord(msg.header.frame_id.lstrip("/"), msg.header.stamp.to_sec(), pose, covariance)


def twist_to_msg(twist: Twist2D) -> Twist:
    """A planar velocity as geometry_msgs/Twist."""
    msg = Twist()
    msg.linear.x, msg.linear.y, msg.angular.z = twist.vx, twist.vy, twist.wz
    return msg


def twist_from_msg(msg: Twist) -> Twist2D:
    """The planar part of a twist."""
    return Twist2D(msg.linear.x, msg.linear.y, msg.angular.z)


def odometry_from_msg(msg: Odometry) -> tuple[Pose2D, Twist2D, float]:
    """Pose, velocity and stamp [s]."""
    pose = pose2d_from_pose(msg.pose.pose, "the odometry's orientation")
    return pose, twist_from_msg(msg.twist.twist), msg.header.stamp.to_sec()


def transform_to_msg(parent_from_child: Pose2D, parent: str, child: str, stamp: float) -> TransformStamped:
    """A planar transform for tf."""
    msg = TransformStamped()
    msg.header.frame_id, msg.header.stamp, msg.child_frame_id = parent, time_to_msg(stamp), child
    msg.transform.translation.x, msg.transform.translation.y = parent_from_child.x, parent_from_child.y
    msg.transform.rotation = Quaternion(*quaternion_from_yaw(parent_from_child.yaw))
    return msg


def scan_to_msg(scan: LaserScan) -> LaserScanMsg:
    """A scan as sensor_msgs/LaserScan."""
    msg = LaserScanMsg()
    msg.header.stamp, msg.header.frame_id = time_to_msg(scan.stamp), scan.frame_id
    msg.angle_min, msg.angle_increment = scan.angle_min, scan.angle_increment
    msg.angle_max = scan.angle_min + scan.angle_increment * max(len(scan.ranges) - 1, 0)
    msg.range_min, msg.range_max = scan.range_min, scan.range_max
    msg.ranges = scan.ranges.astype(np.float32)  # rospy packs numpy arrays without conversion
    return msg


def scan_from_msg(msg: LaserScanMsg) -> LaserScan:
    """A scan as a record; a stamp of 0 means none (NaN)."""
    return LaserScan(
        stamp=msg.header.stamp.to_sec() or math.nan,
        frame_id=msg.header.frame_id.lstrip("/"),
        angle_min=msg.angle_min,
        angle_increment=msg.angle_increment,
        range_min=msg.range_min,
        range_max=msg.range_max,
        ranges=np.array(msg.ranges, dtype=np.float64),
    )


def grid_info_to_msg(info: GridInfo, load_time: float = 0.0) -> MapMetaData:
    """A grid's origin and size as nav_msgs/MapMetaData."""
    msg = MapMetaData()
    msg.map_load_time = time_to_msg(load_time)
    msg.resolution, msg.width, msg.height = info.resolution, info.width, info.height
    msg.origin = pose2d_to_pose(Pose2D(info.origin_x, info.origin_y, info.yaw))
    return msg


def grid_info_from_msg(msg: MapMetaData) -> GridInfo:
    """A grid's origin and size."""
    origin = pose2d_from_pose(msg.origin, "the orientation of a map's origin")
    return GridInfo(
        resolution=float(msg.resolution),
        width=int(msg.width),
        height=int(msg.height),
        origin_x=origin.x,
        origin_y=origin.y,
        yaw=origin.yaw,
    )


def grid_to_msg(grid: Grid, frame: str, stamp: float, load_time: float = 0.0) -> OccupancyGrid:
    """An int8 grid as nav_msgs/OccupancyGrid; publish it through `numpy_msg(OccupancyGrid)`."""
    msg = OccupancyGrid()
    msg.header.frame_id, msg.header.stamp = frame, time_to_msg(stamp)
    msg.info = grid_info_to_msg(grid.info, load_time)
    msg.data = np.ascontiguousarray(grid.cells, dtype=np.int8).ravel()
    return msg


def grid_from_msg(msg: OccupancyGrid, source: str) -> Grid:
    """An occupancy grid as int8 cells (-1 unknown, 0 to 100); subscribe with `numpy_msg(OccupancyGrid)`.

    Args:
        msg: the map.
        source: its topic or service, for the error.

    Raises:
        MapError: its size, origin or resolution is invalid.
    """
    try:
        info = grid_info_from_msg(msg.info)
    except ValueError as err:
        raise MapError(source, f"has an origin that makes no sense: {err}") from err
    return occupancy_grid(info, msg.data, source)


def path_to_msg(poses: NDArray[np.float64], frame: str, stamp: float) -> Path:
    """Poses of shape (N, 3) as nav_msgs/Path."""
    msg = Path()
    msg.header.frame_id, msg.header.stamp = frame, time_to_msg(stamp)
    msg.poses = [pose_to_msg(Pose2D(*row), frame, stamp) for row in poses.tolist()]
    return msg
