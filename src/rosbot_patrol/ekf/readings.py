"""What sensors say, as records of plain numbers: the filter's inputs."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from rosbot_patrol.ekf.state import Array


@dataclass(frozen=True)
class Frame:
    """Pose of a frame in another one.

    Attributes:
        rotation: shape (3, 3).
        origin: shape (3,) [m].
    """

    rotation: Array = field(default_factory=lambda: np.eye(3))
    origin: Array = field(default_factory=lambda: np.zeros(3))

    def __matmul__(self, other: Frame) -> Frame:
        """The pose of a third frame, given in the second."""
        return Frame(self.rotation @ other.rotation, self.rotation @ other.origin + self.origin)

    @property
    def inverse(self) -> Frame:
        """Pose of the other frame in this one."""
        return Frame(self.rotation.T, -self.rotation.T @ self.origin)


@dataclass(frozen=True)
class PoseReading:
    """A pose in a frame.

    Attributes:
        stamp: [s].
        frame: name, "" for the world frame.
        covariance: of x y z roll pitch yaw, shape (6, 6).
        is_orientation: it comes from an IMU: orientation only, and its frame is the sensor's.
    """

    stamp: float
    frame: str
    pose: Frame
    covariance: Array
    is_orientation: bool = False


@dataclass(frozen=True)
class TwistReading:
    """Velocities in a frame.

    Attributes:
        stamp: [s].
        frame: name, "" for the base.
        linear, angular: [m/s, rad/s], shape (3,).
        covariance: shape (6, 6).
    """

    stamp: float
    frame: str
    linear: Array
    angular: Array
    covariance: Array


@dataclass(frozen=True)
class AccelerationReading:
    """Linear accelerations of an IMU.

    Attributes:
        stamp: [s].
        frame: name, "" for the base.
        linear: [m/s^2], shape (3,).
        covariance: shape (3, 3).
        orientation: of the IMU by its own word, None if it has none.
    """

    stamp: float
    frame: str
    linear: Array
    covariance: Array
    orientation: Array | None = None
