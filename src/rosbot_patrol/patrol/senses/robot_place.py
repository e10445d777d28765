"""Present pose of the robot, from the newest transforms, with a maximum age of each.

Odometry comes often; the map's part (amcl's map -> odom) comes with each scan, and a slow amcl may be late. The newest
of both are combined, each with its own maximum age: a localisation that has died gives no pose.
"""

from __future__ import annotations

from rosbot_patrol.errors import TransformError
from rosbot_patrol.geometry import Pose2D, compose
from rosbot_patrol.patrol.senses.params import InputParams
from rosbot_patrol.tf.frames import Frames


class RobotPlace:
    """Heading in odom and pose in the map.

    Args:
        frames: transforms.
        params: names of the frames, and how old their transforms may be.

    Attributes:
        problem: reason why `pose` last gave None, "" if it gave a pose.
    """

    def __init__(self, frames: Frames, params: InputParams) -> None:
        self._frames, self._params = frames, params
        self.problem = ""

    def yaw(self, now: float) -> float | None:
        """Heading of the robot in odom [rad], None if unknown now [s]."""
        try:
            return self._in_odom(now).yaw
        except TransformError:
            return None

    def pose(self, now: float) -> Pose2D | None:
        """Pose of the robot in map, None if unknown now [s]."""
        try:
            found = compose(self.map_from_odom(now), self._in_odom(now))
        except TransformError as err:
            self.problem = str(err)
            return None
        self.problem = ""
        return found

    def map_from_odom(self, now: float) -> Pose2D:
        """Correction map_from_odom for a pose at a time [s]; raises TransformError if it is too old for that."""
        p = self._params
        pose, stamp = self._frames.lookup_stamped(p.map_frame, p.odom_frame)
        age = now - stamp  # amcl post-dates its stamps by transform_tolerance; a static transform has 0
        if stamp and age > p.map_timeout:
            raise TransformError(
                p.map_frame, p.odom_frame, f"the newest is {age:.1f} s old: does the localisation (amcl) still run?"
            )
        return pose

    def _in_odom(self, now: float) -> Pose2D:
        p = self._params
        pose, stamp = self._frames.lookup_stamped(p.odom_frame, p.base_frame)
        if abs(now - stamp) > p.pose_timeout:
            raise TransformError(p.odom_frame, p.base_frame, f"the newest is {now - stamp:.1f} s old")
        return pose
