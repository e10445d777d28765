"""True share of a room's floor that was in view, from the true poses and the world's own shapes.

It uses the patrol's own definition, but neither the map, the scans nor the robot's estimate of its pose.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from rosbot_patrol.campaign.floor import EYE, VIEW_WIDTH, Floor
from rosbot_patrol.campaign.truth import Track
from rosbot_patrol.geometry import Pose2D, distance
from rosbot_patrol.patrol.visibility.coverage import Coverage, CoverageParams, Eye, Sight
from rosbot_patrol.simulation.scene.slices import Slice

RATE = 10.0  # rate of images at the detector, in simulated time [Hz]
_BEAMS = 720
_PLACES = 60  # tried as viewpoints for floor that was not seen
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
    return seen_floor(floor, room, robot, begin, end, params=params).share


def seen_floor(
    floor: Floor, room: int, robot: Track, begin: float, end: float, *, params: CoverageParams | None = None
) -> Coverage:
    """Floor of a room that was in view; arguments as for `true_share`."""
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
    return coverage


def unseen_shares(floor: Floor, room: int, seen: Coverage) -> dict[str, float]:
    """Shares of a room's floor that were not seen, by the reason.

    Args:
        floor: of the house.
        room: number of the room.
        seen: what was seen of it.

    Returns:
        hidden: no place within the robot's reach shows it; passed over: some place would have shown it.
    """
    whole = floor.regions.mask(room)
    left = seen.unseen()
    if not left.any():
        return {"hidden": 0.0, "passed over": 0.0}
    params = replace(seen.params, seen_in=1)
    possible = Coverage(floor.plan, left, params)
    cut = floor.ways.cut(EYE)
    places = floor.places(room, floor.drivable)
    for x, y in places[:: max(len(places) // _PLACES, 1)]:
        pose = Pose2D(float(x), float(y), 0.0)
        sight = _sight(cut, pose, params.view_range + params.view_slack)
        possible.look(Eye(pose=pose, width=math.tau + 2.0 * params.view_edge), sight)
    count = float(whole.sum())
    return {
        "hidden": float(possible.unseen().sum()) / count,
        "passed over": float(possible.seen().sum()) / count,
    }


def _sight(cut: Slice, pose: Pose2D, reach: float) -> Sight:
    step = math.tau / _BEAMS
    return Sight(pose.x, pose.y, 0.0, step, cut.cast(pose.x, pose.y, 0.0, step, _BEAMS, longest=reach))
