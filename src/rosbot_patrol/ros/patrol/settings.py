"""The parameters of patrol_robot, and its optional files, which may be wrong without ending the guard."""

from __future__ import annotations

import logging
import os
from collections.abc import Callable
from dataclasses import replace
from datetime import tzinfo
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from rosbot_patrol.alerts.channels.config import Surroundings, make_channels
from rosbot_patrol.alerts.channels.params import MailParams
from rosbot_patrol.alerts.pictures.ring import EvidenceParams
from rosbot_patrol.alerts.records.retention import RetentionParams
from rosbot_patrol.errors import ParamError
from rosbot_patrol.maps.zones import ZONES
from rosbot_patrol.params import declared
from rosbot_patrol.patrol.calls.queue import PriorityParams
from rosbot_patrol.patrol.guard.arming import load_rules
from rosbot_patrol.patrol.guard.battery import BatteryParams
from rosbot_patrol.patrol.guard.schedule import Round, load_schedule
from rosbot_patrol.patrol.house.own_files import (
    ARMING,
    CHANNELS,
    HOUSE,
    ROOMS,
    SCHEDULE,
    SENSORS,
    own_file,
    watched_files,
)
from rosbot_patrol.patrol.house.rooms import Rooms, load_rooms
from rosbot_patrol.patrol.mission.drive import DriveParams
from rosbot_patrol.patrol.mission.params import ManagerParams, NodeParams, manager_params
from rosbot_patrol.patrol.search.look import LookParams
from rosbot_patrol.patrol.search.turn import SpinParams
from rosbot_patrol.patrol.senses.params import InputParams
from rosbot_patrol.ros.patrol.incident_keeper import RecordParams
from rosbot_patrol.ros.runtime.diagnostics import WARN, Health
from rosbot_patrol.ros.runtime.node import load_params, ros_home
from rosbot_patrol.sensors.sensor_file import SensorList, load_sensors

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

log = logging.getLogger(__name__)

P = TypeVar("P", bound="DataclassInstance")
V = TypeVar("V")

OWN = {"path_to_params": ROOMS, "sensors": SENSORS, "arming": ARMING, "schedule": SCHEDULE}
"""Parameters that name a file of the house, and the name of the owner's file."""

NO_ROUNDS: tuple[tuple[Round, ...], tzinfo | None] = ((), None)


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
    """Load one of the groups that share the node's flat namespace; only NodeParams' warns of unknown names."""
    others = {name for other in FLAT if other is not cls for name, *_ in declared(other)}
    return load_params(cls, tree=tree, ignore=others | (set(tree) if cls is not NodeParams else set()))


def load_manager_params(node: NodeParams, tree: dict[str, Any], prefix: str) -> ManagerParams:
    """Load the manager's parameters. Raises ParamError."""
    return manager_params(node, lambda cls: load_flat(cls, tree), prefix)


def own_params(node: NodeParams, state_dir: Path) -> NodeParams:
    """The node's parameters with the owner's copies of files that come with the program."""
    own: dict[str, Any] = {key: own_file(getattr(node, key), state_dir, name) for key, name in OWN.items()}
    return replace(node, **own)


def own_channels(mail: MailParams, state_dir: Path) -> MailParams:
    """The channels' parameters with the owner's file of channels, if there is one and none was given."""
    return replace(mail, channels=own_file(mail.channels, state_dir, CHANNELS))


def load_house(node: NodeParams) -> tuple[Rooms, SensorList]:
    """Rooms and sensors; raises ParamError."""
    rooms = load_rooms(Path(node.path_to_params).expanduser())
    names = {room.id: room.name for room in rooms}
    return rooms, load_sensors(node.sensors, names, rooms_source=rooms.source)


def check_files(node: NodeParams, mail: MailParams) -> None:
    """Load all files of the house; raises ParamError if one is wrong."""
    rooms, _ = load_house(node)
    make_channels(mail, Surroundings(home=ros_home(), environ=os.environ))
    load_rules(node.arming, rooms)
    load_schedule(node.schedule, rooms)


def files_of(node: NodeParams, mail: MailParams, state_dir: Path) -> list[Path]:
    """All files that the node reads at its start, and the places where the owner's copies would be."""
    given = {name: getattr(node, key) for key, name in OWN.items()} | {CHANNELS: mail.channels}
    return [*watched_files(given, state_dir), state_dir / HOUSE / ZONES]


def load_or_say(load: Callable[[str, Rooms], V], path: str, rooms: Rooms, without: V, health: Health) -> V:
    """Load a file of modes or rounds; if it is wrong, the guard reports that and works without it."""
    try:
        return load(path, rooms)
    except ParamError as err:
        log.error("%s; the patrol goes on without this file", err)
        health.set(path, WARN, f"{err}; the patrol goes on without this file")
        return without
