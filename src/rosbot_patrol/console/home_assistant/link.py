"""The connection to the broker: what is said, what is heard, and how it comes back after a break."""

from __future__ import annotations

import json
import logging
import threading
from collections.abc import Callable, Mapping
from typing import Any

import paho.mqtt.client as mqtt
from paho.mqtt.enums import CallbackAPIVersion

from rosbot_patrol.console.home_assistant.discovery import OFFLINE, ONLINE, Topics
from rosbot_patrol.console.home_assistant.settings import Broker

log = logging.getLogger(__name__)

_KEEPALIVE = 20  # [s] after 1.5 times that the broker tells the last will
_LEAST, _MOST = 1, 30  # [s] between two tries to connect


class BrokerLink:
    """Publishes states, retained, and hands orders over.

    Args:
        broker: where.
        on_order: takes the topic and payload of an order, on the link's own thread.

    Attributes:
        problem: why there is no connection, "" where there is one.
    """

    def __init__(self, broker: Broker, on_order: Callable[[str, bytes], None]) -> None:
        self._broker, self._on_order = broker, on_order
        self.topics = Topics(base=broker.spec.topic)
        self.problem = f"the broker at {broker.where} has not answered yet"
        self._lock = threading.Lock()
        self._said: dict[str, bytes] = {}  # retained messages, as the broker should have them
        self._is_online = False
        client = mqtt.Client(CallbackAPIVersion.VERSION2, client_id="", protocol=mqtt.MQTTv311)
        if broker.spec.user:
            client.username_pw_set(broker.spec.user, broker.password)
        if broker.spec.tls:
            client.tls_set(ca_certs=broker.spec.ca_file or None)
        client.will_set(self.topics.status, OFFLINE, qos=1, retain=True)
        client.reconnect_delay_set(_LEAST, _MOST)
        client.on_connect, client.on_disconnect = self._on_connect, self._on_disconnect
        client.on_connect_fail, client.on_message = self._on_connect_fail, self._on_message
        self._client = client

    def start(self) -> None:
        """Connect, and go on trying; returns at once."""
        self._client.connect_async(self._broker.spec.host, self._broker.port, _KEEPALIVE)
        self._client.loop_start()

    def stop(self) -> None:
        """Say goodbye."""
        if not self.problem:
            self._client.publish(self.topics.status, OFFLINE, qos=1, retain=True).wait_for_publish(1.0)
        self._client.disconnect()
        self._client.loop_stop()

    def tell(self, messages: Mapping[str, str | bytes | Mapping[str, Any]]) -> None:
        """Publish what has changed; while there is no connection it is kept for later."""
        with self._lock:
            for topic, payload in messages.items():
                data = _bytes(payload)
                if self._said.get(topic) != data:
                    self._said[topic] = data
                    self._publish(topic, data)

    def tell_once(self, topic: str, payload: Mapping[str, Any]) -> None:
        """Publish an event; nobody hears it later."""
        if not self.problem:
            self._client.publish(topic, _bytes(payload), qos=1)

    def forget(self, topics: set[str]) -> None:
        """Remove retained messages, such as the discovery of a sensor that is gone."""
        with self._lock:
            for topic in topics & self._said.keys():
                del self._said[topic]
                self._publish(topic, b"")

    def set_online(self, *, is_online: bool) -> None:
        """Tell whether the guard is there."""
        self._is_online = is_online
        self.tell({self.topics.status: ONLINE if is_online else OFFLINE})

    @property
    def said(self) -> frozenset[str]:
        """Topics of all retained messages."""
        return frozenset(self._said)

    def _publish(self, topic: str, data: bytes) -> None:
        if not self.problem:
            self._client.publish(topic, data, qos=1, retain=True)

    def _on_connect(self, client: mqtt.Client, _user: Any, _flags: Any, reason: Any, _properties: Any) -> None:
        if reason.is_failure:
            self._fail(f"the broker at {self._broker.where} refuses: {reason}")
            return
        log.info("connected with the broker at %s", self._broker.where)
        self.problem = ""
        client.subscribe([(f"{self.topics.base}/+/set", 1), (f"{self._broker.spec.discovery}/status", 1)])
        self._repeat()

    def _repeat(self) -> None:
        """Tell everything again: the broker, or Home Assistant, may have started anew."""
        with self._lock:
            for topic, data in self._said.items():
                self._publish(topic, data)

    def _on_disconnect(self, _client: Any, _user: Any, _flags: Any, reason: Any, _properties: Any) -> None:
        if not self.problem:
            self._fail(f"the broker at {self._broker.where} is gone: {reason}")

    def _on_connect_fail(self, _client: Any, _user: Any) -> None:
        self._fail(f"the broker at {self._broker.where} cannot be reached")

    def _fail(self, problem: str) -> None:
        if problem != self.problem:
            log.warning("%s; trying on", problem)
        self.problem = problem

    def _on_message(self, _client: Any, _user: Any, message: mqtt.MQTTMessage) -> None:
        if message.topic == f"{self._broker.spec.discovery}/status":
            if message.payload == ONLINE.encode():
                self._repeat()
        elif message.retain:
            log.warning("an order on %s is retained, so nobody knows how old it is: it is left out", message.topic)
        else:
            self._on_order(message.topic, bytes(message.payload))


def _bytes(payload: str | bytes | Mapping[str, Any]) -> bytes:
    if isinstance(payload, bytes):
        return payload
    text = payload if isinstance(payload, str) else json.dumps(payload, ensure_ascii=False)
    return text.encode()
