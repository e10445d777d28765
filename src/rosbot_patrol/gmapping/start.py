"""Start of slam_gmapping: with an empty map, or on a saved one."""

from __future__ import annotations

import logging

from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.gmapping.parameters import GmappingParams
from rosbot_patrol.gmapping.slam import Slam
from rosbot_patrol.maps.map_io import read_map

log = logging.getLogger(__name__)


def started(params: GmappingParams) -> Slam:
    """Make a Slam, on a saved map if the parameters name one.

    Raises:
        MapError: the saved map cannot be read or does not fit.
    """
    if not params.map_file:
        return Slam(params)
    saved = read_map(params.map_file)
    start = Pose2D(params.initial_pose_x, params.initial_pose_y, params.initial_pose_a)
    log.info("Going on with the map %s from %.2f %.2f %.2f", params.map_file, *start)
    return Slam(params, saved=saved, start=start)
