"""An emulated ROSbot's base on a pseudo-terminal; told by lines on its standard input.

usage: rosbot_base.py FIRMWARE LINK
"""

import sys
import threading
from pathlib import Path

from rosbot_patrol.simulation.devices.rosbot_base import FIRMWARES, RosbotBase
from rosbot_patrol.simulation.devices.serial_line import SerialLine, serve


def main():
    base = RosbotBase(FIRMWARES[sys.argv[1]])
    line = SerialLine(Path(sys.argv[2]))
    threading.Thread(
        target=serve, args=(base, line, lambda: True), kwargs={"baud": base.firmware.baud}, daemon=True
    ).start()
    print("ready", flush=True)
    for order in sys.stdin:
        words = order.split()
        if words[0] == "mute":
            base.is_mute = words[1] == "on"
        elif words[0] == "voltage":
            base.voltage = float(words[1])
        elif words[0] == "range":
            base.ranges = {**base.ranges, words[1]: float(words[2])}
        print("speeds", *base.drive.speeds(), "orders", base.orders, flush=True)


main()
