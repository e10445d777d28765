"""Parameters of ekf_localization_node, under upstream's names."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from rosbot_patrol.ekf.control import Control, Response
from rosbot_patrol.ekf.filter import Ekf
from rosbot_patrol.ekf.sensor import SensorConfig
from rosbot_patrol.ekf.state import SIZE, Array
from rosbot_patrol.errors import ParamError
from rosbot_patrol.params import load, param

_SENSOR = re.compile(r"(odom|pose|twist|imu)(\d+)(?:_(\w+))?$")
_NOISE = (0.05, 0.05, 0.06, 0.03, 0.03, 0.06, 0.025, 0.025, 0.04, 0.01, 0.01, 0.02, 0.01, 0.01, 0.015)
_SIX_OFF, _ONES = (False,) * 6, (1.0,) * 6


def _of_length(count: int) -> Any:
    return lambda values: None if len(values) in (0, count) else f"has {len(values)} values, expected {count}"


def _square(values: tuple[float, ...]) -> str | None:
    return None if len(values) in (0, SIZE, SIZE * SIZE) else f"has {len(values)} values, expected {SIZE * SIZE}"


@dataclass(frozen=True, kw_only=True)
class EkfParams:
    """Parameters of the filter and its node."""

    frequency: float = param(30.0, unit="Hz", lo=0.1, doc="rate of the estimate")
    sensor_timeout: float = param(
        math.nan, unit="s", lo=0.0, doc="silence after which it predicts; default 1 / frequency", ignores_nan=True
    )
    two_d_mode: bool = param(False, doc="the robot stays on a plane")
    map_frame: str = param("map", doc="frame of the map")
    odom_frame: str = param("odom", doc="frame of the odometry")
    base_link_frame: str = param("base_link", doc="frame of the base")
    base_link_frame_output: str = param("", doc="child frame of the estimate; empty: base_link_frame")
    world_frame: str = param("", doc="frame of the estimate, odom_frame or map_frame; empty: odom_frame")
    transform_time_offset: float = param(0.0, unit="s", doc="added to the stamp of the transform")
    transform_timeout: float = param(0.0, unit="s", lo=0.0, doc="accepted, has no effect: look-ups never wait")
    publish_tf: bool = param(True, doc="publish the transform from world_frame")
    invert_tf: bool = param(False, doc="publish it the other way round")
    publish_acceleration: bool = param(False, doc="publish accel/filtered")
    permit_corrected_publication: bool = param(False, doc="publish an estimate of the same time again")
    predict_to_current_time: bool = param(False, doc="predict each estimate to the present")
    print_diagnostics: bool = param(True, doc="report on /diagnostics")
    reset_on_time_jump: bool = param(False, doc="begin anew when ROS time goes back")
    gravitational_acceleration: float = param(9.80665, unit="m/s^2", doc="gravity at the robot's place")
    dynamic_process_noise_covariance: bool = param(False, doc="scale the noise of the pose by the speed")
    process_noise_covariance: tuple[float, ...] = param(
        (), doc="variance that a second adds: 15 values, or 15 x 15", check=_square
    )
    initial_estimate_covariance: tuple[float, ...] = param(
        (), doc="covariance at the start: 15 values, or 15 x 15", check=_square
    )
    initial_state: tuple[float, ...] = param((), doc="state at the start, 15 values", check=_of_length(SIZE))
    disabled_at_startup: bool = param(False, doc="do nothing until the service enable is called")
    smooth_lagged_data: bool = param(False, doc="not built: late measurements correct the present")
    history_length: float = param(0.0, unit="s", lo=0.0, doc="not built")
    use_control: bool = param(False, doc="predict from cmd_vel")
    stamped_control: bool = param(False, doc="cmd_vel is a TwistStamped")
    control_timeout: float = param(0.0, unit="s", lo=0.0, doc="age at which a command counts as zero")
    control_config: tuple[bool, ...] = param(_SIX_OFF, doc="commanded axes: vx vy vz vroll vpitch vyaw")
    acceleration_limits: tuple[float, ...] = param(_ONES, doc="of the commanded axes", check=_of_length(6))
    deceleration_limits: tuple[float, ...] = param((), doc="default: acceleration_limits", check=_of_length(6))
    acceleration_gains: tuple[float, ...] = param(_ONES, doc="of the commanded axes", check=_of_length(6))
    deceleration_gains: tuple[float, ...] = param((), doc="default: acceleration_gains", check=_of_length(6))

    @property
    def world(self) -> str:
        """Frame of the estimate."""
        return self.world_frame or self.odom_frame

    @property
    def silence(self) -> float:
        """The sensors' time-out [s]."""
        return 1.0 / self.frequency if math.isnan(self.sensor_timeout) else self.sensor_timeout

    def ekf(self) -> Ekf:
        """A filter with these settings."""
        noise = _matrix(self.process_noise_covariance, _NOISE)
        control = Control(self._response(), self.control_timeout) if self.use_control else None
        ekf = Ekf(
            noise,
            _matrix(self.initial_estimate_covariance, (1e-9,) * SIZE),
            control,
            self.dynamic_process_noise_covariance,
        )
        if self.initial_state:
            ekf.state = np.array(self.initial_state)
        return ekf

    def _response(self) -> Response:
        speed_up, gain = np.array(self.acceleration_limits or _ONES), np.array(self.acceleration_gains or _ONES)
        return Response(
            np.array(self.control_config or _SIX_OFF, bool),
            speed_up,
            np.array(self.deceleration_limits) if self.deceleration_limits else speed_up,
            gain,
            np.array(self.deceleration_gains) if self.deceleration_gains else gain,
        )


