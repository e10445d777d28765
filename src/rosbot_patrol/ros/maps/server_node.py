"""map_server: a map from disk, latched on `map` and served on request.

Matches map_server of ROS Noetic's navigation 1.17: argument `FILE.yaml`, or a picture and its resolution (deprecated);
latched topics `map` and `map_metadata`; services `static_map` (nav_msgs/GetMap) and `change_map` (nav_msgs/LoadMap);
parameter `~frame_id`, and for a bare picture `~negate`, `~occupied_thresh` and `~free_thresh`.

Differs: portable grey maps need no picture library; OpenCV reads the others (png, bmp, ...) instead of SDL. The blue
channel of a three-channel picture is not taken for its alpha. A threshold or an origin that is not finite is an error.
`/diagnostics` has the node's health.
"""

from __future__ import annotations

import logging
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import rospy
from nav_msgs.msg import MapMetaData
from nav_msgs.srv import GetMapResponse, LoadMapRequest, LoadMapResponse

from rosbot_patrol.errors import MapError, ParamError
from rosbot_patrol.grid import Grid
from rosbot_patrol.maps.map_io import MapFile, read_grid, read_map_file
from rosbot_patrol.maps.occupancy import Thresholds
from rosbot_patrol.params import param
from rosbot_patrol.patrol.house.own_files import own_file
from rosbot_patrol.ros.messages.convert import grid_to_msg
from rosbot_patrol.ros.messages.fast_arrays import GetMapFast, GridMsg, LoadMapFast
from rosbot_patrol.ros.runtime.diagnostics import OK, WARN, Health
from rosbot_patrol.ros.runtime.node import load_params, now, run_node
from rosbot_patrol.ros.runtime.state_folder import state_folder

log = logging.getLogger(__name__)

USAGE = "expected `map_server FILE.yaml` (or, deprecated, `map_server PICTURE RESOLUTION`)"


@dataclass(frozen=True, kw_only=True)
class MapServerParams:
    """Parameters of map_server; names and defaults as upstream."""

    frame_id: str = param("map", doc="frame of the map")
    negate: int = param(0, choices=(0, 1), doc="white is occupied (only for a bare image)")
    occupied_thresh: float = param(
        0.65, lo=0.0, hi=1.0, doc="darkness above which a cell is occupied (only for a bare image)"
    )
    own_house: bool = param(
        False, doc="ours: use the owner's map, in the guard's state folder, instead of one that comes with the program"
    )
    state_dir: str = param("", doc="ours: that folder; empty: rosbot_patrol in ROS's home")
    free_thresh: float = param(0.196, lo=0.0, hi=1.0, doc="darkness below which a cell is free (only for a bare image)")


class MapServer:
    """Publish one map and replace it on request.

    Args:
        frame: frame of the map.
        grid: the first map.
        path: file of the first map.
    """

    def __init__(self, frame: str, grid: Grid, path: str) -> None:
        self._frame = frame
        self._map = rospy.Publisher("map", GridMsg, queue_size=1, latch=True)
        self._metadata = rospy.Publisher("map_metadata", MapMetaData, queue_size=1, latch=True)
        self._health = Health()
        self._message = self._publish(grid, path)
        self._services = [
            rospy.Service("static_map", GetMapFast, self._get_map),
            rospy.Service("change_map", LoadMapFast, self._change_map),
        ]

    def _publish(self, grid: Grid, path: str) -> GridMsg:
        stamp = now()
        message = GridMsg()
        plain = grid_to_msg(grid, self._frame, stamp, load_time=stamp)
        message.header, message.info, message.data = plain.header, plain.info, plain.data
        self._map.publish(message)
        self._metadata.publish(message.info)
        info = grid.info
        log.info("Read a %d X %d map @ %.3f m/cell from %s", info.width, info.height, info.resolution, path)
        self._health.set("", OK, f"serving {path}", {"width": info.width, "height": info.height})
        return message

    def _get_map(self, _request: object) -> GetMapResponse:
        return GetMapFast._response_class(map=self._message)

    def _change_map(self, request: LoadMapRequest) -> LoadMapResponse:
        answer = LoadMapFast._response_class()
        answer.map.data = np.empty(0, dtype=np.int8)
        path = Path(request.map_url.removeprefix("file://"))
        if not path.is_file():
            answer.result = LoadMapResponse.RESULT_MAP_DOES_NOT_EXIST
            return self._refused(answer, f"{path}: there is no such map")
        try:
            map_file = read_map_file(path)
        except MapError as err:
            answer.result = LoadMapResponse.RESULT_INVALID_MAP_METADATA
            return self._refused(answer, str(err))
        try:
            grid = read_grid(map_file)
        except MapError as err:
            answer.result = LoadMapResponse.RESULT_INVALID_MAP_DATA
            return self._refused(answer, str(err))
        self._message = self._publish(grid, str(path))
        answer.map, answer.result = self._message, LoadMapResponse.RESULT_SUCCESS
        return answer

    def _refused(self, answer: LoadMapResponse, why: str) -> LoadMapResponse:
        log.error("change_map: %s; the old map stays", why)
        self._health.set("", WARN, f"change_map was refused: {why}")
        return answer


def read_from_arguments(arguments: list[str], params: MapServerParams) -> tuple[Grid, str]:
    """Read the map that the command line names; returns it with its file.

    Raises:
        MapError: the map cannot be used.
        ParamError: the arguments are invalid.
    """
    if len(arguments) == 1:
        return read_grid(read_map_file(arguments[0])), arguments[0]
    if len(arguments) != 2:
        raise ParamError("arguments", f"{' '.join(arguments) or 'none'}: {USAGE}")
    try:
        resolution = float(arguments[1])
    except ValueError as err:
        raise ParamError("arguments", f"'{arguments[1]}' is no resolution: {USAGE}") from err
    if not 0.0 < resolution < float("inf"):
        raise ParamError("arguments", f"resolution {resolution} makes no sense, expected more than 0 m")
    log.warning("map_server PICTURE RESOLUTION is deprecated, write a yaml and name that")
    thresholds = Thresholds(
        occupied=params.occupied_thresh, free=params.free_thresh, negate=bool(params.negate), mode="trinary"
    )
    picture = MapFile(image=Path(arguments[0]), resolution=resolution, thresholds=thresholds)
    return read_grid(picture), arguments[0]


def body() -> None:
    """Read and publish the map, then answer until shutdown."""
    params = load_params(MapServerParams)
    arguments = rospy.myargv(sys.argv)[1:]
    if params.own_house and len(arguments) == 1:
        folder = state_folder(params.state_dir, rospy.get_namespace())
        arguments = [own_file(arguments[0], folder, "map.yaml")]
    grid, path = read_from_arguments(arguments, params)
    MapServer(params.frame_id, grid, path)
    rospy.spin()


def main() -> None:
    """Run the program."""
    run_node("map_server", body)
