"""The node home_assistant before a real patrol and a real mosquitto: arm, look, an incident, a kill."""

import json
import time
from pathlib import Path

import pytest

pytest.importorskip("rospy", reason="needs ROS: source the workspace first")
pytest.importorskip("paho.mqtt", reason="needs paho-mqtt: scripts/bootstrap")

from mosquitto_broker import Listener, Mosquitto
from patrol_house import wait_until

ROOT = Path(__file__).resolve().parents[2]
BASE = "rosbot_patrol"


@pytest.fixture
def listener(tmp_path):
    broker = Mosquitto(tmp_path)
    listener = Listener(broker)
    listener.settings = broker.settings
    yield listener
    listener.stop()
    broker.stop()


def start(house, listener):
    values = {
        "mqtt": str(listener.settings),
        "path_to_params": str(ROOT / "params" / "room_points.yaml"),
        "state_dir": str(house.folder / "state"),
    }
    return house._start(["rosrun", "rosbot_patrol", "home_assistant"], values)


def test_a_smart_home_arms_looks_and_hears_of_it(house, listener):
    house.start_move_base()
    house.start_patrol()
    node = start(house, listener)
    listener.wait(f"{BASE}/status", "online", 30.0)
    listener.wait(f"{BASE}/alarm/state", "armed_away")
    assert "homeassistant/alarm_control_panel/rosbot_patrol/alarm/config" in listener.heard
    assert json.loads(listener.heard["homeassistant/button/rosbot_patrol/look_3/config"])["name"] == "Look: west alcove"

    began = time.monotonic()
    listener.say(f"{BASE}/alarm/set", '{"action": "ARM_NIGHT", "code": "None"}')
    listener.wait(f"{BASE}/alarm/state", "armed_night")
    assert time.monotonic() - began < 5.0
    listener.say(f"{BASE}/alarm/set", "OPEN_ALL_DOORS")
    listener.say(f"{BASE}/presence/set", "away")
    listener.wait(f"{BASE}/alarm/state", "armed_away")

    house.person = True
    listener.say(f"{BASE}/look/set", "west alcove")
    listener.wait(f"{BASE}/alarm/state", "triggered", 40.0)
    house.person = False
    listener.wait(f"{BASE}/person/state", "OFF", 60.0)
    wait_until(lambda: f"{BASE}/incident/state" in listener.heard, 20, "the event")
    event = json.loads(listener.heard[f"{BASE}/incident/state"])
    assert (event["event_type"], event["room"]) == ("confirmed", "west alcove")
    assert listener.heard[f"{BASE}/incident_image/state"].startswith(b"\xff\xd8")

    orders = [json.loads(line) for line in (house.folder / "state" / "console" / "orders.jsonl").open()]
    assert [order["accepted"] for order in orders] == [True, False, True, True]
    assert {order["who"] for order in orders} == {"MQTT"}

    house.patrol.kill()
    listener.wait(f"{BASE}/status", "offline", 15.0)
    node.kill()
    listener.heard.clear()
    start(house, listener)
    house.start_patrol()
    listener.wait(f"{BASE}/status", "online", 30.0)
    listener.wait(f"{BASE}/alarm/state", "armed_away")
