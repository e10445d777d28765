"""True share of a room's floor that was in view, from the true poses and the world's own shapes.

It uses the patrol's own definition, but neither the map, the scans nor the robot's estimate of its pose.
"""

from __future__ import annotations

import math

import numpy as np

from rosbot_patrol.campaign.floor import EYE, VIEW_WIDTH, Floor
from rosbot_patrol.campaign.truth import Track
from rosbot_patrol.geometry import Pose2D, distance
from rosbot_patrol.patrol.visibility.coverage import Coverage, CoverageParams, Eye, Sight
from rosbot_patrol.simulation.scene.slices import Slice

RATE = 10.0  # rate of images at the detector, in simulated time [Hz]
_BEAMS = 720
_SAME = 0.01  # positions closer than this share one view [m]


def true_share(
    floor: Floor, room: int, robot: Track, begin: float, end: float, *, params: CoverageParams | None = None
) -> float:
    """Share of a room's floor that was in view, 0 to 1.

    Args:
        floor: of the house.
        room: number of the room.
        robot: its true poses.
        begin: of the mission [s].
        end: of the look around [s].
        params: what counts as seen, as the patrol has it.
    """
    params = params or CoverageParams()
    cut = floor.ways.cut(EYE)
    coverage = Coverage(floor.plan, floor.regions.mask(room), params)
    last: tuple[Pose2D, Sight] | None = None
    for time in np.arange(begin, end, 1.0 / RATE):
        pose = robot.at(float(time))
        if pose is None:
            continue
        if last is None or distance(last[0], pose) > _SAME:
            last = pose, _sight(cut, pose, params.view_range + params.view_slack)
        coverage.look(Eye(pose=pose, width=VIEW_WIDTH), last[1])
    return coverage.share


def _sight(cut: Slice, pose: Pose2D, reach: float) -> Sight:
    step = math.tau / _BEAMS
    return Sight(pose.x, pose.y, 0.0, step, cut.cast(pose.x, pose.y, 0.0, step, _BEAMS, longest=reach))
