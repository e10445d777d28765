"""Somebody between a sensor and the bridge, who sees and changes every frame; the virtual sensor and the firmware."""

from __future__ import annotations

import random
import socket
import subprocess
import threading
import time
from pathlib import Path

import pytest
from test_server import serving, wait_for

from rosbot_patrol.rosserial.device.tcp_client import EspClient
from rosbot_patrol.rosserial.protocol.packet import Parser, encode
from rosbot_patrol.rosserial.protocol.proof import VERSION, Prover
from rosbot_patrol.rosserial.server.policy import Policy

ROOT = Path(__file__).resolve().parents[3]
PROGRAM = ROOT / ".ws" / "firmware" / "esp_motion_sensor"
KEY = bytes(range(32))
MOTION, TRIGGER = b"\x02\x01", 125


class Between:
    """A program that both take for the other side: a router, or somebody who has bent the Wi-Fi's addresses.

    Attributes:
        meddle: what it makes of a frame of the sensor, given as (topic id, payload): frames for the bridge.
    """

    def __init__(self, bridge: int) -> None:
        self._bridge = bridge
        self.meddle = self.pass_on
        self.frames: list[tuple[int, bytes]] = []
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.port = self._listener.getsockname()[1]
        threading.Thread(target=self._serve, daemon=True).start()

    @staticmethod
    def pass_on(topic: int, payload: bytes) -> list[bytes]:
        return [encode(topic, payload)]

    def _serve(self) -> None:
        while True:
            try:
                sensor, _ = self._listener.accept()
            except OSError:
                return
            bridge = socket.create_connection(("127.0.0.1", self._bridge))
            for pump, *ends in ((self._up, sensor, bridge), (self._down, bridge, sensor)):
                threading.Thread(target=pump, args=ends, daemon=True).start()

    def _up(self, sensor: socket.socket, bridge: socket.socket) -> None:
        parser = Parser()
        try:
            while data := sensor.recv(4096):
                for packet in parser.feed(data):
                    self.frames.append((packet.topic_id, packet.data))
                    for frame in self.meddle(packet.topic_id, packet.data):
                        bridge.sendall(frame)
        except OSError:
            pass  # the other side has hung up
        bridge.close()

    def _down(self, bridge: socket.socket, sensor: socket.socket) -> None:
        try:
            while data := bridge.recv(4096):
                sensor.sendall(data)
        except OSError:
            pass  # the other side has hung up
        sensor.close()

    def close(self) -> None:
        self._listener.close()


class Virtual:
    def __init__(self, port: int) -> None:
        self._client = EspClient("127.0.0.1", port, 2, key=KEY, insist=True).start()
        self.move, self.stop = self._client.trigger, self._client.stop


class Firmware:
    def __init__(self, port: int) -> None:
        if not PROGRAM.exists():
            done = subprocess.run(["make", "-s", "-C", str(ROOT / "firmware" / "host"), "sensor"], capture_output=True)
            assert done.returncode == 0, done.stderr.decode()
        words = ["--port", str(port), "--id", "2", "--key", KEY.hex(), "--insist", "--warm-up", "0", "--after-reset"]
        self._process = subprocess.Popen(
            [str(PROGRAM), "--host", "127.0.0.1", *words], stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True
        )

    def _tell(self, line: str) -> None:
        assert self._process.stdin is not None
        self._process.stdin.write(line + "\n")
        self._process.stdin.flush()

    def move(self) -> None:
        self._tell("motion 1")
        time.sleep(0.1)
        self._tell("motion 0")

    def stop(self) -> None:
        self._process.kill()
        self._process.wait()


def is_motion(topic: int, payload: bytes) -> bool:
    return topic == TRIGGER and payload[:2] == MOTION


def inject(between: Between):
    """Each heartbeat is followed by a motion that nobody made."""
    rng = random.Random(1)

    def meddle(topic: int, payload: bytes) -> list[bytes]:
        forged = MOTION + payload[2:6] + rng.randbytes(8)
        return [encode(topic, payload), *([encode(TRIGGER, forged)] if topic == TRIGGER else [])]

    return meddle


