"""A real mosquitto on a port of its own, with one login."""

from __future__ import annotations

import shutil
import socket
import subprocess
import time
from pathlib import Path

import paho.mqtt.client as mqtt
import pytest
from paho.mqtt.enums import CallbackAPIVersion

USER, PASSWORD = "rosbot", "hush-hush"


class Mosquitto:
    """The broker; it may be stopped and started again, without memory of what it was told."""

    def __init__(self, folder: Path) -> None:
        if shutil.which("mosquitto") is None:
            pytest.skip("needs mosquitto")
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self.port = int(free.getsockname()[1])
        passwords = folder / "passwords"
        subprocess.run(["mosquitto_passwd", "-b", "-c", str(passwords), USER, PASSWORD], check=True)
        passwords.chmod(0o644)
        self._file = folder / "mosquitto.conf"
        self._file.write_text(f"listener {self.port} 127.0.0.1\npassword_file {passwords}\nuser root\n")
        secret = folder / "mqtt_password"
        secret.write_text(PASSWORD)
        secret.chmod(0o600)
        self.settings = folder / "mqtt.yaml"
        self.settings.write_text(f"host: 127.0.0.1\nport: {self.port}\nuser: {USER}\npassword_file: {secret}\n")
        self.start()

    def start(self) -> None:
        self._process = subprocess.Popen(["mosquitto", "-c", str(self._file)], stderr=subprocess.DEVNULL)
        deadline = time.monotonic() + 10.0
        while time.monotonic() < deadline:
            with socket.socket() as probe:
                if probe.connect_ex(("127.0.0.1", self.port)) == 0:
                    return
            time.sleep(0.05)
        raise AssertionError("mosquitto does not listen")

    def stop(self) -> None:
        self._process.terminate()
        self._process.wait(10.0)


class Listener:
    """Another program at the broker: hears everything, keeps the newest by topic."""

    def __init__(self, broker: Mosquitto) -> None:
        self.heard: dict[str, bytes] = {}
        self.history: list[tuple[str, bytes]] = []
        self._client = mqtt.Client(CallbackAPIVersion.VERSION2)
        self._client.username_pw_set(USER, PASSWORD)
        self._client.on_connect = lambda client, *_: client.subscribe("#", 1)
        self._client.on_message = self._on_message
        self._client.reconnect_delay_set(1, 1)
        self._client.connect("127.0.0.1", broker.port)
        self._client.loop_start()

    def _on_message(self, _client: object, _user: object, message: mqtt.MQTTMessage) -> None:
        self.heard[message.topic] = bytes(message.payload)
        self.history.append((message.topic, bytes(message.payload)))

    def say(self, topic: str, payload: str, *, retain: bool = False) -> None:
        self._client.publish(topic, payload, qos=1, retain=retain).wait_for_publish(5.0)

    def wait(self, topic: str, payload: str, seconds: float = 15.0) -> None:
        deadline = time.monotonic() + seconds
        while self.heard.get(topic) != payload.encode():
            assert time.monotonic() < deadline, f"{topic} is {self.heard.get(topic)!r}, expected {payload!r}"
            time.sleep(0.01)

    def stop(self) -> None:
        self._client.disconnect()
        self._client.loop_stop()
