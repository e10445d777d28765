#!/usr/bin/env python3
"""Listener to /motion_trigger for rosserial.py: `rosserial_ear.py rospy|raw`, with one command per line on stdin.

`rospy` is an ordinary subscriber. `raw` reads the publisher's TCPROS connection itself, which measures the bridge
without rospy's receiving side. Commands: {"clear": true}, {"count": N, "within": SECONDS} (waits for that many),
{"save": FILE} (time of arrival [ns, CLOCK_MONOTONIC] and id | move << 8 of each message).
"""

from __future__ import annotations

import in_workspace  # noqa: F401 - first: it finds the interpreter

# isort: split
import json
import socket
import sys
import threading
import time
import xmlrpc.client
from io import BytesIO

import numpy as np
import rosgraph
from rosgraph.network import read_ros_handshake_header, write_ros_handshake_header

from rosbot_patrol.rosserial.protocol.topics import ESP_TRIGGER_MD5

TOPIC = "/motion_trigger"
FRAME = 6  # bytes of a TCPROS frame: a length, id, move


class RawEar:
    """One TCPROS connection."""

    def __init__(self) -> None:
        self.count = 0
        self._pieces: list[tuple[int, int, bytes]] = []  # time, offset in the stream, bytes
        self._offset = 0
        self._link = self._connect()
        threading.Thread(target=self._run, daemon=True).start()

    def _connect(self) -> socket.socket:
        master = rosgraph.Master("/raw_ear")
        publishers = dict(master.getSystemState()[0])[TOPIC]
        bridge = xmlrpc.client.ServerProxy(master.lookupNode(publishers[0]))
        _, _, (_, host, port) = bridge.requestTopic("/raw_ear", TOPIC, [["TCPROS"]])
        link = socket.create_connection((host, port))
        header = {"topic": TOPIC, "md5sum": ESP_TRIGGER_MD5, "callerid": "/raw_ear", "type": "rosbot_patrol/EspTrigger"}
        write_ros_handshake_header(link, header)
        read_ros_handshake_header(link, BytesIO(), 4096)
        return link

    def _run(self) -> None:
        while data := self._link.recv(1 << 18):
            self._pieces.append((time.monotonic_ns(), self._offset, data))
            self._offset += len(data)
            self.count = self._offset // FRAME

    def clear(self) -> None:
        """Forget the received messages."""
        self._pieces.clear()
        self._offset = self.count = 0

    def arrivals(self) -> np.ndarray:
        """Time and key of each message; a message arrives with its last byte."""
        pieces = list(self._pieces)
        stream = np.frombuffer(b"".join(data for _, _, data in pieces), np.uint8)
        frames = stream[: len(stream) // FRAME * FRAME].reshape(-1, FRAME)
        ends = np.array([offset + len(data) for _, offset, data in pieces])
        times = np.array([at for at, _, _ in pieces], dtype=np.int64)
        when = times[np.searchsorted(ends, (np.arange(len(frames)) + 1) * FRAME)] if len(frames) else times
        return np.stack([when, frames[:, 4] | frames[:, 5].astype(np.int64) << 8], axis=1)


class RospyEar:
    """An ordinary subscriber."""

    def __init__(self) -> None:
        import rospy
        from rosbot_patrol.msg import EspTrigger

        self._heard: list[tuple[int, int]] = []
        rospy.init_node("ear", anonymous=True, disable_signals=True)
        subscriber = rospy.Subscriber(TOPIC, EspTrigger, self._note, queue_size=1000)
        while not subscriber.get_num_connections():
            time.sleep(0.01)

    def _note(self, message: object) -> None:
        self._heard.append((time.monotonic_ns(), message.id | message.move << 8))  # type: ignore[attr-defined]

    @property
    def count(self) -> int:
        """Number of messages so far."""
        return len(self._heard)

    def clear(self) -> None:
        """Forget the received messages."""
        self._heard.clear()

    def arrivals(self) -> np.ndarray:
        """Time and key of each message."""
        return np.array(self._heard, dtype=np.int64).reshape(-1, 2)


def main() -> int:
    ear = RawEar() if sys.argv[1] == "raw" else RospyEar()
    print(json.dumps({"ready": True}), flush=True)
    for line in sys.stdin:
        command = json.loads(line)
        if "clear" in command:
            ear.clear()
        if "count" in command:
            until = time.monotonic() + command["within"]
            while ear.count < command["count"] and time.monotonic() < until:
                time.sleep(0.002)
        if "save" in command:
            np.save(command["save"], ear.arrivals())
        print(json.dumps({"count": ear.count}), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
