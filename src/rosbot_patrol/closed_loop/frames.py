"""Transforms of a closed loop, as robot_state_publisher, base and amcl would publish them."""

from __future__ import annotations

from rosbot_patrol.geometry import Pose2D, quaternion_from_yaw
from rosbot_patrol.simulation.robot.description import Mount, RobotDescription
from rosbot_patrol.simulation.scene.matrices import to_quaternion
from rosbot_patrol.tf.tree import Edge, TransformTree

MAP, ODOM, BASE = "map", "odom", "base_link"


def tree_of(robot: RobotDescription) -> TransformTree:
    """Tree with the robot's sensors on its base."""
    tree = TransformTree()
    mounts = [*robot.ranges, *(mount for mount in (robot.laser, robot.camera) if mount is not None)]
    tree.add_all((_edge_of(mount) for mount in mounts), is_static=True)
    return tree


def add_pose(tree: TransformTree, parent: str, child: str, pose: Pose2D, stamp: float) -> None:
    """Add the pose of a frame in another at a time [s]; a second pose for the same time is ignored."""
    tree.add(Edge(parent, child, stamp, pose.x, pose.y, 0.0, *quaternion_from_yaw(pose.yaw)))


def _edge_of(mount: Mount) -> Edge:
    x, y, z = mount.pose[:3, 3].tolist()
    return Edge(BASE, mount.frame, 0.0, x, y, z, *to_quaternion(mount.pose))
