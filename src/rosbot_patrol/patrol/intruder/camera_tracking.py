"""Keep the camera on a person: the bearing to turn by, how fast, and when to let go.

A pure controller for a base that turns on the spot. It is bounded, so that a mission goes on: whoever stays in view is
watched for some seconds and then let go, and whoever is lost is waited for a moment. Somebody who walks to and fro, and
is lost and found, is watched for no longer in all.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from rosbot_patrol.geometry import angle_difference
from rosbot_patrol.params import param


@dataclass(frozen=True, kw_only=True)
class CameraTrackingParams:
    """Keeping a person in the camera's view."""

    track_time: float = param(
        8.0, unit="s", lo=0.0, doc="longest time the camera follows somebody, interruptions included; 0: never"
    )
    track_lost: float = param(1.5, unit="s", lo=0.1, doc="time without a sighting after which the person is lost")
    track_pause: float = param(
        20.0, unit="s", lo=0.0, doc="pause after track_time, in which the patrol goes on whatever the camera shows"
    )
    track_gain: float = param(1.5, unit="1/s", lo=0.1, hi=10.0, doc="turning speed per radian of bearing error")
    track_speed: float = param(0.8, unit="rad/s", lo=0.05, hi=6.0, doc="top turning speed while following")
    track_band: float = param(0.08, unit="rad", lo=0.0, hi=1.0, doc="dead band around the image centre")


class CameraTracking:
    """Holds the camera on one person at a time."""

    def __init__(self, params: CameraTrackingParams | None = None) -> None:
        self.params = params or CameraTrackingParams()
        self._since: float | None = None
        self._seen_at = -math.inf
        self._yaw: float | None = None
        self._free_at = -math.inf
        self._spent = 0.0  # on those who were lost and found since the last pause [s]

    def release(self, now: float) -> None:
        """Let go of whom it keeps in view, if anybody; the time spent still counts."""
        if self._since is not None:
            self._let_go(free_at=now, spent=self._spent + now - self._since)

    @property
    def is_on(self) -> bool:
        """Whether it has hold of somebody."""
        return self._since is not None

    def reset(self) -> None:
        """Let go and forget, for a new mission."""
        self._since, self._seen_at, self._yaw, self._free_at = None, -math.inf, None, -math.inf
        self._spent = 0.0

    def see(self, now: float, bearing: float, yaw: float | None) -> None:
        """A person is in view.

        Args:
            now: time [s].
            bearing: of the person from the camera's middle when the picture was taken, positive to the left [rad].
            yaw: heading of the robot in odom then [rad], None where it is not known.
        """
        if self.params.track_time <= 0.0 or now < self._free_at or yaw is None:
            return
        if self._since is None:
            if now - self._seen_at > self.params.track_pause:
                self._spent = 0.0
            self._since = now
        self._seen_at, self._yaw = now, yaw + bearing

    def step(self, now: float, yaw: float | None) -> float | None:
        """Turning speed that keeps the person in view [rad/s], None where there is nobody to keep.

        Args:
            now: time [s].
            yaw: heading of the robot in odom now [rad], None where it is not known: it stands still.
        """
        p = self.params
        if self._since is None or self._yaw is None:
            return None
        held = self._spent + now - self._since
        if held > p.track_time:
            self._let_go(free_at=now + p.track_pause, spent=0.0)
            return None
        if now - self._seen_at > p.track_lost:
            self._let_go(free_at=now, spent=held)
            return None
        if yaw is None:
            return 0.0
        off = angle_difference(self._yaw, yaw)
        if abs(off) <= p.track_band:
            return 0.0
        return math.copysign(min(p.track_gain * abs(off), p.track_speed), off)

    def _let_go(self, *, free_at: float, spent: float) -> None:
        self._since, self._yaw, self._free_at, self._spent = None, None, free_at, spent
