"""The filter as a node runs it: sensors, a queue in the order of time, and the state at a time.

Measurements wait until their time has come, and are taken in its order. Where nothing is measured for longer than
`sensor_timeout`, the state is predicted to the present.
"""

from __future__ import annotations

import heapq
import itertools
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from rosbot_patrol.ekf.filter import Ekf, Measurement
from rosbot_patrol.ekf.readings import AccelerationReading, PoseReading, TwistReading
from rosbot_patrol.ekf.sensor import Sensor, SensorConfig, Surroundings
from rosbot_patrol.ekf.state import ACCELERATION, NAMES, POSE, SIZE, TURNING, Array
from rosbot_patrol.errors import TransformError


@dataclass
class Counts:
    """What became of a sensor's readings.

    Attributes:
        spoilt: with a number that is not finite; it does not count.
        unspread: with a variance of 0 or below, which counts as the smallest one.
        problem: why the last one was lost.
    """

    taken: int = 0
    rejected: int = 0
    late: int = 0
    lost: int = 0
    spoilt: int = 0
    unspread: int = 0
    problem: str = ""


class FilterCore:
    """All sensors and the filter.

    Args:
        ekf: the filter.
        configs: of the sensors by name.
        around: frames and settings.
        sensor_timeout: [s].

    Attributes:
        turning_rate: change of the turning speeds [rad/s^2], shape (3,).
    """

    def __init__(
        self, ekf: Ekf, configs: Mapping[str, SensorConfig], around: Surroundings, sensor_timeout: float
    ) -> None:
        self.ekf = ekf
        self._first = ekf.covariance.copy()
        self.sensors = {name: Sensor(config, around, self) for name, config in configs.items()}
        self.counts = {name: Counts() for name in configs}
        self._timeout = sensor_timeout
        self._queue: list[tuple[float, int, Measurement]] = []
        self._order = itertools.count()
        self._heard: dict[tuple[str, str], float] = {}
        self._updated: float | None = None
        self._turning: tuple[float, Array] | None = None  # of the last update: time, turning speeds
        self.turning_rate = np.zeros(3)
        self._set_at = -np.inf

    @property
    def state(self) -> Array:
        """The filter's state, shape (15,)."""
        return self.ekf.state

    def hear(self, name: str, reading: PoseReading | TwistReading | AccelerationReading) -> None:
        """Take a reading of a sensor; one without a known frame counts as lost, one older than the last as late."""
        sensor, counts = self.sensors[name], self.counts[name]
        part = type(reading).__name__
        if reading.stamp <= self._set_at or reading.stamp < self._heard.get((name, part), -np.inf):
            counts.late += 1
            return
        try:
            if isinstance(reading, PoseReading):
                measurement = sensor.pose(reading)
            elif isinstance(reading, TwistReading):
                measurement = sensor.twist(reading)
            else:
                measurement = sensor.acceleration(reading)
        except TransformError as err:
            counts.lost += 1
            counts.problem = str(err)
            return
        self._heard[name, part] = reading.stamp
        if measurement is not None:
            spread = np.diag(measurement.covariance)[measurement.mask]
            counts.spoilt += not (np.isfinite(measurement.values[measurement.mask]).all() and np.isfinite(spread).all())
            counts.unspread += bool((spread <= 0.0).any())
            heapq.heappush(self._queue, (measurement.stamp, next(self._order), measurement))

    def update(self, now: float, *, to_now: bool = False) -> None:
        """Take all measurements up to a time [s].

        Args:
            now: the time.
            to_now: predict to it in any case.
        """
        is_fresh = False
        while self._queue and self._queue[0][0] <= now:
            measurement = heapq.heappop(self._queue)[2]
            is_fresh = True
            counts = self.counts.get(measurement.topic)
            is_taken = self.ekf.take(measurement)
            if counts is not None:
                counts.taken += is_taken
                counts.rejected += not is_taken
        self._predict_silence(now, is_fresh, to_now)
        self._follow_turning(now)

    def set_pose(self, stamp: float, pose: Array, covariance: Array) -> None:
        """Set the pose (x y z roll pitch yaw), forget velocities and all that waits.

        Args:
            stamp: [s]; older readings are late.
            pose: shape (6,).
            covariance: shape (6, 6).
        """
        self._queue.clear()
        self._heard.clear()
        for sensor in self.sensors.values():
            sensor.forget()
        self.ekf.state = np.zeros(SIZE)
        self.ekf.state[POSE] = pose
        self.ekf.covariance = self._first.copy()
        self.ekf.covariance[POSE, POSE] = covariance
        self.ekf.stamp, self.ekf.is_begun = stamp, True
        self._set_at, self._updated = stamp, None

    def forget(self) -> None:
        """Begin anew, as after a clock that went back."""
        self._queue.clear()
        self._heard.clear()
        for sensor in self.sensors.values():
            sensor.forget()
        self.ekf.state, self.ekf.covariance = np.zeros(SIZE), self._first.copy()
        self.ekf.is_begun, self._updated, self._set_at = False, None, -np.inf

    def silent(self, now: float) -> dict[str, float]:
        """How long each sensor has been silent [s]; infinite if it was never heard."""
        last = dict.fromkeys(self.sensors, -np.inf)
        for (name, _), stamp in self._heard.items():
            last[name] = max(last[name], stamp)
        return {name: now - stamp for name, stamp in last.items()}

    def acceleration(self) -> Array:
        """Linear accelerations of the base, without gravity [m/s^2], shape (3,)."""
        return self.ekf.state[ACCELERATION].copy()

    def _predict_silence(self, now: float, is_fresh: bool, to_now: bool) -> None:
        ekf = self.ekf
        if is_fresh:
            self._updated = now
        elif ekf.is_begun and self._updated is not None and now - self._updated >= self._timeout:
            ahead = now - self._updated
            ekf.predict(now, ahead)
            ekf.stamp += ahead
            self._updated = now
        if to_now and ekf.is_begun and now > ekf.stamp:
            ekf.predict(now, now - ekf.stamp)
            ekf.stamp = now

    def _follow_turning(self, now: float) -> None:
        """Keep the change of the turning speeds from update to update, for IMUs away from the base's middle."""
        turning = self.ekf.state[TURNING].copy()
        if self._turning is not None and now > self._turning[0]:
            self.turning_rate = (turning - self._turning[1]) / (now - self._turning[0])
        self._turning = (now, turning)


def unmeasured(configs: Mapping[str, SensorConfig], *, is_planar: bool) -> list[str]:
    """Numbers of the pose that no sensor measures, nor their change: their error grows without bound."""
    found = np.zeros(SIZE, bool)
    for config in configs.values():
        found |= config.mask
    planar = {"z", "roll", "pitch"} if is_planar else set()
    return [name for at, name in enumerate(NAMES[:6]) if not (found[at] or found[at + 6]) and name not in planar]
