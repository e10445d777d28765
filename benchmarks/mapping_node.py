"""CARMEN logs through the node slam_gmapping, by topics: ours, and the C++ original if the package path has it.

Each scan waits until the node has processed the one before, so that neither node loses any, however fast it is. A pose
is the node's map -> odom right after its scan: the best particle's pose at that time, not on the final trajectory.
"""

from __future__ import annotations

import subprocess
import tempfile
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import rospy
from node_cost import megabytes
from numpy.typing import NDArray
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import LaserScan as LaserScanMsg
from tf2_msgs.msg import TFMessage

from rosbot_patrol.geometry import Pose2D, compose, yaw_from_quaternion
from rosbot_patrol.replay.bags.carmen import CarmenLog
from rosbot_patrol.ros.campaign.house import end_group
from rosbot_patrol.ros.messages.convert import scan_to_msg, time_to_msg, transform_to_msg
from rosbot_patrol.scan import LaserScan

Poses = NDArray[np.float64]

EPOCH = 100.0  # the first scan's time [s]
QUIET_S, BUSY_NS = 0.03, 5_000_000  # a node that takes less CPU time [ns] in this period [s] is idle
SPEED = 1.0  # of the robot in a log without times [m/s]
STEP_S, STEPS = 0.06, 3  # clock steps after a scan, so that the node sends its transform
PATIENCE_S = 120.0  # time limit for the node's start, and for one scan


@dataclass(frozen=True)
class Run:
    """Result of a log through a node.

    Attributes:
        poses: the robot's at each scan, shape (N, 3).
        ms: processor time that the node took for a scan, mean, without the time in which it waited.
        mb: peak memory.
    """

    poses: Poses
    ms: float
    mb: float


def cpu_ns(pid: int) -> int:
    """CPU time of all threads of a process."""
    tasks = Path(f"/proc/{pid}/task").glob("*/schedstat")
    return sum(int(task.read_text().split()[0]) for task in tasks)


class Feeder:
    """Clock, odometry and scans for one node, and a listener for its transform."""

    def __init__(self, frame: str) -> None:
        self._frame = frame
        self._clock = rospy.Publisher("/clock", Clock, queue_size=10)
        self._tf = rospy.Publisher("/tf", TFMessage, queue_size=10)
        self._static = rospy.Publisher("/tf_static", TFMessage, queue_size=1, latch=True)
        self._scan = rospy.Publisher("/scan", LaserScanMsg, queue_size=10)
        self._listener = rospy.Subscriber("/tf", TFMessage, self._hear)
        self.correction = Pose2D()
        self._static.publish([transform_to_msg(Pose2D(), "base_link", frame, 0.0)])

    def close(self) -> None:
        """Close all topics."""
        for each in (self._listener, self._clock, self._tf, self._static, self._scan):
            each.unregister()

    def is_heard(self) -> bool:
        """Whether the node has subscribed."""
        return self._scan.get_num_connections() > 0 and self._tf.get_num_connections() > 1

    def _hear(self, message: Any) -> None:
        for each in message.transforms:
            if each.child_frame_id == "odom":
                t, q = each.transform.translation, each.transform.rotation
                self.correction = Pose2D(t.x, t.y, yaw_from_quaternion(q.x, q.y, q.z, q.w))

    def send(self, scan: LaserScan, odometry: Pose2D, stamp: float, pid: int) -> int:
        """Send one scan, and wait until the node has processed it and sent its transform.

        Returns:
            Processor time that the scan took [ns].
        """
        began = cpu_ns(pid)
        self._clock.publish(time_to_msg(stamp))
        self._tf.publish([transform_to_msg(odometry, "odom", "base_link", stamp)])
        self._scan.publish(scan_to_msg(replace(scan, stamp=stamp, frame_id=self._frame)))
        ended = until_done(pid)
        for k in range(STEPS):
            self._clock.publish(time_to_msg(stamp + (k + 1) * STEP_S))
            until_done(pid)
        return ended - began


def until_done(pid: int) -> int:
    """Wait until a node is idle; returns its processor time when it became so [ns]."""
    end = time.monotonic() + PATIENCE_S
    while time.monotonic() < end:
        before = cpu_ns(pid)
        time.sleep(QUIET_S)
        if cpu_ns(pid) - before < BUSY_NS:
            return before
    raise SystemExit(f"process {pid} is not done with a scan after {PATIENCE_S:.0f} s")


def through_node(command: list[str], log: CarmenLog, odometry: Poses, params: dict[str, Any]) -> Run:
    """Run a whole log through a node started for it; this process needs a running master."""
    rospy.set_param("/use_sim_time", True)
    rospy.set_param("/slam_gmapping", params)
    with tempfile.TemporaryFile() as out:
        node = subprocess.Popen([*command, "__name:=slam_gmapping"], stdout=out, stderr=out, start_new_session=True)
        feeder = Feeder(log.scans[0].frame_id or "laser")
        try:
            end = time.monotonic() + PATIENCE_S
            while not feeder.is_heard():
                if node.poll() is not None or time.monotonic() > end:
                    out.seek(0)
                    raise SystemExit(f"{' '.join(command)}: {out.read()[-500:].decode(errors='replace')}")
                time.sleep(0.1)
            until_done(node.pid)
            taken, rows, stamp, first = 0, [], 0.0, log.scans[0].stamp
            ways = np.hypot(*np.diff(odometry[:, :2], axis=0, prepend=odometry[:1, :2]).T)
            for scan, row, way in zip(log.scans, odometry, ways, strict=True):
                # a log without times must not look as if the robot flew
                stamp = max(stamp + max(STEP_S * (STEPS + 1), way / SPEED), EPOCH + scan.stamp - first)
                taken += feeder.send(scan, Pose2D(*row), stamp, node.pid)
                rows.append(compose(feeder.correction, Pose2D(*row)))
            return Run(np.array(rows), 1e-6 * taken / len(rows), megabytes(node.pid, "VmHWM"))
        finally:
            feeder.close()
            end_group(node)
