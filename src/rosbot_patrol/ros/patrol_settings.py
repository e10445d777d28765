"""The parameters of patrol_robot, and its files that may be wrong without ending the guard."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass
from datetime import tzinfo
from typing import Any, TypeVar

from rosbot_patrol.alerts.channels import MailParams
from rosbot_patrol.alerts.evidence import EvidenceParams
from rosbot_patrol.alerts.retention import RetentionParams
from rosbot_patrol.errors import ParamError
from rosbot_patrol.params import declared, param
from rosbot_patrol.patrol.battery import BatteryParams, check_battery
from rosbot_patrol.patrol.coverage import CoverageParams
from rosbot_patrol.patrol.drive import DriveParams
from rosbot_patrol.patrol.eyes import EyesParams
from rosbot_patrol.patrol.judge import JudgeParams
from rosbot_patrol.patrol.look import LookParams
from rosbot_patrol.patrol.people import PeopleParams
from rosbot_patrol.patrol.queueing import PriorityParams
from rosbot_patrol.patrol.rooms import Rooms
from rosbot_patrol.patrol.schedule import Round
from rosbot_patrol.patrol.settings import BehaviourParams, ManagerParams
from rosbot_patrol.patrol.spin import SpinParams
from rosbot_patrol.patrol.suspects import SuspectParams
from rosbot_patrol.patrol.track import TrackParams
from rosbot_patrol.patrol.viewpoints import ViewpointParams
from rosbot_patrol.patrol.watch import WatchParams
from rosbot_patrol.patrol.witness import WitnessParams
from rosbot_patrol.ros.diagnostics import WARN, Health
from rosbot_patrol.ros.incident_keeper import RecordParams
from rosbot_patrol.ros.node import load_params
from rosbot_patrol.ros.patrol_eyes import EyesTopics
from rosbot_patrol.ros.patrol_inputs import InputParams

log = logging.getLogger(__name__)

P = TypeVar("P")

NO_ROUNDS: tuple[tuple[Round, ...], tzinfo | None] = ((), None)


@dataclass(frozen=True, kw_only=True)
class NodeParams(BehaviourParams):
    """The node's own parameters; those of mail, drive, look, turn and watch come beside them."""

    path_to_params: str = param(doc="points file (the tutorial's name)")
    sensors: str = param("", doc="file of the sensors; empty or none: a sensor's id is the number of its room")
    state_dir: str = param("", doc="folder of outbox, incidents and queue; empty: rosbot_patrol in ROS's home")
    image_topic: str = param("/camera/rgb/image_raw", doc="camera for the mail's picture; empty: none")
    rate: float = param(25.0, unit="Hz", lo=5.0, hi=100.0, doc="steps of the patrol, at most")
    schedule: str = param("", doc="file of the rounds; empty: none")
    arming: str = param("", doc="file of the modes; empty: all rooms in each mode, without delays")
    look_around: str = param(
        "full", choices=("full", "spin"), doc="full: from further viewpoints, too; spin: one turn at the room's point"
    )
    clear_share: float = param(
        0.5, lo=0.0, hi=1.0, doc="with less of the floor seen a room is not clear but unverified"
    )
    known_objects: str = param("", doc="file of things that look like somebody (patrol/known_objects); empty: none")
    watch: WatchParams = WatchParams()
    suspects: SuspectParams = SuspectParams()
    judge: JudgeParams = JudgeParams()
    coverage: CoverageParams = CoverageParams()
    viewpoints: ViewpointParams = ViewpointParams()
    witness: WitnessParams = WitnessParams()
    track: TrackParams = TrackParams()
    people: PeopleParams = PeopleParams()
    eyes: EyesTopics = EyesTopics()


RECORDS = (EvidenceParams, RetentionParams, RecordParams)
FLAT = (
    NodeParams,
    InputParams,
    MailParams,
    DriveParams,
    LookParams,
    SpinParams,
    PriorityParams,
    BatteryParams,
    *RECORDS,
)


def load_flat(cls: type[P], tree: dict[str, Any]) -> P:
    """One of the groups that share the node's flat namespace; only NodeParams' warns of unknown names."""
    others = {name for other in FLAT if other is not cls for name, *_ in declared(other)}
    return load_params(cls, tree=tree, ignore=others | (set(tree) if cls is not NodeParams else set()))


def load_manager_params(node: NodeParams, tree: dict[str, Any], prefix: str) -> ManagerParams:
    """Everything that the manager is told. Raises ParamError."""
    battery = load_flat(BatteryParams, tree)
    check_battery(battery, prefix)
    return ManagerParams(
        alarm_classes=node.alarm_classes,
        own_motion_radius=node.own_motion_radius,
        own_motion_memory=node.own_motion_memory,
        resume_max_age=node.resume_max_age,
        priorities=load_flat(PriorityParams, tree),
        battery=battery,
        drive=load_flat(DriveParams, tree),
        look=load_flat(LookParams, tree),
        spin=load_flat(SpinParams, tree),
        watch=node.watch,
        suspects=node.suspects,
        people=node.people,
        track=node.track,
    )


def load_or_say(load: Callable[[str, Rooms], P], path: str, rooms: Rooms, without: P, health: Health) -> P:
    """What a file says; a guard whose file of modes or rounds is wrong stands guard without it, and says so."""
    try:
        return load(path, rooms)
    except ParamError as err:
        log.error("%s; the patrol goes on without this file", err)
        health.set(path, WARN, f"{err}; the patrol goes on without this file")
        return without


def eyes_params(node: NodeParams) -> EyesParams:
    """What counts as seen."""
    return EyesParams(
        look_around=node.look_around,
        clear_share=node.clear_share,
        coverage=node.coverage,
        viewpoints=node.viewpoints,
        witness=node.witness,
    )
