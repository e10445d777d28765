"""Parameters of the supervision: how long is long."""

from __future__ import annotations

from dataclasses import dataclass

from rosbot_patrol.params import param


@dataclass(frozen=True, kw_only=True)
class WatchTimes:
    """When something counts as a problem; all times are of the wall, as the sensors' heartbeats are."""

    silent_after: float = param(
        10.0, unit="s", lo=1.0, doc="nothing heard for so long, or for 4 heartbeats where that is longer, is a silence"
    )
    start_grace: float = param(60.0, unit="s", lo=0.0, doc="a sensor of the file may take so long to be heard first")
    steady_after: float = param(5.0, unit="s", lo=0.0, doc="it is back when it was heard without a gap for so long")
    gap: float = param(3.0, unit="s", lo=0.5, doc="a pause longer than this, or than 4 heartbeats, is a drop-out")
    flap_count: int = param(5, lo=2, doc="so many drop-outs or new connections within flap_window are flapping")
    flap_window: float = param(600.0, unit="s", lo=1.0, doc="see flap_count")
    flap_calm: float = param(300.0, unit="s", lo=1.0, doc="flapping is over after so long without a drop-out")
    stuck_after: float = param(
        600.0,
        unit="s",
        lo=1.0,
        doc="motion reported for longer without a pause is no motion (the HC-SR501 holds 300 s)",
    )
    motion_pause: float = param(
        90.0, unit="s", lo=1.0, doc="so long without a report of motion is a pause; longer than the sensor's hold time"
    )
    no_motion_after: float = param(
        0.0, unit="s", lo=0.0, doc="a sensor that lives but saw nothing for so long is blind, or stuck; 0: never said"
    )
    bridge_after: float = param(5.0, unit="s", lo=2.0, doc="a bridge that says nothing for so long has gone")
    patrol_after: float = param(
        10.0, unit="s", lo=3.0, doc="a patrol that was there and says nothing for so long has gone, or hangs"
    )
    clock_limit: float = param(10.0, unit="s", lo=0.1, doc="a clock off by more is far off")
    unknown_calm: float = param(600.0, unit="s", lo=1.0, doc="an unknown id is forgotten after so long")


@dataclass(frozen=True, kw_only=True)
class NoticeTimes:
    """When the owner is told."""

    notice_after: float = param(60.0, unit="s", lo=0.0, doc="a problem that lasts so long is told")
    well_after: float = param(60.0, unit="s", lo=0.0, doc="what was told and is over for so long is told to be well")
    notice_interval: float = param(
        300.0, unit="s", lo=0.0, doc="least time between two notices; what comes meanwhile waits"
    )


@dataclass(frozen=True, kw_only=True)
class LookTimes:
    """When the robot is sent to look."""

    patrol_silent_sensors: bool = param(False, doc="a silent sensor sends the robot to look at its room, once")
    look_after: float = param(30.0, unit="s", lo=0.0, doc="after so long a silence")
    look_interval: float = param(3600.0, unit="s", lo=0.0, doc="least time between two looks for one sensor")
