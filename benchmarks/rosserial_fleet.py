#!/usr/bin/env python3
"""Hundreds of motion sensors in one process, for rosserial.py: one JSON command per line on stdin, answers on stdout.

    {"connect": N, "port": P}           N sensors, each from a loopback address of its own; until all are negotiated
                                        ("keys": FILE if the bridge asks for them)
    {"steady": SECONDS, "save": FILE}   each sends a heartbeat every 0.5 s, at random phases (seeded)
    {"flood": COUNT}                    each sends COUNT heartbeats as fast as the bridge takes them
    {"reconnect": SECONDS}              all drop their connections at once, come back and report
    {"comeback": SECONDS}               wait until the bridge has gone and all are back, and report
    {"bye": true}                       all disconnect

Times are CLOCK_MONOTONIC in ns, the same clock in all processes of a machine.
"""

from __future__ import annotations

import in_workspace  # noqa: F401 - first: it finds the interpreter

# isort: split
import heapq
import json
import random
import selectors
import socket
import struct
import sys
import time
from typing import Any

import numpy as np

from rosbot_patrol.rosserial.device.client_session import DeviceSession
from rosbot_patrol.rosserial.protocol.keys import read_keys
from rosbot_patrol.rosserial.protocol.packet import encode
from rosbot_patrol.rosserial.protocol.proof import Prover
from rosbot_patrol.rosserial.protocol.topics import ESP_TRIGGER_MD5, TopicInfo, pack_esp_trigger

INFO = TopicInfo(topic_id=125, name="motion_trigger", message_type="rosbot_patrol/EspTrigger", md5=ESP_TRIGGER_MD5)
PERIOD = 0.5
IDS = 250  # further sensors share an id with another one, at another address


class Sensor:
    """One client. `waiting` has its unsent bytes."""

    def __init__(self, number: int) -> None:
        self.sensor_id = number % IDS
        self.key = self.sensor_id | (number // IDS % 2) << 8  # id and `move`: identifies one of 500
        self.source = f"127.1.{number // 200}.{number % 200 + 1}"
        self.link: socket.socket | None = None
        self.session = DeviceSession([INFO])
        self.waiting = b""
        self.retry_at = 0.0
        self.answered = False  # the bridge has sent the time after the topics, so it knows them
        self.secret: bytes | None = None
        self.breaks = 0

    def frame(self, *, move: bool = False) -> bytes:
        """Make a heartbeat, or a trigger, without a signature."""
        return encode(INFO.topic_id, pack_esp_trigger(self.sensor_id, move))

    def say(self, *, move: bool = False) -> None:
        """Queue a heartbeat, or a trigger: signed where the sensor has a key."""
        if self.secret is None:
            self.waiting += self.frame(move=move)
        else:
            self.session.publish(INFO.topic_id, pack_esp_trigger(self.sensor_id, move))


class Fleet:
    """All sensors and one selector."""

    def __init__(self) -> None:
        self.sensors: list[Sensor] = []
        self.port = 0
        self._selector = selectors.DefaultSelector()

    def open(self, sensor: Sensor) -> None:
        """Start to connect."""
        link = socket.socket()
        link.setblocking(False)
        link.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        link.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)  # its port must not prevent a bridge from listening
        link.bind((sensor.source, 0))
        link.connect_ex(("127.0.0.1", self.port))
        prover = Prover(sensor.sensor_id, sensor.secret) if sensor.secret is not None else None
        session = DeviceSession([INFO], prover=prover)
        sensor.link, sensor.session, sensor.waiting, sensor.answered = link, session, b"", False
        self._selector.register(link, selectors.EVENT_READ, sensor)

    def drop(self, sensor: Sensor, *, abruptly: bool = False) -> None:
        """Close a connection, with a reset if `abruptly`."""
        if sensor.link is None:
            return
        self._selector.unregister(sensor.link)
        if abruptly:
            sensor.link.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        sensor.link.close()
        sensor.link = None

    def serve(self, timeout: float) -> None:
        """Read and answer once; a broken connection is reopened 0.2 s later."""
        now = time.monotonic()
        for key, _ in self._selector.select(max(timeout, 0.0)):
            self._read(key.data, now)
        for sensor in self.sensors:
            if sensor.link is None and now >= sensor.retry_at:
                self.open(sensor)

    def flush(self, sensor: Sensor) -> None:
        """Send as much as the connection takes."""
        sensor.waiting += b"".join(sensor.session.take_output())
        if not sensor.waiting or sensor.link is None:
            return
        try:
            sensor.waiting = sensor.waiting[sensor.link.send(sensor.waiting) :]
        except BlockingIOError:
            return
        except OSError:
            self._broken(sensor)

    def _read(self, sensor: Sensor, now: float) -> None:
        if sensor.link is None:
            return
        try:
            data = sensor.link.recv(4096)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        if not data:
            self._broken(sensor)
            return
        sensor.session.receive(data, now)
        sensor.answered |= sensor.session.server_time(now) is not None
        self.flush(sensor)

    def _broken(self, sensor: Sensor) -> None:
        sensor.breaks += 1
        self.drop(sensor)
        sensor.retry_at = time.monotonic() + 0.2

    def wait_all(self, seconds: float) -> int:
        """Serve until the bridge knows all; returns how many it knows."""
        until = time.monotonic() + seconds
        while (known := sum(s.answered for s in self.sensors)) < len(self.sensors) and time.monotonic() < until:
            self.serve(0.05)
        return known


