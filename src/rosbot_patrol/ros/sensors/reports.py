"""Messages of the sensor supervision: /sensors/states, /sensors/events and /diagnostics."""

from __future__ import annotations

import logging
from collections.abc import Iterable

import rospy

from rosbot_patrol.counts import count_of
from rosbot_patrol.graph.judge import Fault, Finding
from rosbot_patrol.msg import SensorEvent, SensorState, SensorStates
from rosbot_patrol.ros.runtime.diagnostics import ERROR, OK, STALE, WARN, Health
from rosbot_patrol.sensors.looks import Look
from rosbot_patrol.sensors.problems import OF_GRAPH, SERIOUS, Event, Kind, duration
from rosbot_patrol.sensors.supervisor import SensorStatus, Supervisor

log = logging.getLogger(__name__)


def state_name(status: SensorStatus) -> str:
    """One word for a sensor: its worst problem, or ok, waiting, disabled."""
    if status.problems:
        return status.problems[0].key.kind_name
    if not status.enabled:
        return "disabled"
    if not status.watched:
        return "unwatched"
    return "waiting" if status.waiting else "ok"


def state_text(status: SensorStatus) -> str:
    """One sentence for a sensor, without its name."""
    if status.problems:
        return "; ".join(problem.what for problem in status.problems)
    if not status.enabled:
        return "is out of service"
    if not status.watched and status.heard is not None:
        return "sends no heartbeats: its silence says nothing"
    if status.heard is None:
        return "has not been heard yet"
    moved = "no motion yet" if status.motion is None else f"last motion {duration(status.motion)} ago"
    return f"is well, {moved}"


def summary(statuses: list[SensorStatus], watch: Supervisor) -> tuple[int, str]:
    """Level and sentence for all sensors together."""
    expected = [s for s in statuses if s.watched]
    bad = [str(s.sensor_id) for s in statuses if s.problems and watch.sensors.find(s.sensor_id) is not None]
    unknown = [str(s.sensor_id) for s in statuses if s.problems and watch.sensors.find(s.sensor_id) is None]
    gone = [name for name, is_there in watch.bridges().items() if not is_there]
    waiting = sum(s.waiting for s in expected)
    well = sum(not s.problems and not s.waiting for s in expected)
    text = f"{well} of {count_of(len(expected), 'sensor is', 'sensors are')} well"
    text += f", not: {', '.join(bad[:20])}{', ...' if len(bad) > 20 else ''}" if bad else ""
    text += f", {waiting} not heard yet" if waiting else ""
    text += f", {count_of(len(unknown), 'unknown id')}: {', '.join(unknown[:10])}" if unknown else ""
    text += f", bridges gone: {', '.join(gone)}" if gone else ""
    return (WARN if bad or unknown or gone else OK), text


def event_to_msg(event: Event, watch: Supervisor) -> SensorEvent:
    """Convert an event of the supervisor."""
    key = event.problem.key
    message = SensorEvent(
        kind=key.kind_name, active=event.active, id=max(key.sensor_id, 0), room=-1, bridge=event.problem.bridge
    )
    spec = watch.sensors.find(key.sensor_id) if key.sensor_id >= 0 else None
    if spec is not None:
        message.name, message.room, message.room_name = spec.name, spec.room, watch.sensors.room_name(spec.room)
    message.bridge = key.bridge or event.problem.bridge
    message.header.stamp = rospy.Time.now()
    message.since = _ago(event.lasted)
    message.text = event.text
    return message


def look_to_msg(look: Look, watch: Supervisor) -> SensorEvent:
    """Convert a request to look into a room."""
    message = SensorEvent(kind=SensorEvent.LOOK, active=True, id=look.sensor_id, room=look.room, text=look.text)
    message.room_name = watch.sensors.room_name(look.room)
    message.header.stamp = message.since = rospy.Time.now()
    return message


