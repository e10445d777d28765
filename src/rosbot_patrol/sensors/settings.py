"""Parameters of the supervision: time limits of problems, notices and looks."""

from __future__ import annotations

from dataclasses import dataclass

from rosbot_patrol.params import param


@dataclass(frozen=True, kw_only=True)
class WatchTimes:
    """When something counts as a problem; all times are wall times, as the sensors' heartbeats are."""

    silent_after: float = param(
        10.0,
        unit="s",
        lo=1.0,
        doc="time without a message, or 4 heartbeats if that is longer, after which a sensor is silent",
    )
    start_grace: float = param(60.0, unit="s", lo=0.0, doc="time allowed for the first message of a sensor in the file")
    steady_after: float = param(5.0, unit="s", lo=0.0, doc="time without a gap after which a silent sensor is back")
    gap: float = param(3.0, unit="s", lo=0.5, doc="a pause longer than this, or than 4 heartbeats, is a drop-out")
    flap_count: int = param(5, lo=2, doc="number of drop-outs or new connections within flap_window that is flapping")
    flap_window: float = param(600.0, unit="s", lo=1.0, doc="time in which they are counted")
    flap_calm: float = param(300.0, unit="s", lo=1.0, doc="time without a drop-out after which flapping is over")
    stuck_after: float = param(
        600.0,
        unit="s",
        lo=1.0,
        doc="uninterrupted motion for longer means a stuck output (the HC-SR501 holds 300 s)",
    )
    motion_pause: float = param(
        90.0,
        unit="s",
        lo=1.0,
        doc="time without a report of motion that interrupts it; longer than the sensor's hold time",
    )
    no_motion_after: float = param(
        0.0, unit="s", lo=0.0, doc="time without motion after which a live sensor may be blind or stuck; 0: no check"
    )
    bridge_after: float = param(5.0, unit="s", lo=2.0, doc="silence after which a bridge counts as gone")
    patrol_after: float = param(
        10.0, unit="s", lo=3.0, doc="silence after which a running patrol counts as gone or hung"
    )
    clock_limit: float = param(10.0, unit="s", lo=0.1, doc="maximum offset of a clock")
    unknown_calm: float = param(600.0, unit="s", lo=1.0, doc="silence after which an unknown id is forgotten")


@dataclass(frozen=True, kw_only=True)
class NoticeTimes:
    """When the owner is notified."""

    notice_after: float = param(60.0, unit="s", lo=0.0, doc="duration of a problem before the owner is notified")
    well_after: float = param(
        60.0, unit="s", lo=0.0, doc="time after the end of a notified problem before the owner is notified of it"
    )
    notice_interval: float = param(300.0, unit="s", lo=0.0, doc="minimum time between notices; further ones wait")


@dataclass(frozen=True, kw_only=True)
class LookTimes:
    """When the robot is sent to look."""

    patrol_silent_sensors: bool = param(False, doc="send the robot to the room of a silent sensor, once")
    look_after: float = param(30.0, unit="s", lo=0.0, doc="duration of the silence before the robot is sent")
    look_interval: float = param(3600.0, unit="s", lo=0.0, doc="minimum time between two looks for one sensor")
