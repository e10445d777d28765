"""An emulated RPLIDAR in a room of 4 x 3 m, on a pseudo-terminal or a port; told by lines on its standard input.

usage: rplidar_room.py MODEL LINK|tcp:PORT|udp:PORT [any_speed]
"""

import contextlib
import random
import select
import socket
import sys
import threading
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from rosbot_patrol.simulation.devices.rplidar import MODELS, RplidarDevice
from rosbot_patrol.simulation.devices.serial_line import SerialLine, serve


def room(angle):
    radians = np.radians(angle)
    with np.errstate(divide="ignore"):
        return np.minimum(2000 / np.abs(np.cos(radians)), 1500 / np.abs(np.sin(radians)))


class NetworkLine:
    """One end of a TCP or UDP port on loopback, for the device; the newest peer has it."""

    baud = 0

    def __init__(self, kind, port):
        self.is_tcp = kind == "tcp"
        self.server = socket.socket(type=socket.SOCK_STREAM if self.is_tcp else socket.SOCK_DGRAM)
        self.server.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        self.server.bind(("127.0.0.1", port))
        if self.is_tcp:
            self.server.listen()
        self.peer = None

    def read(self, timeout):
        links = [self.server] if self.peer is None or not self.is_tcp else [self.server, self.peer]
        for link in select.select(links, [], [], timeout)[0]:
            if link is self.server and self.is_tcp:
                self.peer = self.server.accept()[0]
            elif self.is_tcp:
                data = self.peer.recv(4096)
                self.peer = self.peer if data else None
                return data
            else:
                data, self.peer = self.server.recvfrom(4096)
                return data
        return b""

    def write(self, data):
        if self.peer is None:
            return
        with contextlib.suppress(OSError):
            self.peer.sendall(data) if self.is_tcp else self.server.sendto(data, self.peer)

    def hang_up(self):
        if self.is_tcp and self.peer is not None:
            self.peer.close()
        self.server.close()


class Room:
    def __init__(self, model, link, any_speed):
        self.kind = MODELS[model]
        self.device = RplidarDevice(self.kind, room)
        self.link = link
        self.baud = None if any_speed else self.kind.baud
        self.line = None
        self.is_noisy = False

    def stream(self, now):
        if self.is_noisy:
            return random.Random(now).randbytes(20)
        return self.device.stream(now)

    def feed(self, data, now):
        return b"" if self.is_noisy else self.device.feed(data, now)

    def plug_in(self):
        kind, _, port = self.link.partition(":")
        self.line = NetworkLine(kind, int(port)) if port else SerialLine(Path(self.link))
        line = self.line
        self.thread = threading.Thread(
            target=serve, args=(self, line, lambda: self.line is line), kwargs={"baud": self.baud}, daemon=True
        )
        self.thread.start()

    def unplug(self):
        line, self.line = self.line, None
        self.thread.join()
        line.hang_up()

    def obey(self, words):
        if words == ["unplug"]:
            self.unplug()
        elif words == ["plug_in"]:
            self.device = RplidarDevice(self.device.kind, room)  # it has lost its power
            self.plug_in()
        elif words == ["stall"]:
            self.device.motor = 0
        elif words == ["noise"]:
            self.is_noisy = True
        elif words[0] == "health":
            self.device.kind = replace(self.device.kind, health=int(words[1]))
        elif words == ["blind"]:
            self.device.distances = lambda angle: np.zeros_like(angle)
        elif words == ["tell"]:
            requests = [each.hex(" ") for each in self.device.requests]
            print(f"motor {self.device.motor} scanning {self.device.is_scanning} requests {requests}", flush=True)
            return
        print("done", *words, flush=True)


def main():
    room_ = Room(sys.argv[1], sys.argv[2], "any_speed" in sys.argv[3:])
    room_.plug_in()
    print("ready", flush=True)
    for line in sys.stdin:
        room_.obey(line.split())
        time.sleep(0.01)


main()
