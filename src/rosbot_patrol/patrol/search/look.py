"""Look around: one full turn in front of a live detector, and whether it can be relied on.

The turn is measured in odom. Wheels slip, so a full turn may be several degrees off. If the pose in the map (amcl) says
so, within reason, the rest is turned in addition.

While camera or detector are silent, the turn waits for them: what the robot turns past meanwhile would not be seen.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from rosbot_patrol.geometry import Pose2D, angle_difference
from rosbot_patrol.goal import Goal
from rosbot_patrol.params import param
from rosbot_patrol.patrol.records.activity import Activity, turning
from rosbot_patrol.patrol.records.inputs import Inputs
from rosbot_patrol.patrol.search.turn import Spin, SpinParams


@dataclass(frozen=True, kw_only=True)
class LookParams:
    """Conditions under which a look around counts."""

    detector_timeout: float = param(
        3.0, unit="s", lo=0.1, doc="maximum silence of the detector during a look that counts"
    )
    camera_timeout: float = param(
        3.0, unit="s", lo=0.1, doc="maximum time without a new camera image during a look that counts"
    )
    detector_wait: float = param(
        10.0, unit="s", lo=0.0, doc="longest wait for detector and camera before the turn, or within it"
    )
    pause_after: float = param(
        1.0, unit="s", lo=0.1, doc="silence of camera or detector after which the turn waits, up to detector_wait"
    )
    linger: float = param(1.0, unit="s", lo=0.0, hi=30.0, doc="wait after the turn for the detector's last images")
    correction_min: float = param(
        0.04, unit="rad", lo=0.01, doc="smallest error of the turn, measured in the map, that is corrected"
    )
    correction_max: float = param(
        0.4, unit="rad", lo=0.0, hi=3.0, doc="larger errors are taken for a wrong pose and not corrected"
    )
    hold: float = param(
        2.0, unit="s", lo=0.0, hi=30.0, doc="longest stop in the turn while something may be an intruder"
    )


@dataclass(frozen=True, kw_only=True)
class LookStep:
    """Output of one step.

    Attributes:
        speed: turning speed [rad/s], None if somebody else controls the wheels.
        goal: to be driven to; cancel: give it up.
        progress: a viewpoint is done, and must be stored.
        done: the look is over.
        problem: reason why it does not count as a look at the whole room, "" if it does.
        is_stuck: the reason is that the robot could not turn far enough; what it saw counts.
        why: its activity, for people.
    """

    speed: float | None = 0.0
    goal: Goal | None = None
    cancel: bool = False
    progress: bool = False
    done: bool = False
    problem: str = ""
    is_stuck: bool = False
    why: str = ""


class Look:
    """One look around.

    Args:
        needs_camera: whether this program receives pictures, so that it can detect a silent camera.
        turn: to the left [rad]; 0 is a look ahead.
    """

    def __init__(
        self, params: LookParams, spin: SpinParams, *, needs_camera: bool = True, turn: float = math.tau
    ) -> None:
        self.params = params
        self.spin = Spin(turn, clockwise=False, params=spin)
        self._needs_camera = needs_camera
        self._began: float | None = None
        self._turning = False
        self._turning_since = math.inf
        self._correction: Spin | None = None
        self._spin_params = spin
        self._map_yaw: float | None = None
        self._map_turned = 0.0
        self._turned_at: float | None = None
        self._problem = self._stuck = ""
        self._silent_since: float | None = None
        self._held_since: float | None = None
        self._held_out_until = -math.inf

    def step(self, now: float, inputs: Inputs, *, candidate: bool, held: bool = False) -> LookStep:
        """Wait for detector and camera, turn, linger.

        Args:
            now: time [s].
            inputs: of this step.
            candidate: something is in view that may become an intruder.
            held: somebody else controls the wheels: measure the turn, and wait.
        """
        if self._began is None:
            self._began = now
        if self._turned_at is not None:
            self._turned_at = now if held else self._turned_at
            return self._linger(now, self._turned_at, inputs)
        if not self._turning:
            blind = self._blind(now, inputs)
            if blind and now - self._began < self.params.detector_wait:
                self._silent_since = self._began
                return LookStep(why=f"{Activity.WAITING_TO_TURN.value}: {blind}")
            self._turning, self._turning_since = True, now
        waits = not held and self._waits_for_pictures(now, inputs)
        if not waits:
            self._note_blindness(now, inputs)
        self._measure_in_map(inputs.pose)
        spin = self._correction or self.spin
        step = spin.step(now, inputs.yaw, inputs.clearance, hold=held or waits or self._hold(now, candidate))
        if step.done and spin is self.spin and not step.problem and self._is_off():
            self._correction = Spin(abs(self._left()), clockwise=self._left() < 0.0, params=self._spin_params)
        elif step.done:
            if spin is self.spin:  # a failed correction does not spoil the turn
                self._stuck = step.problem
            self._turned_at = now
        return LookStep(speed=step.speed, why=turning(self.spin.turned_deg, math.degrees(self.spin.target)))

    @property
    def turned_deg(self) -> float:
        """Angle turned [deg]: by the map if it is plausible, else by odom."""
        by_map = abs(self._left()) <= self.params.correction_max
        return math.degrees(self._map_turned) if by_map else self.spin.turned_deg

    def _measure_in_map(self, pose: Pose2D | None) -> None:
        if pose is None:
            return
        if self._map_yaw is not None:
            self._map_turned += angle_difference(pose.yaw, self._map_yaw)
        self._map_yaw = pose.yaw

    def _left(self) -> float:
        return self.spin.target - self._map_turned

    def _is_off(self) -> bool:
        return self.params.correction_min < abs(self._left()) <= self.params.correction_max

    def _linger(self, now: float, turned_at: float, inputs: Inputs) -> LookStep:
        self._note_blindness(now, inputs)
        done = now - turned_at >= self.params.linger
        problem = self._problem or self._stuck
        is_stuck = bool(self._stuck) and not self._problem
        return LookStep(done=done, problem=problem, is_stuck=is_stuck, why=Activity.WAITING_FOR_PICTURES.value)

    def _note_blindness(self, now: float, inputs: Inputs) -> None:
        if not self._problem:
            self._problem = self._blind(now, inputs)

    def _blind(self, now: float, inputs: Inputs) -> str:
        timeout = self.params.camera_timeout
        if self._needs_camera and inputs.camera_at == -math.inf:
            return "the camera has not shown anything"
        if self._needs_camera and now - inputs.camera_at > timeout:
            return f"the camera has shown nothing for more than {timeout:g} s"
        silent = _silent(now, inputs.detector_at, self.params.detector_timeout)  # without pictures it is silent, too
        if silent:
            return f"the detector {silent}"
        same = max(inputs.camera_changed_at, self._turning_since)
        if self._needs_camera and now - same > timeout:
            return f"the camera showed the same picture for more than {timeout:g} s of turning"
        return ""

    def _waits_for_pictures(self, now: float, inputs: Inputs) -> bool:
        """Whether the turn waits, as it is not seen."""
        last = min(inputs.detector_at, inputs.camera_at) if self._needs_camera else inputs.detector_at
        if now - last <= self.params.pause_after:
            self._silent_since = None
            return False
        self._silent_since = now if self._silent_since is None else self._silent_since
        return now - self._silent_since < self.params.detector_wait

    def _hold(self, now: float, candidate: bool) -> bool:
        if not candidate or now < self._held_out_until:
            self._held_since = None
            return False
        if self._held_since is None:
            self._held_since = now
        if now - self._held_since > self.params.hold:
            self._held_out_until = now + 1.5  # enough time was spent on it: turn on
            self._held_since = None
            return False
        return True


def _silent(now: float, last: float, timeout: float) -> str:
    if last == -math.inf:
        return "has not been heard"
    return f"was silent for more than {timeout:g} s" if now - last > timeout else ""