def states_to_msg(statuses: list[SensorStatus], watch: Supervisor) -> SensorStates:
    """Convert the states of all sensors."""
    message = SensorStates(sensors=[_state(status, watch) for status in statuses])
    for name, is_there in watch.bridges().items():
        (message.bridges if is_there else message.bridges_gone).append(name)
    message.header.stamp = rospy.Time.now()
    message.text = summary(statuses, watch)[1]
    return message


def _state(status: SensorStatus, watch: Supervisor) -> SensorState:
    spec = watch.sensors.find(status.sensor_id)
    link = status.link
    return SensorState(
        id=status.sensor_id,
        name=spec.name if spec else "",
        room=spec.room if spec else -1,
        room_name=watch.sensors.room_name(spec.room) if spec else "",
        state=state_name(status),
        problems=[problem.key.kind_name for problem in status.problems],
        peer=link.peer if link else "",
        bridge=status.bridge,
        proven=link.proven if link else False,
        heard=-1.0 if status.heard is None else status.heard,
        motion=-1.0 if status.motion is None else status.motion,
        messages=min(status.messages, 0xFFFFFFFF),
        triggers=min(status.triggers, 0xFFFFFFFF),
        text=f"{watch.sensors.title(status.sensor_id)} {state_text(status)}",
    )


def _ago(seconds: float) -> rospy.Time:
    return rospy.Time.from_sec(max(rospy.get_time() - seconds, 0.0))


class Reports:
    """The entries of /diagnostics: one per sensor by name, one per bridge, one for all.

    Args:
        health: the node's health.
    """

    def __init__(self, health: Health) -> None:
        self._health = health
        self._parts: set[str] = set()
        self._network = ""

    def update(self, statuses: list[SensorStatus], watch: Supervisor) -> None:
        """Set the entries to the current states."""
        parts = {self._sensor(status, watch) for status in statuses}
        for name, is_there in watch.bridges().items():
            part = f"bridge {name.strip('/')}"
            self._health.set(part, OK if is_there else ERROR, "is heard" if is_there else "has gone")
            parts.add(part)
        if watch.patrol:
            is_there = not any(key.kind is Kind.PATROL_GONE for key in watch.problems())
            self._health.set("patrol", OK if is_there else ERROR, "is heard" if is_there else "has gone, or hangs")
        for part in self._parts - parts:
            self._health.drop(part)
        self._parts = parts
        self._health.set("", *summary(statuses, watch))

    def update_graph(self, watch: Supervisor, findings: Iterable[Finding]) -> None:
        """Set the two entries about the graph: what is wrong in it, and whether others can reach it."""
        wrong = [f"{watch.title(key)} {p.what}" for key, p in watch.problems().items() if key.kind in OF_GRAPH]
        self._health.set("graph", ERROR if wrong else OK, "; ".join(wrong) or "as it should be")
        found = next((each for each in findings if each.fault is Fault.GRAPH_OPEN), None)
        what = f"{found.subject} {found.what}; scripts/secure closes it" if found else "no other machine can command it"
        if what != self._network and found:
            log.warning("%s (docs/security.md)", what)
        self._network = what
        self._health.set("network", WARN if found else OK, what)

    def _sensor(self, status: SensorStatus, watch: Supervisor) -> str:
        spec = watch.sensors.find(status.sensor_id)
        name = spec.name or watch.sensors.room_name(spec.room) if spec else "unknown"
        part = f"sensor {status.sensor_id} {name}".replace(":", " ")
        level = OK
        if status.problems:
            level = ERROR if any(p.key.kind in SERIOUS for p in status.problems) else WARN
        elif status.waiting or not status.enabled:
            level = STALE if status.waiting else OK
        values = {
            "room": spec.room if spec else "",
            "peer": status.link.peer if status.link else "",
            "bridge": status.bridge,
            "heard": "never" if status.heard is None else f"{status.heard:.1f} s ago",
            "motion": "never" if status.motion is None else f"{status.motion:.0f} s ago",
            "messages": status.messages,
            "triggers": status.triggers,
        }
        self._health.set(part, level, state_text(status), values)
        return part
