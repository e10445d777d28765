"""mark_rooms FILE: points clicked in rviz ("Publish Point") become the patrol's points file.

The first point is the base, each further one a room; a room's number is the id of its motion sensor. Each is checked on
the map of `map` (whether the robot can stand, turn and get there), and the program asks for its name on the terminal.
The file is written after each point. If it exists, its rooms stay and more are added. `~markers` shows them in rviz.

Subscribes to `clicked_point` (geometry_msgs/PointStamped, in any frame known to tf) and `map`.
"""

from __future__ import annotations

import argparse
import logging
import queue
import sys
import time
from pathlib import Path
from typing import NoReturn

import rospy
from geometry_msgs.msg import PointStamped
from nav_msgs.msg import OccupancyGrid
from visualization_msgs.msg import MarkerArray

from rosbot_patrol.counts import count_of
from rosbot_patrol.errors import MapError, ParamError, TransformError
from rosbot_patrol.geometry import Pose2D, compose
from rosbot_patrol.patrol.house.floor import Floor, floor_of
from rosbot_patrol.patrol.house.rooms import load_rooms, save_rooms
from rosbot_patrol.patrol.visibility.marking import Marks
from rosbot_patrol.ros.messages.convert import grid_from_msg
from rosbot_patrol.ros.messages.fast_arrays import GridMsg
from rosbot_patrol.ros.runtime.latest import Latest
from rosbot_patrol.ros.runtime.node import Worker, run_node
from rosbot_patrol.ros.runtime.transforms import Transforms
from rosbot_patrol.ros.tools.markers_node import QUIET, room_markers

log = logging.getLogger(__name__)

REMIND_S = 5.0
MAP_WITHIN_S = 60.0  # longest wait for the map: the exploration may have just begun
FRAME = "map"


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        raise ParamError("arguments", f"{message}; expected mark_rooms [--new] FILE")


class _Terminal:
    """Lines from the terminal, read on a thread of their own, so that a shutdown need not wait for one."""

    def __init__(self) -> None:
        self._lines: queue.Queue[str | None] = queue.Queue()
        Worker(self._read, name="terminal").start()

    def _read(self) -> None:
        for line in sys.stdin:
            self._lines.put(line.strip())
        self._lines.put(None)

    def ask(self, question: str) -> str | None:
        """Ask a question; returns the answer, None at the end of the input or at shutdown."""
        print(question, end=" ", flush=True)
        while not rospy.is_shutdown():
            try:
                return self._lines.get(timeout=0.2)
            except queue.Empty:
                continue
        return None


