"""The parameters of patrol_robot, and its optional files, which may be wrong without ending the guard."""

from __future__ import annotations

import logging
from collections.abc import Callable
from datetime import tzinfo
from typing import TYPE_CHECKING, Any, TypeVar

from rosbot_patrol.alerts.channels.params import MailParams
from rosbot_patrol.alerts.pictures.ring import EvidenceParams
from rosbot_patrol.alerts.records.retention import RetentionParams
from rosbot_patrol.errors import ParamError
from rosbot_patrol.params import declared
from rosbot_patrol.patrol.calls.queue import PriorityParams
from rosbot_patrol.patrol.guard.battery import BatteryParams
from rosbot_patrol.patrol.guard.schedule import Round
from rosbot_patrol.patrol.house.rooms import Rooms
from rosbot_patrol.patrol.mission.drive import DriveParams
from rosbot_patrol.patrol.mission.params import ManagerParams, NodeParams, manager_params
from rosbot_patrol.patrol.search.look import LookParams
from rosbot_patrol.patrol.search.turn import SpinParams
from rosbot_patrol.patrol.senses.params import InputParams
from rosbot_patrol.ros.patrol.incident_keeper import RecordParams
from rosbot_patrol.ros.runtime.diagnostics import WARN, Health
from rosbot_patrol.ros.runtime.node import load_params

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

log = logging.getLogger(__name__)

P = TypeVar("P", bound="DataclassInstance")
V = TypeVar("V")

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


def load_or_say(load: Callable[[str, Rooms], V], path: str, rooms: Rooms, without: V, health: Health) -> V:
    """Load a file of modes or rounds; if it is wrong, the guard reports that and works without it."""
    try:
        return load(path, rooms)
    except ParamError as err:
        log.error("%s; the patrol goes on without this file", err)
        health.set(path, WARN, f"{err}; the patrol goes on without this file")
        return without
