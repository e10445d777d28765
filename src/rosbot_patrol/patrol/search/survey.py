"""What was seen of the room of one mission, on the map of the house."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from rosbot_patrol.geometry import Pose2D, transform_points
from rosbot_patrol.params import param
from rosbot_patrol.patrol.belief.hypothesis import Hypothesis
from rosbot_patrol.patrol.house.floor import Mask
from rosbot_patrol.patrol.house.regions import RoomRegions
from rosbot_patrol.patrol.intruder.lidar_motion import LidarMotionParams, LidarTrack, off_the_map
from rosbot_patrol.patrol.records.inputs import Eye, Inputs
from rosbot_patrol.patrol.records.mission import Mission
from rosbot_patrol.patrol.visibility.coverage import Coverage, CoverageParams, Sight, free_way, sight_on_map
from rosbot_patrol.patrol.visibility.viewpoints import ViewpointParams, ViewpointPlanner
from rosbot_patrol.scan import scan_points

_ROBOT = 0.25  # [m] minimum distance of a viewpoint from anything that stands off the map
_BEYOND = 0.8  # [m] beyond a wall that something stands before it may be measured
_RECALLED = 12  # pictures that a full turn before a restart stands for


@dataclass(frozen=True, kw_only=True)
class SightParams:
    """Thoroughness of a room's search; the patrol node has these as its own parameters."""

    look_around: str = param(
        "full",
        choices=("full", "spin"),
        doc="full: search from further viewpoints, too; spin: one turn at the room's point",
    )
    person_distance: float = param(
        1.0, unit="m", lo=0.0, doc="minimum distance of viewpoints and routes from anyone already met"
    )
    clear_share: float = param(
        0.5,
        lo=0.0,
        hi=1.0,
        doc="share of the floor that must be seen for the verdict clear; with less it is unverified",
    )
    coverage: CoverageParams = CoverageParams()
    viewpoints: ViewpointParams = ViewpointParams()
    witness: LidarMotionParams = LidarMotionParams()


@dataclass(frozen=True)
class Ground:
    """A map of the house, and the planner of viewpoints on it."""

    house: RoomRegions
    planner: ViewpointPlanner


class Survey:
    """What was seen of the room of one mission.

    Full turns that the mission made before a restart count as seen.

    Args:
        mission: whose room.
        ground: the map.
        params: thoroughness.
        width: angle that a picture spans [rad].

    Attributes:
        coverage: seen floor; mask: cells of the room.
    """

    def __init__(self, mission: Mission, ground: Ground, params: SightParams, width: float) -> None:
        self.mission, self.planner = mission, ground.planner
        self._house, self._params = ground.house, params
        self.mask = ground.house.mask(mission.room.id)
        self.coverage = Coverage(ground.house.floor, self.mask, params.coverage)
        for x, y, yaw in mission.views_done:
            self._recall_turn(Pose2D(x, y, yaw), width)

    def sight(self, inputs: Inputs, eye: Eye) -> Sight:
        """How far one can look from a camera: by the scan, or by the map if there is none."""
        return free_way(self._house.floor, inputs.scan, eye, self._params.coverage.view_range)

    def has_motion(self, tracks: Iterable[LidarTrack], stamp: float) -> bool:
        """Whether something that moved is in the room at a time [s]."""
        moving = (track for track in tracks if track.has_moved and track.at >= stamp)
        return any(self._house.room_at(track.x, track.y) == self.mission.room.id for track in moving)

    def doubts_here(self, doubts: Iterable[Hypothesis]) -> list[Hypothesis]:
        """The hypotheses in the room, those that were only seen from very close, and those without a place."""
        room = self.mission.room.id
        return [
            each
            for each in doubts
            if each.is_near_only or not each.is_placed or self._house.room_at(*self.before_walls(each)) == room
        ]

    def wanted(self) -> tuple[Mask, float | None]:
        """Floor that is worth a viewpoint, and the area that one has to show of it at least [m2], None by default."""
        unseen, p = self.coverage.unseen(), self._params.viewpoints
        if self.coverage.share < p.coverage_goal:
            return unseen, None
        return self._hideouts(unseen), math.pi * p.hideout**2

    def blocked(self, inputs: Inputs) -> Mask | None:
        """Cells that no route may cross, None if there are none.

        These are near what the lidar sees and the map does not know, and near persons who were met.
        """
        floor, met = self._house.floor, [place for place in self.mission.people if place is not None]
        if inputs.scan is None and not met:
            return None
        mask = np.zeros(floor.info.shape, bool)
        if inputs.scan is not None:
            points = transform_points(inputs.scan.map_from_laser, scan_points(inputs.scan.scan))
            mask |= floor.mark_near(off_the_map(floor, points, self._params.witness.off_map), _ROBOT)
        if met:
            mask |= floor.mark_near(np.array(met), self._params.person_distance)
        return mask

    def _hideouts(self, unseen: Mask) -> Mask:
        """Unseen floor that is large enough to hide somebody."""
        radius = self._params.viewpoints.hideout
        return self._house.floor.hideouts(unseen, radius) if radius > 0.0 else np.zeros(unseen.shape, bool)

    def before_walls(self, doubt: Hypothesis) -> tuple[float, float]:
        """The place of a hypothesis, moved before the wall if it was measured beyond one."""
        x, y = float(doubt.place[0]), float(doubt.place[1])
        if not doubt.sides:
            return x, y
        eye = doubt.sides[-1].eye
        return self._house.floor.before((eye.x, eye.y), x, y, _BEYOND)

    def _recall_turn(self, pose: Pose2D, width: float) -> None:
        p = self._params.coverage
        sight = sight_on_map(self._house.floor, pose.x, pose.y, p.view_range)
        for k in range(_RECALLED * p.seen_in):
            self.coverage.look(Eye(pose=pose._replace(yaw=pose.yaw + math.tau * k / _RECALLED), width=width), sight)
