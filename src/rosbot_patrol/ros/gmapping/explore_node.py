"""explore: drives the robot by move_base until the map has no border to the unknown, drives it home and ends.

Runs beside slam_gmapping (`simulation_gmapping.launch explore:=true`). `~save_map` names the map to write at the end,
as in `map_saver -f`. `~frontiers` shows the borders in rviz.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass

import rospy
from geometry_msgs.msg import Point
from nav_msgs.msg import OccupancyGrid
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from rosbot_patrol.counts import count_of
from rosbot_patrol.errors import MapError, TransformError
from rosbot_patrol.exploration.explorer import Explorer, ExplorerParams
from rosbot_patrol.exploration.frontiers import Frontier
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.grid import Grid
from rosbot_patrol.maps.map_io import write_map
from rosbot_patrol.params import param
from rosbot_patrol.ros.messages.convert import grid_from_msg
from rosbot_patrol.ros.messages.fast_arrays import GridMsg
from rosbot_patrol.ros.patrol.move_base import MoveBase
from rosbot_patrol.ros.runtime.latest import Latest
from rosbot_patrol.ros.runtime.node import load_params, run_node
from rosbot_patrol.ros.runtime.transforms import Transforms

log = logging.getLogger(__name__)

RATE = 5.0  # [1/s]
REMIND_S = 10.0
GREEN = ColorRGBA(0.1, 0.8, 0.3, 0.9)


@dataclass(frozen=True, kw_only=True)
class ExploreParams:
    """Parameters of the node explore."""

    save_map: str = param("", doc="NAME: write the final map to NAME.pgm and NAME.yaml; empty: do not save it")
    base_frame: str = param("base_link", doc="frame of the robot")
    explorer: ExplorerParams = ExplorerParams()


class Explore:
    """The node explore.

    Args:
        given: its parameters.
    """

    def __init__(self, given: ExploreParams) -> None:
        self._given = given
        self._explorer = Explorer(given.explorer)
        self._inbox: Latest[OccupancyGrid] = Latest()
        self._grid: Grid | None = None
        self._frame, self._maps = "map", 0
        self._transforms = Transforms()
        self._publisher = rospy.Publisher("~frontiers", MarkerArray, queue_size=1, latch=True)
        rospy.Subscriber("map", GridMsg, lambda message: self._inbox.set(message, 0.0), queue_size=1)
        self._move_base = MoveBase(self._frame)

    def run(self) -> None:
        """Explore until nothing is left, or until shutdown."""
        said, since = "", 0.0
        rate = rospy.Rate(RATE)
        while not rospy.is_shutdown():
            self._take_map()
            step = self._explorer.step(rospy.get_time(), self._grid, self._maps, self._pose(), self._move_base.link())
            if step.goal is not None:
                self._move_base.send(step.goal)
            if step.frontiers is not None:
                self._show(step.frontiers)
            since += 1.0 / RATE
            if step.text != said or (step.is_waiting and since >= REMIND_S):
                said, since = step.text, 0.0
                log.info("%s", step.text)
            if step.is_done:
                self._end()
                return
            rate.sleep()
        self._move_base.cancel()

    def _take_map(self) -> None:
        message = self._inbox.take()
        if message is None:
            return
        try:
            grid = grid_from_msg(message, rospy.resolve_name("map"))
            grid.info.require_aligned("explore")
        except MapError as err:
            log.warning("a map is left out: %s", err)
            return
        self._grid = grid
        self._maps += 1

    def _pose(self) -> Pose2D | None:
        try:
            return self._transforms.lookup(self._frame, self._given.base_frame)
        except TransformError:
            return None

    def _end(self) -> None:
        log.info(
            "explored: %.0f m2 of floor, %s out of reach",
            self._explorer.area,
            count_of(len(self._explorer.left_out), "border was", "borders were"),
        )
        if self._given.save_map and self._grid is not None:
            pgm, text = write_map(self._given.save_map, self._grid)
            log.info("the map is in %s and %s", pgm, text)

    def _show(self, frontiers: tuple[Frontier, ...]) -> None:
        message = MarkerArray([Marker(action=Marker.DELETEALL)])
        for k, frontier in enumerate(frontiers):
            marker = Marker(ns="frontiers", id=k, type=Marker.SPHERE, color=GREEN)
            marker.header.frame_id = self._frame
            marker.pose.position = Point(frontier.x, frontier.y, 0.0)
            marker.pose.orientation.w = 1.0
            marker.scale.x = marker.scale.y = marker.scale.z = 0.15 + 0.1 * frontier.length
            message.markers.append(marker)
        self._publisher.publish(message)


def main() -> None:
    """Run the program."""
    run_node("explore", lambda: Explore(load_params(ExploreParams)).run())
