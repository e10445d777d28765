"""Discovery as Home Assistant's documentation asks for it, states, orders, and the file of the broker."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from rosbot_patrol.console.home_assistant.discovery import Topics, discovery
from rosbot_patrol.console.home_assistant.messages import MqttOrder, order_of, states, status_of
from rosbot_patrol.console.home_assistant.settings import BrokerSpec, load_broker
from rosbot_patrol.console.live.house_state import ArmingNow, BatteryNow, GuardNow, HouseState, RoomMark, SensorNow
from rosbot_patrol.errors import AccessError, ParamError

SPEC = BrokerSpec(host="localhost")
TOPICS = Topics(base="rosbot_patrol")
ROOMS = (RoomMark(id=0, name="base", x=0.0, y=0.0), RoomMark(id=3, name="Küche & Bad", x=1.0, y=2.0))
SENSOR = SensorNow(id=5, name="hall", room_id=5, state="ok", heard=1.0, motion=3.0, text="")
# What the documentation of each component requires, and what it knows besides (of that which is used here).
COMMON = {"name", "unique_id", "availability_topic", "device"}
SCHEMAS = {
    "alarm_control_panel": (
        {"command_topic", "state_topic"},
        {"command_template", "supported_features", "code", "code_arm_required", "code_disarm_required"},
    ),
    "binary_sensor": ({"state_topic"}, {"device_class"}),
    "sensor": ({"state_topic"}, {"device_class", "unit_of_measurement", "state_class", "icon"}),
    "image": ({"image_topic"}, {"content_type"}),
    "event": ({"state_topic", "event_types"}, set()),
    "button": ({"command_topic"}, {"payload_press"}),
}


@pytest.mark.parametrize("has_code", [False, True])
def test_discovery_fits_the_documented_schema(has_code: bool) -> None:
    found = discovery(SPEC, ROOMS, (SENSOR,), has_code=has_code)
    for topic, payload in found.items():
        prefix, component, node, key, config = topic.split("/")
        assert (prefix, node, config) == ("homeassistant", "rosbot_patrol", "config")
        required, more = SCHEMAS[component]
        assert required <= payload.keys() <= required | more | COMMON, topic
        assert payload["availability_topic"] == "rosbot_patrol/status"
        assert payload["device"]["identifiers"] == ["rosbot_patrol"]
        assert key.replace("_", "").isalnum()
        json.dumps(payload)
    assert len({payload["unique_id"] for payload in found.values()}) == len(found)
    panel = found["homeassistant/alarm_control_panel/rosbot_patrol/alarm/config"]
    assert panel["code_disarm_required"] is has_code
    assert (panel.get("code") == "REMOTE_CODE") is has_code
    assert "homeassistant/button/rosbot_patrol/look_3/config" in found
    assert "homeassistant/binary_sensor/rosbot_patrol/motion_5/config" in found


@pytest.mark.parametrize(
    ("state", "panel"),
    [
        (HouseState(), "None"),
        (HouseState(arming=ArmingNow(mode="armed_away")), "armed_away"),
        (HouseState(arming=ArmingNow(mode="night")), "armed_night"),
        (HouseState(arming=ArmingNow(mode="armed_away", exit_delay=20.0)), "arming"),
        (HouseState(arming=ArmingNow(mode="armed_away", entry_delay=20.0)), "pending"),
        (
            HouseState(arming=ArmingNow(mode="armed_away"), guard=GuardNow(doing="looking", verdict="confirmed")),
            "triggered",
        ),
    ],
)
def test_the_panel_shows_the_mode_and_what_was_seen(state: HouseState, panel: str) -> None:
    assert states(state, TOPICS)["rosbot_patrol/alarm/state"] == panel


def test_states_of_everything_else() -> None:
    state = HouseState(
        guard=GuardNow(doing="idle", why="on guard"),
        battery=BatteryNow(share=0.456, voltage=11.9, is_charging=False),
        is_heard=True,
        is_stopped=True,
        sensors=(SENSOR, SensorNow(id=6, name="door", room_id=6, state="ok", heard=1.0, motion=90.0, text="")),
    )
    found = states(state, TOPICS)
    assert found["rosbot_patrol/doing/state"] == "on guard"
    assert found["rosbot_patrol/battery/state"] == "46"
    assert found["rosbot_patrol/motion_5/state"] == "ON"
    assert found["rosbot_patrol/motion_6/state"] == "OFF"
    assert found["rosbot_patrol/person/state"] == "OFF"
    assert found["rosbot_patrol/emergency_stop/state"] == "ON"
    assert status_of(state)
    assert not status_of(HouseState(guard=state.guard))


@pytest.mark.parametrize(
    ("name", "payload", "order"),
    [
        ("alarm", b"ARM_NIGHT", MqttOrder(what="arm", mode="night")),
        ("alarm", b'{"action": "DISARM", "code": "2468"}', MqttOrder(what="arm", mode="disarmed", code="2468")),
        ("alarm", b'{"action": "ARM_AWAY", "code": "None"}', MqttOrder(what="arm", mode="armed_away")),
        ("look", b"3", MqttOrder(what="look", room_id=3)),
        ("look", "küche & BAD".encode(), MqttOrder(what="look", room_id=3)),
        ("presence", b"away", MqttOrder(what="arm", mode="armed_away")),
        ("stop", b"PRESS", MqttOrder(what="stop")),
        ("home", b"", MqttOrder(what="home")),
    ],
)
def test_orders(name: str, payload: bytes, order: MqttOrder) -> None:
    assert order_of(f"rosbot_patrol/{name}/set", payload, TOPICS, ROOMS) == order


@pytest.mark.parametrize(
    ("name", "payload", "said"),
    [
        ("alarm", b"OPEN", "is 'OPEN', expected one of ARM_AWAY"),
        ("alarm", b'{"code": 1}', "makes no sense"),
        ("alarm", b"{", "makes no sense"),
        ("alarm", b"\xff\xfe", "expected one of"),
        ("look", b"9", "expected the number or the name of a room"),
        ("presence", b"disarm", "expected home or away"),
        ("release", b"PRESS", "takes no orders"),
        ("a/b", b"", "takes no orders"),
    ],
)
def test_what_is_no_order_is_told(name: str, payload: bytes, said: str) -> None:
    with pytest.raises(AccessError, match=said):
        order_of(f"rosbot_patrol/{name}/set", payload, TOPICS, ROOMS)


def written(folder: Path, text: str) -> Path:
    secret = folder / "password"
    secret.write_text("hush\n")
    secret.chmod(0o600)
    path = folder / "mqtt.yaml"
    path.write_text(text.replace("SECRET", str(secret)))
    return path


def test_the_file_of_the_broker(tmp_path: Path) -> None:
    broker = load_broker(written(tmp_path, "host: broker\nuser: rosbot\npassword_file: SECRET\ntls: true\n"), {})
    assert (broker.where, broker.password) == ("broker:8883", "hush")
    shipped = Path(__file__).resolve().parents[3] / "config" / "mqtt.yaml"
    assert "hush" not in shipped.read_text("utf-8")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("port: 1883\n", "host"),
        ("host: ''\n", "host"),
        ("host: a\nhosts: b\n", "hosts"),
        ("host: a\npassword: hush\n", "a password may not stand in this file"),
        ("host: a\nuser: rosbot\n", "password_file"),
        ("host: a\ntopic: 'a/#'\n", "topic: is 'a/#', expected a topic without"),
        ("host: a\nca_file: /nowhere\n", "ca_file: /nowhere cannot be read"),
        ("host: a\nport: 70000\n", "port"),
    ],
)
def test_mistakes_in_it_are_named(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(ParamError, match=said) as refused:
        load_broker(written(tmp_path, text), {})
    assert "hush" not in str(refused.value)
