"""An emulated RPLIDAR in a room of 4 x 3 m, on a pseudo-terminal; told by lines on its standard input.

usage: rplidar_room.py MODEL LINK [any_speed]
"""

import random
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


class Room:
    def __init__(self, model, link, any_speed):
        self.kind = MODELS[model]
        self.device = RplidarDevice(self.kind, room)
        self.link = Path(link)
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
        self.line = SerialLine(self.link)
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
