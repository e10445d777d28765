"""The parameters of the patrol's behaviour.

The parameters of patrol_robot itself, without those of mail and records.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from rosbot_patrol.params import param
from rosbot_patrol.patrol.belief.decision import IntruderParams
from rosbot_patrol.patrol.belief.params import BeliefParams
from rosbot_patrol.patrol.calls.queue import PriorityParams
from rosbot_patrol.patrol.guard.battery import BatteryParams, check_battery
from rosbot_patrol.patrol.intruder.camera_tracking import CameraTrackingParams
from rosbot_patrol.patrol.intruder.persons import PersonsParams
from rosbot_patrol.patrol.mission.drive import DriveParams
from rosbot_patrol.patrol.search.look import LookParams
from rosbot_patrol.patrol.search.survey import SightParams
from rosbot_patrol.patrol.search.turn import SpinParams
from rosbot_patrol.patrol.senses.params import EyesTopics


@dataclass(frozen=True, kw_only=True)
class BehaviourParams:
    """Parameters that the node and its manager share."""

    alarm_classes: list[str] = param(["person"], doc="object classes that raise an alarm")
    own_motion_radius: float = param(
        2.0,
        unit="m",
        lo=0.0,
        doc="distance from the room's point within which the moving robot explains the sensor's call",
    )
    own_motion_memory: float = param(
        2.0,
        unit="s",
        lo=0.0,
        hi=60.0,
        doc="time after the robot's passage in which it still explains the sensor's call",
    )
    resume_max_age: float = param(
        43200.0, unit="s", lo=0.0, doc="age beyond which a call found after a restart is reported instead of followed"
    )


@dataclass(frozen=True, kw_only=True)
class ManagerParams(BehaviourParams):
    """The patrol's behaviour."""

    drive: DriveParams = DriveParams()
    look: LookParams = LookParams()
    spin: SpinParams = SpinParams()
    belief: BeliefParams = BeliefParams()
    people: PersonsParams = PersonsParams()
    track: CameraTrackingParams = CameraTrackingParams()
    priorities: PriorityParams = PriorityParams()
    battery: BatteryParams = BatteryParams()

    @property
    def intruder(self) -> IntruderParams:
        """What the intruder decision is made with."""
        return IntruderParams(
            alarm_classes=self.alarm_classes,
            belief=self.belief,
            people=self.people,
            track=self.track,
        )


@dataclass(frozen=True, kw_only=True)
class NodeParams(BehaviourParams, SightParams):
    """The node's own parameters; mail, drive, look and turn have their own declarations."""

    path_to_params: str = param(doc="points file (the tutorial's name)")
    sensors: str = param("", doc="sensors file; empty or missing: a sensor's id is the number of its room")
    state_dir: str = param(
        "", doc="folder of outbox, incidents and queue; empty: rosbot_patrol(-NAMESPACE) in ROS's home"
    )
    image_topic: str = param("camera/rgb/image_raw", doc="camera for the pictures in mails; empty: none")
    keep_calls_at_end: bool = param(
        False,
        doc="an end by a signal leaves mission and calls to the next start, as kill -9 does",
    )
    rate: float = param(25.0, unit="Hz", lo=5.0, hi=100.0, doc="maximum rate of the patrol's steps")
    sensor_watch_after: float = param(
        20.0, unit="s", lo=6.0, doc="silence after which a running sensor_watch counts as gone or hung"
    )
    sensor_watch_notice_after: float = param(
        60.0, unit="s", lo=0.0, doc="duration of that failure, and of the recovery, before the owner is notified"
    )
    schedule: str = param("", doc="file of the scheduled rounds; empty: none")
    arming: str = param("", doc="file of the arming modes; empty: every mode guards all rooms, without delays")
    network: str = param(
        "", doc="network whose calibration counts; empty: the one that darknet_ros names in its parameter `running`"
    )
    calibrations: str = param(
        "", doc="folder of files of scripts/calibrate_network, which come before the shipped ones; empty: none"
    )
    known_objects: str = param("", doc="file of objects that look like a person (patrol/known_objects); empty: none")
    belief: BeliefParams = BeliefParams()
    track: CameraTrackingParams = CameraTrackingParams()
    people: PersonsParams = PersonsParams()
    eyes: EyesTopics = EyesTopics()


def manager_params(node: NodeParams, load: Callable[[type[Any]], Any], prefix: str) -> ManagerParams:
    """Everything that the manager is told.

    Args:
        node: the node's own parameters.
        load: gives one of the groups that share the node's flat namespace.
        prefix: of the names in messages.

    Raises:
        ParamError: a parameter makes no sense.
    """
    battery = load(BatteryParams)
    check_battery(battery, prefix)
    return ManagerParams(
        alarm_classes=node.alarm_classes,
        own_motion_radius=node.own_motion_radius,
        own_motion_memory=node.own_motion_memory,
        resume_max_age=node.resume_max_age,
        priorities=load(PriorityParams),
        battery=battery,
        drive=load(DriveParams),
        look=load(LookParams),
        spin=load(SpinParams),
        belief=node.belief,
        people=node.people,
        track=node.track,
    )
