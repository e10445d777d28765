"""Fault services of the simulator: ~set_fault, ~clear_fault, ~list_faults, and the active faults on ~faults."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import rospy
import yaml
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from std_srvs.srv import Trigger, TriggerResponse

from rosbot_patrol.errors import ParamError, PatrolError
from rosbot_patrol.ros.runtime.diagnostics import OK, WARN, Health
from rosbot_patrol.rosserial.device.poor_link import PERFECT, LinkQuality
from rosbot_patrol.rosserial.device.tcp_client import EspClient
from rosbot_patrol.simulation.engine import Engine
from rosbot_patrol.simulation.scenario.faults import KINDS, Fault, LinkPoor, read_fault
from rosbot_patrol.srv import (
    ClearFault,
    ClearFaultRequest,
    ClearFaultResponse,
    SetFault,
    SetFaultRequest,
    SetFaultResponse,
)


class FaultServices:
    """Services, latched topic, and the poor links of the virtual sensors.

    Args:
        engine: engine that has the faults.
        clients: the sensors' links, by id.
        ask: runs an action on the simulation's thread, returns its result or raises its PatrolError.
        health: receives the active faults.
        seed: seed of the poor links.
    """

    def __init__(
        self,
        engine: Engine,
        clients: Mapping[int, EspClient],
        ask: Callable[[Callable[[], Any]], Any],
        health: Health,
        seed: int,
    ) -> None:
        self._engine = engine
        self._clients = clients
        self._ask = ask
        self._health = health
        self._seed = seed
        self._published = -1
        self._topic = rospy.Publisher("~faults", DiagnosticArray, queue_size=5, latch=True)
        rospy.Service("~set_fault", SetFault, self._set)
        rospy.Service("~clear_fault", ClearFault, self._clear)
        rospy.Service("~list_faults", Trigger, self._list)

    def follow(self) -> None:
        """Publish changes, and apply faults of the sensors' links; the simulation's thread calls it."""
        for sensor in self._engine.motion_sensors.restarted():
            self._clients[sensor].reboot()
        if self._engine.faults.changes == self._published:
            return
        self._published = self._engine.faults.changes
        for sensor, client in self._clients.items():
            client.set_link(_quality(self._engine.faults.link(sensor), self._seed + sensor))
        active = self._engine.faults.active
        message = DiagnosticArray(status=[_status(fault, began) for fault, began in active])
        message.header.stamp = rospy.Time.now()
        self._topic.publish(message)
        names = [str(fault) for fault, _ in active]
        values = {fault.name: f"since {began:.2f} s" for fault, began in active}
        self._health.set("faults", WARN if names else OK, ", ".join(names) or "none in force", values)

    def _set(self, request: SetFaultRequest) -> SetFaultResponse:
        try:
            fault = read_fault(_tree(request), source="set_fault: ")
            self._ask(lambda: self._engine.faults.begin(fault, self._engine.now))
        except PatrolError as err:
            return SetFaultResponse(success=False, message=str(err))
        return SetFaultResponse(success=True, message=str(fault))

    def _clear(self, request: ClearFaultRequest) -> ClearFaultResponse:
        faults = self._engine.faults
        try:
            ended = self._ask(lambda: faults.clear(self._engine.now, request.kind, request.target))
        except PatrolError as err:
            return ClearFaultResponse(success=False, message=str(err))
        wanted = f"{request.kind} {request.target}".strip() or "any"
        if not ended:
            return ClearFaultResponse(success=False, message=f"no such fault is in force: {wanted}")
        return ClearFaultResponse(success=True, message=", ".join(map(str, ended)))

    def _list(self, _: object) -> TriggerResponse:
        active = self._ask(lambda: self._engine.faults.active)
        lines = [f"{fault} since {began:.2f} s" for fault, began in active]
        return TriggerResponse(success=True, message="\n".join(lines or [f"none; kinds: {', '.join(KINDS)}"]))


def _tree(request: SetFaultRequest) -> dict[str, Any]:
    """The request as the mapping of a scenario file."""
    try:
        values = yaml.safe_load(request.values or "{}")
        target = yaml.safe_load(request.target) if request.target else None
    except yaml.YAMLError as err:
        raise ParamError("set_fault: values", f"is no yaml: {' '.join(str(err).split())}") from err
    if not isinstance(values, dict):
        raise ParamError("set_fault: values", f"expected keys and values, got {request.values!r}")
    tree = {"kind": request.kind, **values}
    if target is not None:
        tree["target"] = target
    if request.duration != 0.0:
        tree["duration"] = request.duration
    return tree


def _quality(poor: LinkPoor | None, seed: int) -> LinkQuality:
    if poor is None:
        return PERFECT
    return LinkQuality(loss=poor.loss, delay=poor.delay, jitter=poor.jitter, drop_every=poor.drop_every, seed=seed)


def _status(fault: Fault, began: float) -> DiagnosticStatus:
    until = f"{began + fault.duration:.2f}" if fault.duration else "cleared"
    values = {"kind": fault.kind, "target": fault.where, "began": f"{began:.2f}", "until": until}
    return DiagnosticStatus(
        level=DiagnosticStatus.WARN,
        name=fault.name,
        message=str(fault),
        hardware_id="simulation",
        values=[KeyValue(key, value) for key, value in values.items()],
    )