def connect(fleet: Fleet, command: dict[str, Any]) -> dict[str, Any]:
    fleet.port = command["port"]
    fleet.sensors = [Sensor(number) for number in range(command["connect"])]
    keys = read_keys(command["keys"]) if "keys" in command else {}
    for sensor in fleet.sensors:
        sensor.secret = keys.get(sensor.sensor_id)
        fleet.open(sensor)
    return {"known": fleet.wait_all(30.0)}


def steady(fleet: Fleet, command: dict[str, Any]) -> dict[str, Any]:
    """Send heartbeats; saves the time of each `send`, and its id."""
    rng = random.Random(6)
    begin = time.monotonic()
    due = [(begin + rng.uniform(0.0, PERIOD), n) for n in range(len(fleet.sensors))]
    heapq.heapify(due)
    sent: list[tuple[int, int]] = []
    end, late = begin + command["steady"], 0.0
    while (now := time.monotonic()) < end:
        while due[0][0] <= now:
            at, number = due[0]
            heapq.heapreplace(due, (at + PERIOD, number))
            sensor = fleet.sensors[number]
            if sensor.link is not None and sensor.answered:
                late = max(late, now - at)
                sensor.session.tick(now)  # asks for the time every 2.5 s
                sensor.say()
                sent.append((time.monotonic_ns(), sensor.sensor_id))
                fleet.flush(sensor)
            now = time.monotonic()
        fleet.serve(min(due[0][0] - time.monotonic(), 0.1))
    with open(command["save"], "wb") as file:
        np.save(file, np.array(sent, dtype=np.int64))
    linked = sum(s.link is not None for s in fleet.sensors)
    return {"sent": len(sent), "late_ms": 1e3 * late, "linked": linked, "breaks": sum(s.breaks for s in fleet.sensors)}


def flood(fleet: Fleet, command: dict[str, Any]) -> dict[str, Any]:
    """Send as fast as the bridge reads."""
    for sensor in fleet.sensors:
        sensor.waiting += sensor.frame() * command["flood"]
    began = time.monotonic_ns()
    while any(s.waiting for s in fleet.sensors):
        for sensor in fleet.sensors:
            fleet.flush(sensor)
        fleet.serve(0.0)
    return {"began": began, "sent": len(fleet.sensors) * command["flood"]}


def reconnect(fleet: Fleet, command: dict[str, Any]) -> dict[str, Any]:
    """Drop all connections at once and reconnect; each sends one message as soon as the bridge knows it."""
    for sensor in fleet.sensors:
        fleet.drop(sensor, abruptly=True)
    began = time.monotonic_ns()
    for sensor in fleet.sensors:
        fleet.open(sensor)
    return {"began": began, "known": report(fleet, command["reconnect"])}


def comeback(fleet: Fleet, command: dict[str, Any]) -> dict[str, Any]:
    """Reconnect as in `reconnect`, when the bridge is killed and comes back."""
    for sensor in fleet.sensors:
        sensor.answered = False
    return {"known": report(fleet, command["comeback"])}


def report(fleet: Fleet, seconds: float) -> int:
    """Let each send one message as soon as the bridge knows it; returns how many have."""
    waiting = list(fleet.sensors)
    until = time.monotonic() + seconds
    while waiting and time.monotonic() < until:
        fleet.serve(0.05)
        for sensor in waiting:
            if sensor.answered:
                sensor.say(move=bool(sensor.key >> 8))
                fleet.flush(sensor)
        waiting = [sensor for sensor in waiting if not sensor.answered]
    return len(fleet.sensors) - len(waiting)


def bye(fleet: Fleet, _command: dict[str, Any]) -> dict[str, Any]:
    for sensor in fleet.sensors:
        fleet.drop(sensor)
    fleet.sensors = []
    return {}


def main() -> int:
    fleet = Fleet()
    does = {
        "connect": connect,
        "steady": steady,
        "flood": flood,
        "reconnect": reconnect,
        "comeback": comeback,
        "bye": bye,
    }
    for line in sys.stdin:
        command = json.loads(line)
        act = next(function for name, function in does.items() if name in command)
        print(json.dumps(act(fleet, command)), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