@dataclass(frozen=True, kw_only=True)
class InputParams:
    """Parameters of one sensor, below its name: `odom0_config` and so on."""

    topic: str = param("", doc="its topic (the parameter odom0 itself)")
    config: tuple[bool, ...] = param(
        (), doc="what counts: x y z roll pitch yaw, their speeds, accelerations", check=_of_length(SIZE)
    )
    queue_size: int = param(1, lo=1, doc="of the subscriber")
    nodelay: bool = param(False, doc="without Nagle's delay")
    differential: bool = param(False, doc="poses count by their change")
    relative: bool = param(False, doc="poses count from the first")
    pose_use_child_frame: bool = param(False, doc="not built")
    rejection_threshold: float = param(math.inf, lo=0.0, doc="Mahalanobis distance that rejects")
    pose_rejection_threshold: float = param(math.inf, lo=0.0, doc="likewise, of poses")
    twist_rejection_threshold: float = param(math.inf, lo=0.0, doc="likewise, of speeds")
    linear_acceleration_rejection_threshold: float = param(math.inf, lo=0.0, doc="likewise, of accelerations")
    remove_gravitational_acceleration: bool = param(False, doc="the accelerometer measures gravity, too")

    def sensor(self, name: str) -> SensorConfig:
        """How the filter uses it. Where both ways of counting poses are set, differential wins."""
        any_ = self.rejection_threshold
        return SensorConfig(
            topic=name,
            mask=np.array(self.config, bool),
            is_differential=self.differential,
            is_relative=self.relative and not self.differential,
            pose_threshold=min(self.pose_rejection_threshold, any_),
            twist_threshold=min(self.twist_rejection_threshold, any_),
            acceleration_threshold=self.linear_acceleration_rejection_threshold,
            removes_gravity=self.remove_gravitational_acceleration,
        )


def read_inputs(tree: Mapping[str, Any], *, name: str) -> dict[str, InputParams]:
    """The sensors of a node's parameters: odom0, odom1, ... without gaps, and so on.

    Args:
        tree: the node's private parameters.
        name: of the node, for messages, with a slash at its end.

    Raises:
        ParamError: a sensor has no configuration, or a value that cannot be used.
    """
    found = {}
    for kind in ("odom", "pose", "twist", "imu"):
        number = 0
        while (key := f"{kind}{number}") in tree:
            own = {k.removeprefix(f"{key}_"): v for k, v in tree.items() if k.startswith(f"{key}_")}
            inputs = load(InputParams, {"topic": tree[key], **own}, name=f"{name}{key}_")
            if not inputs.config:
                raise ParamError(f"{name}{key}_config", "is missing: 15 values, true for what counts of it")
            found[key] = inputs
            number += 1
    return found


def sensor_keys(tree: Mapping[str, Any]) -> list[str]:
    """The parameters that belong to sensors."""
    return [key for key in tree if _SENSOR.match(key)]


def _matrix(values: tuple[float, ...], default: tuple[float, ...]) -> Array:
    numbers = np.array(values or default, float)
    return np.diag(numbers) if len(numbers) == SIZE else numbers.reshape(SIZE, SIZE)