class MarkRooms:
    """Turn clicks into rooms and write the file.

    Args:
        path: path of the points file.
        is_new: start empty, whatever the file contains.
    """

    def __init__(self, path: Path, *, is_new: bool) -> None:
        self._path = path
        self._marks = Marks(load_rooms(path) if path.exists() and not is_new else None)
        self._map: Latest[OccupancyGrid] = Latest()
        self._clicks: queue.Queue[PointStamped] = queue.Queue()
        self._terminal = _Terminal()
        self._transforms = Transforms()
        self._publisher = rospy.Publisher("~markers", MarkerArray, queue_size=1, latch=True)
        rospy.Subscriber("map", GridMsg, lambda message: self._map.set(message, 0.0), queue_size=1)
        rospy.Subscriber("clicked_point", PointStamped, self._clicks.put, queue_size=10)

    def run(self) -> None:
        """Run until the end of the input or shutdown."""
        for room in self._marks.rooms:
            print(f"{room.title} at ({room.pose.x:.2f}, {room.pose.y:.2f})")
        self._show()
        self._wait_for_the_map()
        self._say_what_next()
        while not rospy.is_shutdown() and not self._marks.is_full:
            try:
                click = self._clicks.get(timeout=0.2)
            except queue.Empty:
                continue
            if not self._take(click):
                break
        print(
            f"\n{count_of(len(self._marks.rooms), 'point')} in {self._path}; the launch takes them by"
            f" path_to_params:={self._path.resolve()}"
        )

    def _wait_for_the_map(self) -> None:
        """Wait for the map; clicks are kept meanwhile. Raises MapError after a minute without one."""
        since = told = time.monotonic()
        while self._map.get() is None and not rospy.is_shutdown():
            if time.monotonic() - since > MAP_WITHIN_S:
                raise MapError(rospy.resolve_name("map"), "nobody publishes a map: start the map server or gmapping")
            if time.monotonic() - told > REMIND_S:
                told = time.monotonic()
                log.warning("no map has been published on %s yet", rospy.resolve_name("map"))
            time.sleep(0.1)

    def _say_what_next(self) -> None:
        what = f"room {len(self._marks.rooms)}" if self._marks.rooms else "the base, where the robot waits"
        print(f'Click on {what} with "Publish Point" in rviz. Ctrl-C ends.', flush=True)

    def _take(self, click: PointStamped) -> bool:
        """Process one click; False if no more will come."""
        try:
            x, y = self._place(click)
            problem = self._marks.problem(self._floor(), x, y)
        except (TransformError, MapError) as err:
            log.warning("the click is left out: %s", err)
            return True
        if problem:
            log.warning("(%.2f, %.2f) is left out: %s", x, y, problem)
            return True
        name = self._name(x, y)
        if name is None:
            return False
        if name:
            room = self._marks.add(name, x, y)
            save_rooms(self._path, self._marks.rooms)
            print(f"{room.title} at ({x:.2f}, {y:.2f}) is in {self._path}")
            self._show()
        else:
            print("left out")
        self._say_what_next()
        return True

    def _name(self, x: float, y: float) -> str | None:
        """Ask for the name of a place: "" to skip it, None if no more answers will come."""
        number = len(self._marks.rooms)
        what = f"room {number}" if number else "the base"
        while True:
            name = self._terminal.ask(f"Name of {what} at ({x:.2f}, {y:.2f}), empty to leave it out:")
            problem = self._marks.name_problem(name) if name else ""
            if not problem:
                return name
            print(f"{problem}; another one?")

    def _place(self, click: PointStamped) -> tuple[float, float]:
        """The click in the map frame [m]. Raises TransformError."""
        frame = click.header.frame_id.lstrip("/")
        if frame in ("", FRAME):
            return click.point.x, click.point.y
        pose = compose(self._transforms.lookup(FRAME, frame), Pose2D(click.point.x, click.point.y, 0.0))
        return pose.x, pose.y

    def _floor(self) -> Floor:
        """The newest map. Raises MapError."""
        message = self._map.get()
        topic = rospy.resolve_name("map")
        if message is None:
            raise MapError(topic, "no map has been published yet")
        return floor_of(grid_from_msg(message, topic))

    def _show(self) -> None:
        message = MarkerArray()
        for room in self._marks.rooms:
            message.markers += room_markers(room, QUIET)
        self._publisher.publish(message)


def arguments_of(words: list[str]) -> argparse.Namespace:
    """Parse the command line (without remappings): file, new; raises ParamError."""
    parser = _Parser(prog="mark_rooms", description="Points clicked in rviz become the patrol's points file.")
    parser.add_argument("file", metavar="FILE", type=Path, help="points file to write, or to add rooms to")
    parser.add_argument("--new", action="store_true", help="begin anew, whatever FILE holds")
    return parser.parse_args(words)


def body() -> None:
    """Ask, check, write."""
    wanted = arguments_of(rospy.myargv(sys.argv)[1:])
    if not wanted.file.parent.is_dir():
        raise ParamError("FILE", f"is {wanted.file}, but there is no folder {wanted.file.parent}")
    MarkRooms(wanted.file, is_new=wanted.new).run()


def main() -> None:
    """Run the program."""
    if {"-h", "--help"} & set(sys.argv[1:]):
        arguments_of(["--help"])
    run_node("mark_rooms", body, by_hand=True)
