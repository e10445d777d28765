"""MQTT discovery messages that describe the guard to Home Assistant, one for each entity.

https://www.home-assistant.io/integrations/mqtt/#mqtt-discovery
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from rosbot_patrol.console.home_assistant.settings import BrokerSpec
from rosbot_patrol.console.live.house_state import RoomMark, SensorNow

ONLINE, OFFLINE = "online", "offline"
EVENTS = ("confirmed", "clear", "unreachable", "unverified")
_CODE = '{"action": "{{ action }}", "code": "{{ code }}"}'


@dataclass(frozen=True, kw_only=True)
class Topics:
    """The guard's own topics."""

    base: str

    @property
    def status(self) -> str:
        """Whether the guard is there: online or offline."""
        return f"{self.base}/status"

    def state(self, name: str) -> str:
        """State of an entity."""
        return f"{self.base}/{name}/state"

    def order(self, name: str) -> str:
        """Orders to an entity."""
        return f"{self.base}/{name}/set"


def slug(text: str) -> str:
    """A text as a part of a topic."""
    return re.sub(r"[^A-Za-z0-9_-]+", "_", text).strip("_") or "x"


def discovery(
    spec: BrokerSpec, rooms: Sequence[RoomMark], sensors: Sequence[SensorNow], *, has_code: bool
) -> dict[str, dict[str, Any]]:
    """Payload of each discovery message, by topic.

    Args:
        spec: of the broker.
        rooms: to look into.
        sensors: that are watched.
        has_code: disarming needs the alarm code.
    """
    topics, node = Topics(base=spec.topic), slug(spec.topic)
    device = {"identifiers": [node], "name": spec.name, "manufacturer": "rosbot_patrol", "model": "guard robot"}

    entities: dict[tuple[str, str], dict[str, Any]] = {
        ("alarm_control_panel", "alarm"): _alarm(topics, has_code=has_code),
        ("binary_sensor", "person"): _binary(topics, "person", "Person", "occupancy"),
        ("binary_sensor", "emergency_stop"): _binary(topics, "emergency_stop", "Emergency stop", "safety"),
        ("sensor", "doing"): {"name": "Doing", "state_topic": topics.state("doing"), "icon": "mdi:robot"},
        ("sensor", "battery"): {
            "name": "Battery",
            "state_topic": topics.state("battery"),
            "device_class": "battery",
            "unit_of_measurement": "%",
            "state_class": "measurement",
        },
        ("image", "incident"): {
            "name": "Last incident",
            "image_topic": topics.state("incident_image"),
            "content_type": "image/jpeg",
        },
        ("event", "incident"): {
            "name": "Incident",
            "state_topic": topics.state("incident"),
            "event_types": list(EVENTS),
        },
    }
    for order, name in (("home", "Drive home"), ("all", "Look at all rooms"), ("stop", "Emergency stop")):
        entities["button", order] = {"name": name, "command_topic": topics.order(order)}
    for room in rooms:
        button = {"name": f"Look: {room.name}", "command_topic": topics.order("look"), "payload_press": str(room.id)}
        entities["button", f"look_{room.id}"] = button
    for sensor in sensors:
        key = f"motion_{sensor.id}"
        entities["binary_sensor", key] = _binary(topics, key, f"Motion: {sensor.name}", "motion")
    return {
        f"{spec.discovery}/{component}/{node}/{key}/config": {
            **entity,
            "unique_id": f"{node}_{key}" if component != "event" else f"{node}_{key}_event",
            "availability_topic": topics.status,
            "device": device,
        }
        for (component, key), entity in entities.items()
    }


def _binary(topics: Topics, key: str, name: str, kind: str) -> dict[str, Any]:
    return {"name": name, "state_topic": topics.state(key), "device_class": kind}


def _alarm(topics: Topics, *, has_code: bool) -> dict[str, Any]:
    panel: dict[str, Any] = {
        "name": None,
        "state_topic": topics.state("alarm"),
        "command_topic": topics.order("alarm"),
        "command_template": _CODE,
        "supported_features": ["arm_home", "arm_away", "arm_night"],
        "code_arm_required": False,
        "code_disarm_required": has_code,
    }
    if has_code:
        panel["code"] = "REMOTE_CODE"  # the guard checks it, Home Assistant does not know it
    return panel
