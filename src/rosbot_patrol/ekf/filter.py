"""The extended Kalman filter: predict by constant acceleration, correct by measurements of any part of the state."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.ekf.control import Control
from rosbot_patrol.ekf.state import (
    ACCELERATION,
    ANGLES,
    ORIENTATION,
    POSE,
    POSITION,
    ROLL,
    SIZE,
    TURNING,
    TWIST,
    VELOCITY,
    Array,
    axis_rotations,
    wrap,
)

_LONGEST = 1e5  # [s] a gap this long is a clock that was set
_AFTER_A_JUMP = 0.01  # [s] that is predicted then
_LEAST_VARIANCE = 1e-9


@dataclass(frozen=True)
class Measurement:
    """A measurement of some numbers of the state.

    Attributes:
        stamp: [s].
        topic: where it came from.
        values: shape (15,); only those in `mask` count.
        covariance: shape (15, 15), likewise.
        mask: which numbers it measures, shape (15,).
        threshold: Mahalanobis distance from which it is rejected.
    """

    stamp: float
    topic: str
    values: Array
    covariance: Array
    mask: NDArray[np.bool_]
    threshold: float = math.inf


@dataclass
class Ekf:
    """State, covariance, and the time for which they stand.

    Args:
        process_noise: variance that each second adds, shape (15, 15).
        covariance: at the beginning, shape (15, 15).
        control: commands as an input, None for none.
        is_noise_dynamic: scale the noise of the pose by the speed.
    """

    process_noise: Array
    covariance: Array
    control: Control | None = None
    is_noise_dynamic: bool = False
    state: Array = field(default_factory=lambda: np.zeros(SIZE))
    stamp: float = 0.0
    is_begun: bool = False

    def take(self, measurement: Measurement) -> bool:
        """Predict to a measurement's time and correct; returns False if it was rejected.

        An older measurement corrects without a prediction. The very first sets the state.
        """
        if not self.is_begun:
            self._begin(measurement)
            return True
        ahead = measurement.stamp - self.stamp
        if ahead > 0.0:
            self.predict(measurement.stamp, ahead if ahead <= _LONGEST else _AFTER_A_JUMP)
        is_taken = self.correct(measurement)
        self.stamp = max(self.stamp, measurement.stamp)
        return is_taken

    def predict(self, now: float, seconds: float) -> None:
        """Move the state on.

        Args:
            now: time at the end [s], for the age of the command.
            seconds: length of the step.
        """
        state = self.state
        if self.control is not None:
            self.control.apply(state, now, seconds)
        step, jacobian = motion(state, seconds)
        noise = self.process_noise
        if self.is_noise_dynamic:
            noise = noise.copy()
            noise[POSE, POSE] *= float(state[TWIST] @ state[TWIST])
        self.state = state + step
        self._wrap()
        self.covariance = jacobian @ self.covariance @ jacobian.T + seconds * noise

    def correct(self, measurement: Measurement) -> bool:
        """Correct the state; returns False if the measurement is too far off. NaN and inf do not count."""
        index = np.flatnonzero(measurement.mask & np.isfinite(measurement.values))
        if len(index) == 0:
            return True
        noise = measurement.covariance[np.ix_(index, index)].copy()
        diagonal = np.abs(np.diagonal(noise))
        np.fill_diagonal(noise, np.maximum(diagonal, _LEAST_VARIANCE))
        cross = self.covariance[:, index]
        inverse = np.linalg.inv(cross[index] + noise)
        innovation = measurement.values[index] - self.state[index]
        for at, number in enumerate(index.tolist()):
            if number in ANGLES:
                innovation[at] = wrap(innovation[at])
        if float(innovation @ inverse @ innovation) >= measurement.threshold**2:
            return False
        gain = cross @ inverse
        self.state = self.state + gain @ innovation
        self._wrap()
        rest = np.eye(SIZE)
        rest[:, index] -= gain
        self.covariance = rest @ self.covariance @ rest.T + gain @ noise @ gain.T
        return True

    def _begin(self, measurement: Measurement) -> None:
        index = np.flatnonzero(measurement.mask & np.isfinite(measurement.values))
        self.state[index] = measurement.values[index]
        self.covariance[np.ix_(index, index)] = measurement.covariance[np.ix_(index, index)]
        self.stamp, self.is_begun = measurement.stamp, True

    def _wrap(self) -> None:
        for number in ANGLES:
            self.state[number] = wrap(self.state[number])


def motion(state: Array, seconds: float) -> tuple[Array, Array]:
    """Change of a state in a time by constant acceleration, and the Jacobian of the state after it.

    Args:
        state: shape (15,).
        seconds: length of the step.

    Returns:
        The change, shape (15,), and the Jacobian, shape (15, 15).
    """
    roll, pitch, _ = state[ORIENTATION].tolist()
    about_x, about_y, about_z = axis_rotations(*state[ORIENTATION].tolist())
    turned = about_z @ about_y @ about_x
    way = state[VELOCITY] * seconds + state[ACCELERATION] * (0.5 * seconds * seconds)
    rates, by_roll, by_pitch = _euler_rates(roll, pitch)
    turning = state[TURNING]

    change = np.zeros(SIZE)
    change[POSITION] = turned @ way
    change[ORIENTATION] = rates @ turning * seconds
    change[VELOCITY] = state[ACCELERATION] * seconds

    jacobian = np.eye(SIZE)
    jacobian[POSITION, VELOCITY] = turned * seconds
    jacobian[POSITION, ACCELERATION] = turned * (0.5 * seconds * seconds)
    jacobian[POSITION, ORIENTATION] = np.column_stack(
        (
            about_z @ about_y @ _derivative(about_x, 0) @ way,
            about_z @ _derivative(about_y, 1) @ about_x @ way,
            _derivative(about_z, 2) @ about_y @ about_x @ way,
        )
    )
    jacobian[ORIENTATION, ROLL] += by_roll @ turning * seconds
    jacobian[ORIENTATION, ROLL + 1] += by_pitch @ turning * seconds
    jacobian[ORIENTATION, TURNING] = rates * seconds
    jacobian[VELOCITY, ACCELERATION] = np.eye(3) * seconds
    return change, jacobian


_GENERATORS: Sequence[Array] = (
    np.array([[0.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]),
    np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 0.0], [-1.0, 0.0, 0.0]]),
    np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]]),
)


def _derivative(about: Array, axis: int) -> Array:
    """Derivative of a rotation about an axis by its angle."""
    return np.asarray(_GENERATORS[axis] @ about)


def _euler_rates(roll: float, pitch: float) -> tuple[Array, Array, Array]:
    """Matrix from turning speeds of the body to rates of roll, pitch and yaw; its derivatives by roll and by pitch."""
    cr, sr, cp, tp = math.cos(roll), math.sin(roll), math.cos(pitch), math.tan(pitch)
    return (
        np.array([[1.0, sr * tp, cr * tp], [0.0, cr, -sr], [0.0, sr / cp, cr / cp]]),
        np.array([[0.0, cr * tp, -sr * tp], [0.0, -sr, -cr], [0.0, cr / cp, -sr / cp]]),
        np.array([[0.0, sr / cp**2, cr / cp**2], [0.0, 0.0, 0.0], [0.0, sr * tp / cp, cr * tp / cp]]),
    )