def without_signature(between: Between):
    return lambda topic, payload: [encode(topic, payload), *([encode(TRIGGER, MOTION)] if topic == TRIGGER else [])]


def replay(between: Between):
    """What the sensor said of an earlier motion is said again after each heartbeat."""
    old = next(payload for topic, payload in between.frames if is_motion(topic, payload))
    return lambda topic, payload: [encode(topic, payload), *([encode(TRIGGER, old)] if topic == TRIGGER else [])]


def rewrite(between: Between):
    """A heartbeat becomes a motion, with the heartbeat's signature."""
    return lambda topic, payload: [encode(topic, (MOTION if topic == TRIGGER else payload[:2]) + payload[2:])]


def reorder(between: Between):
    held: list[bytes] = []

    def meddle(topic: int, payload: bytes) -> list[bytes]:
        held.append(encode(topic, payload))
        if len(held) < 2:
            return []
        frames, held[:] = held[::-1], []
        return frames

    return meddle


@pytest.mark.parametrize("sensor_of", [Virtual, Firmware], ids=["virtual", "firmware"])
@pytest.mark.parametrize("attack", [inject, without_signature, replay, rewrite, reorder])
def test_nothing_of_it_is_believed_and_the_sensor_comes_back(attack, sensor_of, caplog):
    with serving(Policy(keys={2: KEY})) as (recorder, _, port):
        between = Between(port)
        sensor = sensor_of(between.port)
        wait_for(lambda: recorder.messages, 15.0)
        sensor.move()
        wait_for(lambda: recorder.messages.count(MOTION) == 1, 5.0)
        caplog.clear()
        between.meddle = attack(between)
        wait_for(lambda: "somebody in between has changed what the sensor says" in caplog.text, 15.0)
        assert recorder.messages.count(MOTION) == 1
        between.meddle = between.pass_on
        before = len(recorder.messages)
        wait_for(lambda: len(recorder.messages) > before, 15.0)
        sensor.move()
        wait_for(lambda: recorder.messages.count(MOTION) >= 2, 15.0)
        sensor.stop()
        between.close()


@pytest.mark.parametrize("sensor_of", [Virtual, Firmware], ids=["virtual", "firmware"])
def test_a_motion_that_is_kept_back_comes_all_the_same(sensor_of, caplog):
    """The next frame shows that one is missing; the sensor has no receipt, and says it again."""
    with serving(Policy(keys={2: KEY})) as (recorder, _, port):
        between = Between(port)
        sensor = sensor_of(between.port)
        wait_for(lambda: recorder.messages, 15.0)
        dropped = []

        def suppress(topic: int, payload: bytes) -> list[bytes]:
            if is_motion(topic, payload) and not dropped:
                dropped.append(payload)
                return []
            return [encode(topic, payload)]

        between.meddle = suppress
        sensor.move()
        wait_for(lambda: "somebody in between has changed" in caplog.text, 15.0)
        wait_for(lambda: recorder.messages.count(MOTION) == 1, 15.0)
        assert dropped
        sensor.stop()
        between.close()


def test_older_firmware_is_told_of(caplog):
    from rosbot_patrol.rosserial.device import tcp_client

    class Older(Prover):
        def __init__(self, sensor_id: int, key: bytes) -> None:
            super().__init__(sensor_id, key, VERSION)

    with pytest.MonkeyPatch.context() as patch, serving(Policy(keys={2: KEY})) as (recorder, _, port):
        patch.setattr(tcp_client, "Prover", Older)
        sensor = EspClient("127.0.0.1", port, 2, key=KEY).start()
        wait_for(lambda: recorder.messages, 5.0)
        assert caplog.text.count("sensor 2 has older firmware: what it says is not signed") == 1
        sensor.stop()
