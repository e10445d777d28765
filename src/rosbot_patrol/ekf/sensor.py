"""One sensor of the filter: its readings as measurements of the state.

Each part (pose, twist, acceleration) is turned into the frame of the state, with its covariance and the mask of what is
configured. `relative` counts poses from the first. `differential` makes velocities of the change from pose to pose.

Source: behaviour of robot_localization 2.7 (Noetic), `ros_filter.cpp`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.ekf.filter import Measurement
from rosbot_patrol.ekf.readings import AccelerationReading, Frame, PoseReading, TwistReading
from rosbot_patrol.ekf.state import (
    ACCELERATION,
    OFF_THE_PLANE,
    ORIENTATION,
    POSE,
    SIZE,
    TURNING,
    TWIST,
    Array,
    angles,
    rotation,
    wrap,
)

Mask = NDArray[np.bool_]
Lookup = Callable[[str, str, float], Frame]  # (target, source, stamp): pose of source in target; raises TransformError

_SHORTEST = 1e-6  # a row of a rotated mask that is no shorter counts
_PLANAR_VARIANCE = 1e-6


@dataclass(frozen=True, kw_only=True)
class SensorConfig:
    """How a sensor is used.

    Attributes:
        topic: name of the sensor, such as odom0.
        mask: what counts of it, 15 values.
        is_differential, is_relative: see the module.
        pose_threshold, twist_threshold, acceleration_threshold: Mahalanobis distances that reject.
        removes_gravity: the accelerometer measures it, too.
    """

    topic: str
    mask: Mask
    is_differential: bool = False
    is_relative: bool = False
    pose_threshold: float = math.inf
    twist_threshold: float = math.inf
    acceleration_threshold: float = math.inf
    removes_gravity: bool = False


@dataclass(frozen=True, kw_only=True)
class Surroundings:
    """What all sensors share.

    Attributes:
        world, base: names of frames.
        lookup: poses of frames.
        is_planar: the robot stays on a plane.
        gravity: [m/s^2].
    """

    world: str
    base: str
    lookup: Lookup
    is_planar: bool
    gravity: float


class Motion(Protocol):
    """What the filter knows at present."""

    @property
    def state(self) -> Array:
        """Shape (15,)."""

    @property
    def turning_rate(self) -> Array:
        """Change of the turning speeds [rad/s^2], shape (3,)."""


class Sensor:
    """One sensor, with its first and its last pose.

    Args:
        config: how it is used.
        around: what all sensors share.
        motion: of the robot, by the filter.
    """

    def __init__(self, config: SensorConfig, around: Surroundings, motion: Motion) -> None:
        self.config = config
        self._around = around
        self._motion = motion
        self._first: Frame | None = None
        self._last: tuple[float, Frame, Array] | None = None

    def forget(self) -> None:
        """Begin anew: the next pose is the first."""
        self._first = self._last = None

    def pose(self, reading: PoseReading) -> Measurement | None:
        """A measurement of the pose; with `differential` of the velocities, None for the first.

        Raises:
            TransformError: the reading's frame is not known.
        """
        config, around = self.config, self._around
        mask = config.mask[POSE]
        if not mask.any():
            return None
        if reading.is_orientation:
            pose, covariance, mask = self._orientation(reading, mask)
        else:
            frame = around.lookup(around.world, reading.frame, reading.stamp) if reading.frame else Frame()
            pose = frame @ reading.pose
            covariance = _rotated(reading.covariance, frame.rotation)
            mask = np.concatenate((_turned_mask(mask[:3], frame), _turned_mask(mask[3:], frame)))
        if config.is_differential:
            return self._difference(reading.stamp, pose, covariance, mask)
        if config.is_relative:
            if self._first is None:
                self._first = pose
            pose = self._first.inverse @ pose
        values = np.concatenate((pose.origin, angles(pose.rotation)))
        return self._measurement(reading.stamp, POSE, values, covariance, mask=mask, threshold=config.pose_threshold)

    def twist(self, reading: TwistReading) -> Measurement | None:
        """A measurement of the velocities, None if none is configured. Raises TransformError."""
        mask = self.config.mask[TWIST]
        return self._twist(reading, mask, self.config.twist_threshold) if mask.any() else None

    def acceleration(self, reading: AccelerationReading) -> Measurement | None:
        """A measurement of the accelerations, None if none is configured. Raises TransformError."""
        config, around = self.config, self._around
        mask = config.mask[ACCELERATION]
        if not mask.any():
            return None
        frame = around.lookup(around.base, reading.frame, reading.stamp) if reading.frame else Frame()
        state = self._motion.state
        linear = reading.linear
        if config.removes_gravity:
            own = reading.orientation
            if own is None:
                own = rotation(*state[ORIENTATION].tolist()) @ frame.rotation
            linear = linear - own.T @ np.array([0.0, 0.0, around.gravity])
        turning = state[TURNING]
        linear = (
            frame.rotation @ linear
            + np.cross(frame.origin, self._motion.turning_rate)
            - np.cross(np.cross(frame.origin, turning), turning)
        )
        covariance = frame.rotation @ reading.covariance @ frame.rotation.T
        turned = _turned_mask(mask, frame)
        threshold = config.acceleration_threshold
        return self._measurement(reading.stamp, ACCELERATION, linear, covariance, mask=turned, threshold=threshold)

    def _orientation(self, reading: PoseReading, mask: Mask) -> tuple[Frame, Array, Mask]:
        """The base's orientation by an IMU: its angles less those of its mounting, turned by the mounting's yaw."""
        around = self._around
        mounting = around.lookup(around.base, reading.frame, reading.stamp) if reading.frame else Frame()
        roll, pitch, yaw = angles(mounting.rotation)
        own = angles(reading.pose.rotation)
        turned = rotation(0.0, 0.0, yaw)
        rpy = turned @ np.array([wrap(a - b) for a, b in zip(own, (roll, pitch, yaw), strict=True)])
        covariance = _rotated(reading.covariance, turned)
        mask = np.concatenate((np.zeros(3, bool), _turned_mask(mask[3:], Frame(turned))))
        return Frame(rotation(*rpy.tolist())), covariance, mask

    def _difference(self, stamp: float, pose: Frame, covariance: Array, mask: Mask) -> Measurement | None:
        last, self._last = self._last, (stamp, pose, covariance)
        if last is None or stamp <= last[0]:
            return None
        seconds = stamp - last[0]
        change = last[1].inverse @ pose
        reading = TwistReading(
            stamp,
            "",
            change.origin / seconds,
            np.array(angles(change.rotation)) / seconds,
            (covariance + last[2]) * seconds,
        )
        return self._twist(reading, mask, self.config.pose_threshold)

    def _twist(self, reading: TwistReading, mask: Mask, threshold: float) -> Measurement:
        around = self._around
        frame = around.lookup(around.base, reading.frame, reading.stamp) if reading.frame else Frame()
        turning = self._motion.state[TURNING]
        measured = np.where(mask[3:], reading.angular, frame.rotation.T @ turning)
        angular = frame.rotation @ measured
        linear = frame.rotation @ reading.linear + np.cross(frame.origin, angular)
        turned = np.concatenate((_turned_mask(mask[:3], frame), _turned_mask(mask[3:], frame)))
        covariance = _rotated(reading.covariance, frame.rotation)
        return self._measurement(
            reading.stamp, TWIST, np.concatenate((linear, angular)), covariance, mask=turned, threshold=threshold
        )

    def _measurement(
        self, stamp: float, part: slice, values: Array, covariance: Array, *, mask: Mask, threshold: float
    ) -> Measurement:
        whole, spread, chosen = np.zeros(SIZE), np.zeros((SIZE, SIZE)), np.zeros(SIZE, bool)
        whole[part], spread[part, part], chosen[part] = values, covariance, mask
        if self._around.is_planar:
            for number in OFF_THE_PLANE:
                whole[number] = 0.0
                spread[number, :] = spread[:, number] = 0.0
                spread[number, number] = _PLANAR_VARIANCE
                chosen[number] = True
        return Measurement(stamp, self.config.topic, whole, spread, chosen, threshold)


def _turned_mask(mask: Mask, frame: Frame) -> Mask:
    """The mask of the axes that are measured once the frame's axes have been turned."""
    return np.asarray(np.linalg.norm(frame.rotation * mask, axis=1) >= _SHORTEST)


def _rotated(covariance: Array, turn: Array) -> Array:
    """A covariance of two triples of axes (6, 6), both turned."""
    both = np.zeros((6, 6))
    both[:3, :3] = both[3:, 3:] = turn
    return np.asarray(both @ covariance @ both.T)
