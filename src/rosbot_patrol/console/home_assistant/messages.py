"""States of the guard as MQTT messages, and orders that come by MQTT."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass

from rosbot_patrol.console.home_assistant.discovery import Topics
from rosbot_patrol.console.live.house_state import HouseState, RoomMark
from rosbot_patrol.errors import AccessError

MOTION_FOR = 30.0  # [s] after its last call a motion sensor counts as moved
_LONGEST = 1000  # bytes of an order
_MODES = {"ARM_AWAY": "armed_away", "ARM_HOME": "armed_home", "ARM_NIGHT": "night", "DISARM": "disarmed"}
_STATES = {"armed_away": "armed_away", "armed_home": "armed_home", "night": "armed_night", "disarmed": "disarmed"}
_PRESENCE = {"home": "armed_home", "away": "armed_away"}


@dataclass(frozen=True, kw_only=True)
class MqttOrder:
    """An order: arm, look, home, all, cancel or stop; with a mode and a code, or a room. Nothing releases a stop."""

    what: str
    mode: str = ""
    code: str = ""
    room_id: int = -1


def states(state: HouseState, topics: Topics) -> dict[str, str]:
    """Payload of each state, by topic; all are retained."""
    guard = state.guard
    found = {
        topics.state("alarm"): _alarm_state(state),
        topics.state("person"): _on(guard is not None and guard.verdict == "confirmed"),
        topics.state("emergency_stop"): _on(state.is_stopped),
        topics.state("doing"): (guard.why or guard.doing)[:250] if guard is not None else "unknown",
    }
    if state.battery is not None and state.battery.share is not None:
        found[topics.state("battery")] = str(round(100 * state.battery.share))
    for sensor in state.sensors:
        has_moved = sensor.motion is not None and sensor.motion < MOTION_FOR
        found[topics.state(f"motion_{sensor.id}")] = _on(has_moved)
    return found


def status_of(state: HouseState) -> bool:
    """Whether the guard is there."""
    return state.is_heard and state.guard is not None


def order_of(topic: str, payload: bytes, topics: Topics, rooms: Sequence[RoomMark]) -> MqttOrder:
    """The order in a message. Raises AccessError."""
    text = payload[:_LONGEST].decode("utf-8", "replace").strip()
    name = topic.removeprefix(f"{topics.base}/").removesuffix("/set")
    if name in ("home", "all", "cancel", "stop"):
        return MqttOrder(what=name)
    if name == "alarm":
        return _alarm_order(text)
    if name == "presence":
        if text.lower() not in _PRESENCE:
            raise AccessError(topic, f"got '{text[:40]}', expected home or away")
        return MqttOrder(what="arm", mode=_PRESENCE[text.lower()])
    if name == "look":
        found = [room.id for room in rooms if text == str(room.id) or text.casefold() == room.name.casefold()]
        if not found:
            raise AccessError(topic, f"got '{text[:40]}', expected the number or the name of a room")
        return MqttOrder(what="look", room_id=found[0])
    raise AccessError(topic, "takes no orders")


def _alarm_order(text: str) -> MqttOrder:
    """Home Assistant's command: JSON with action and code, or the action alone."""
    action, code = text, ""
    if text.startswith("{"):
        try:
            tree = json.loads(text)
            action, code = str(tree["action"]), str(tree.get("code") or "")
        except (ValueError, TypeError, KeyError) as err:
            raise AccessError("the alarm's order", f"makes no sense: {err!r}") from err
    mode = _MODES.get(action.upper())
    if mode is None:
        raise AccessError("the alarm's order", f"is '{action[:40]}', expected one of {', '.join(_MODES)}")
    return MqttOrder(what="arm", mode=mode, code="" if code == "None" else code)


def _alarm_state(state: HouseState) -> str:
    arming, guard = state.arming, state.guard
    if guard is not None and guard.verdict == "confirmed":
        return "triggered"
    if arming is None:
        return "None"  # unknown, in Home Assistant's words
    if arming.exit_delay > 0.0:
        return "arming"
    if arming.entry_delay > 0.0:
        return "pending"
    return _STATES.get(arming.mode, "None")


def _on(value: bool) -> str:
    return "ON" if value else "OFF"
