"""The parameters of the patrol's behaviour."""

from __future__ import annotations

from dataclasses import dataclass

from rosbot_patrol.params import param
from rosbot_patrol.patrol.battery import BatteryParams
from rosbot_patrol.patrol.drive import DriveParams
from rosbot_patrol.patrol.look import LookParams
from rosbot_patrol.patrol.people import PeopleParams
from rosbot_patrol.patrol.queueing import PriorityParams
from rosbot_patrol.patrol.spin import SpinParams
from rosbot_patrol.patrol.suspects import SuspectParams
from rosbot_patrol.patrol.track import TrackParams
from rosbot_patrol.patrol.watch import WatchParams

ALARM_CLASSES = ["person", "fire hydrant"]


@dataclass(frozen=True, kw_only=True)
class BehaviourParams:
    """What the node and its manager share."""

    alarm_classes: list[str] = param(ALARM_CLASSES, doc="classes of objects that alarm")
    own_motion_radius: float = param(
        2.0, unit="m", lo=0.0, doc="so near to a room's point the moving robot is what its sensor sees"
    )
    own_motion_memory: float = param(
        2.0, unit="s", lo=0.0, hi=60.0, doc="so long after it was near the robot is still what the sensor saw"
    )
    resume_max_age: float = param(
        43200.0, unit="s", lo=0.0, doc="a call that is older than this after a restart is reported, not followed"
    )


@dataclass(frozen=True, kw_only=True)
class ManagerParams(BehaviourParams):
    """The patrol's behaviour."""

    drive: DriveParams = DriveParams()
    look: LookParams = LookParams()
    spin: SpinParams = SpinParams()
    watch: WatchParams = WatchParams()
    suspects: SuspectParams = SuspectParams()
    people: PeopleParams = PeopleParams()
    track: TrackParams = TrackParams()
    priorities: PriorityParams = PriorityParams()
    battery: BatteryParams = BatteryParams()
