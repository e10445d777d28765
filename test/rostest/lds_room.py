"""An emulated LDS-01 in a room on a pseudo-terminal; a line "unplug" on its standard input pulls the plug.

usage: lds_room.py LINK
"""

import sys
import threading
import time
from pathlib import Path

import numpy as np

from rosbot_patrol.drivers.lds.lds01 import encode
from rosbot_patrol.simulation.devices.serial_line import SerialLine


def main():
    angles = np.radians(np.arange(360.0))
    with np.errstate(divide="ignore"):
        turn = encode(np.minimum(2.0 / np.abs(np.cos(angles)), 1.5 / np.abs(np.sin(angles))))
    line, turns = SerialLine(Path(sys.argv[1])), threading.Event()

    def run():
        while True:
            data = line.read(0.02)
            if data:
                print("heard", data.decode(), flush=True)
                (turns.set if data.endswith(b"b") else turns.clear)()
            if turns.is_set():
                for at in range(0, len(turn), 420):
                    line.write(turn[at : at + 420])
                    time.sleep(0.03)

    threading.Thread(target=run, daemon=True).start()
    print("ready", flush=True)
    for order in sys.stdin:
        if order.strip() == "unplug":
            line.hang_up()


main()
