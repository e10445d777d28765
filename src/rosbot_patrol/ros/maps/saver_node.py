"""map_saver: waits for one map on `map`, writes it to the disk, and ends.

Matches map_saver of ROS Noetic's navigation 1.17: `map_saver [--occ 65] [--free 25] [-f map]`, `map:=TOPIC`; the
pgm and the yaml are equal byte for byte.

Differs: `--crop [METRES]` leaves out what is unknown, but for a margin (1 m). With `-f FOLDER/NAME` the yaml names the
picture `NAME.pgm`, because map_server looks for it beside the yaml (upstream writes `FOLDER/NAME.pgm`, which is then
not found). Until a map comes it logs a line every 10 s. A file is
written whole or not at all. An unwritable file is an error (exit 1); upstream reports success. Typed by hand, it ends
after 5 s without a ROS master.
"""

from __future__ import annotations

import argparse
import logging
import math
import sys
import threading
from typing import NoReturn

import rospy
from nav_msgs.msg import OccupancyGrid

from rosbot_patrol.errors import ParamError
from rosbot_patrol.grid import Grid
from rosbot_patrol.maps.known_part import known_part
from rosbot_patrol.maps.map_io import write_map
from rosbot_patrol.ros.messages.convert import grid_from_msg
from rosbot_patrol.ros.messages.fast_arrays import GridMsg
from rosbot_patrol.ros.runtime.latest import Latest
from rosbot_patrol.ros.runtime.node import run_node

log = logging.getLogger(__name__)

REMIND_S = 10.0


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        raise ParamError("arguments", f"{message}; expected map_saver [--occ 65] [--free 25] [--crop [1.0]] [-f map]")


def arguments_of(words: list[str]) -> argparse.Namespace:
    """Parse the command line (without remappings): occ, free, f; raises ParamError."""
    parser = _Parser(prog="map_saver", description="Save one map to disk.", allow_abbrev=False)
    parser.add_argument("--occ", type=int, default=65, help="from here on a cell is a wall, 1 to 100")
    parser.add_argument("--free", type=int, default=25, help="up to here a cell is free, 0 to 100")
    parser.add_argument(
        "--crop", type=float, nargs="?", const=1.0, metavar="METRES", help="only what is known, and this margin (1.0)"
    )
    parser.add_argument("-f", default="map", metavar="NAME", help="writes NAME.pgm and NAME.yaml")
    found = parser.parse_args(words)
    if not 1 <= found.occ <= 100:
        raise ParamError("--occ", f"is {found.occ}, expected 1 to 100")
    if not 0 <= found.free <= 100:
        raise ParamError("--free", f"is {found.free}, expected 0 to 100")
    if found.occ <= found.free:
        raise ParamError("--free", f"is {found.free}, expected less than --occ {found.occ}")
    if found.crop is not None and not 0.0 <= found.crop < math.inf:
        raise ParamError("--crop", f"is {found.crop}, expected the margin in metres, 0 or more")
    return found


def wait_for_map() -> Grid | None:
    """Wait for the first map, None at shutdown; raises MapError if it is invalid."""
    inbox: Latest[OccupancyGrid] = Latest()
    arrived = threading.Event()

    def store(message: OccupancyGrid) -> None:
        inbox.set(message, 0.0)
        arrived.set()

    topic = rospy.resolve_name("map")
    subscriber = rospy.Subscriber("map", GridMsg, store, queue_size=1)
    log.info("Waiting for the map on %s", topic)
    waited = 0.0
    while not arrived.wait(0.2):
        waited += 0.2
        if rospy.is_shutdown():
            return None
        if waited >= REMIND_S:
            waited = 0.0
            log.warning("still waiting for the map: nothing has been published on %s", topic)
    subscriber.unregister()
    message = inbox.get()
    assert message is not None
    return grid_from_msg(message, topic)


def body() -> None:
    """Wait for the map and write it."""
    wanted = arguments_of(rospy.myargv(sys.argv)[1:])
    grid = wait_for_map()
    if grid is None:
        return
    info = grid.info
    log.info("Received a %d X %d map @ %.3f m/pix", info.width, info.height, info.resolution)
    if wanted.crop is not None:
        grid = known_part(grid, wanted.crop)
        log.info("Its known part has %d X %d cells", grid.info.width, grid.info.height)
    pgm, text = write_map(wanted.f, grid, occupied=wanted.occ, free=wanted.free)
    log.info("Writing map occupancy data to %s", pgm)
    log.info("Writing map occupancy data to %s", text)
    log.info("Done")


def main() -> None:
    """Run the program."""
    if {"-h", "--help"} & set(sys.argv[1:]):
        arguments_of(["--help"])
    run_node("map_saver", body, by_hand=True, anonymous=False)
