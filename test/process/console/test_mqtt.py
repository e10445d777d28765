"""The link to a real mosquitto: states, orders, last will, restarts, a wrong login."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

pytest.importorskip("paho.mqtt", reason="needs paho-mqtt: scripts/bootstrap")

from mosquitto_broker import Listener, Mosquitto

from rosbot_patrol.console.home_assistant.link import BrokerLink
from rosbot_patrol.console.home_assistant.settings import load_broker

BASE = "rosbot_patrol"


@pytest.fixture
def broker(tmp_path: Path) -> Iterator[Mosquitto]:
    broker = Mosquitto(tmp_path)
    yield broker
    broker.stop()


@pytest.fixture
def listener(broker: Mosquitto) -> Iterator[Listener]:
    listener = Listener(broker)
    yield listener
    listener.stop()


@pytest.fixture
def orders() -> list[tuple[str, bytes]]:
    return []


@pytest.fixture
def link(broker: Mosquitto, orders: list[tuple[str, bytes]]) -> Iterator[BrokerLink]:
    link = BrokerLink(load_broker(broker.settings, {}), lambda topic, payload: orders.append((topic, payload)))
    link.start()
    yield link
    link.stop()


def wait(condition: Callable[[], object], seconds: float = 15.0) -> None:
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, "it did not come"
        time.sleep(0.01)


def test_states_go_out_once_and_orders_come_in(
    listener: Listener, link: BrokerLink, orders: list[tuple[str, bytes]]
) -> None:
    link.tell({f"{BASE}/person/state": "OFF"})  # before there is a connection
    link.set_online(is_online=True)
    listener.wait(f"{BASE}/person/state", "OFF")
    listener.wait(f"{BASE}/status", "online")
    for _ in range(3):
        link.tell({f"{BASE}/person/state": "ON"})
    listener.wait(f"{BASE}/person/state", "ON")
    listener.say(f"{BASE}/alarm/set", "ARM_AWAY")
    wait(lambda: orders)
    assert orders == [(f"{BASE}/alarm/set", b"ARM_AWAY")]
    assert listener.history.count((f"{BASE}/person/state", b"ON")) == 1


def test_a_retained_order_is_left_out(broker: Mosquitto, listener: Listener, orders: list[tuple[str, bytes]]) -> None:
    listener.say(f"{BASE}/stop/set", "PRESS", retain=True)
    link = BrokerLink(load_broker(broker.settings, {}), lambda topic, payload: orders.append((topic, payload)))
    link.start()
    try:
        wait(lambda: not link.problem)
        listener.say(f"{BASE}/home/set", "PRESS")
        wait(lambda: orders)
        assert [topic for topic, _ in orders] == [f"{BASE}/home/set"]
    finally:
        link.stop()


def test_a_broker_that_starts_anew_is_told_everything_again(
    broker: Mosquitto, listener: Listener, link: BrokerLink
) -> None:
    link.tell({"homeassistant/sensor/x/config": {"name": "x"}, f"{BASE}/person/state": "ON"})
    listener.wait(f"{BASE}/person/state", "ON")
    broker.stop()
    wait(lambda: link.problem)
    assert "is gone" in link.problem or "cannot be reached" in link.problem
    link.tell({f"{BASE}/person/state": "OFF"})
    listener.heard.clear()
    broker.start()
    listener.wait(f"{BASE}/person/state", "OFF", 30.0)
    assert listener.heard["homeassistant/sensor/x/config"] == b'{"name": "x"}'


def test_home_assistant_that_starts_anew_is_told_everything_again(listener: Listener, link: BrokerLink) -> None:
    link.tell({f"{BASE}/person/state": "ON"})
    listener.wait(f"{BASE}/person/state", "ON")
    listener.heard.clear()
    listener.say("homeassistant/status", "online")
    listener.wait(f"{BASE}/person/state", "ON")


def test_an_orderly_end_says_offline(broker: Mosquitto, listener: Listener) -> None:
    link = BrokerLink(load_broker(broker.settings, {}), lambda _topic, _payload: None)
    link.start()
    link.set_online(is_online=True)
    listener.wait(f"{BASE}/status", "online")
    link.stop()
    listener.wait(f"{BASE}/status", "offline")


def test_a_wrong_login_is_told_and_tried_again(broker: Mosquitto, tmp_path: Path) -> None:
    (tmp_path / "mqtt_password").write_text("wrong")
    link = BrokerLink(load_broker(broker.settings, {}), lambda _topic, _payload: None)
    link.start()
    try:
        wait(lambda: "refuses" in link.problem)
        assert f"the broker at 127.0.0.1:{broker.port} refuses: " in link.problem
        assert "wrong" not in link.problem
    finally:
        link.stop()
