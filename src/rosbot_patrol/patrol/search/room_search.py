"""What the look around has seen of a room, where to look from next, and what moved there: the `Views` of a mission."""

from __future__ import annotations

import logging
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rosbot_patrol.geometry import Pose2D, angle_difference, transform_points, wrap_angle
from rosbot_patrol.params import param
from rosbot_patrol.patrol.house.floor import Mask
from rosbot_patrol.patrol.house.regions import RoomRegions
from rosbot_patrol.patrol.house.rooms import Room
from rosbot_patrol.patrol.intruder.close_ups import BEYOND, Sighting
from rosbot_patrol.patrol.intruder.lidar_motion import Witness, WitnessParams, off_the_map
from rosbot_patrol.patrol.intruder.pets_seen_whole import Harmless
from rosbot_patrol.patrol.intruder.second_looks import Doubt, Doubts
from rosbot_patrol.patrol.intruder.weak_sightings import Suspect
from rosbot_patrol.patrol.records.inputs import Eye, Inputs
from rosbot_patrol.patrol.records.mission import Mission
from rosbot_patrol.patrol.visibility.coverage import Coverage, CoverageParams, Sight, sight_of_scan, sight_on_map
from rosbot_patrol.patrol.visibility.viewpoints import Viewpoint, ViewpointParams, ViewpointPlanner
from rosbot_patrol.scan import scan_points

log = logging.getLogger(__name__)

VIEW_WIDTH = 1.047  # where no camera has told its own [rad]
_ROBOT = 0.25  # so near to what stands off the map no viewpoint lies [m]
_STAY = 1.5  # somebody half hidden shows surely in one picture and hardly in the next [s]
_STAY_NEAR = 3.0  # a pet rests for some seconds before it goes on [s]
_SWEEP = 0.5  # past what looks a little like a person [rad]
_LATE = 0.15  # a turn that would have begun so far back is begun where the robot stands [rad]


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
    witness: WitnessParams = WitnessParams()


class Eyes:
    """Keeps what was seen of the room of one mission.

    Args:
        params: how thoroughly to look.
    """

    def __init__(self, params: SightParams | None = None) -> None:
        self.params = params or SightParams()
        self.coverage: Coverage | None = None
        self._witness = Witness(self.params.witness)
        self._harmless = Harmless()
        self._mission: Mission | None = None
        self._house: RoomRegions | None = None
        self._planner: ViewpointPlanner | None = None
        self._width = VIEW_WIDTH
        self._has_eye = False
        self._began: float | None = None
        self._now = 0.0
        self._views = self._second_looks = 0
        self._tried: list[tuple[float, float]] = []
        self._doubts = Doubts(self.params.coverage.seen_in)
        self._calls, self._called_at, self._seen_before = 0, -math.inf, 0.0

    # -- Views

    def start(self, mission: Mission) -> None:
        """Begin with a room; what earlier viewpoints showed before a restart is taken from the map."""
        self._mission, self.coverage, self._began = mission, None, None
        self._views = self._second_looks = 0
        self._tried, self._has_eye = [], False
        self._calls, self._called_at, self._seen_before = mission.triggers, -math.inf, 0.0
        self._doubts = Doubts(self.params.coverage.seen_in)
        self._witness.start()
        self._harmless = Harmless()

    def see(self, now: float, inputs: Inputs) -> None:
        """Take in what detector and lidar saw since the last step."""
        self._now = now
        self._settle_in(inputs)
        if self._mission is not None and self._mission.triggers > self._calls:
            self._calls, self._called_at = self._mission.triggers, now
        if self._house is None:
            return
        view = inputs.scan
        if view is not None:
            self._witness.see(view.scan, view.map_from_laser, self._house.floor)
            if self._moves_here(view.scan.stamp):
                self._called_at = now
        sight: Sight | None = None
        for frame in inputs.frames:
            if frame.eye is None or self.coverage is None:
                continue
            self._has_eye, self._width = True, frame.eye.width
            sight = sight or self._sight(inputs, frame.eye)
            self.coverage.look(frame.eye, sight, now)
            for box in frame.boxes:
                if box.doubt is not None:
                    self._doubts.far(box.label, *box.doubt)
            self._doubts.look(frame.stamp, frame.eye, sight)
            if view is not None:
                self._harmless.look(view.scan.stamp, frame.eye, sight, frame.boxes, self._witness.things)

    def suspect(self, doubtful: Sequence[Suspect]) -> None:
        """Look at what seems to be a person from another side."""
        self._doubts.suspect(doubtful)

    def step_back(self, doubtful: Sequence[Sighting]) -> None:
        """Look from farther off at what is too near to be told from a pet."""
        self._doubts.near(doubtful)

    def harmless(self) -> Sequence[Sighting]:
        """What moves, was shown whole, and was taken for nobody."""
        return self._harmless.sightings

    def next(self, inputs: Inputs) -> Viewpoint | None:
        """The best further viewpoint within the bounds; where there is none, one for what may have changed."""
        found = self._next(inputs)
        return self._next(inputs) if found is None and self._looks_again() else found

    def _moves_here(self, stamp: float) -> bool:
        """Whether the lidar sees what has moved in the mission's room at a time [s]: as good as the sensor's call."""
        house, mission = self._house, self._mission
        if house is None or mission is None:
            return False
        moving = (thing for thing in self._witness.things if thing.has_moved and thing.at >= stamp)
        return any(house.room_at(thing.x, thing.y) == mission.room.id for thing in moving)

    def _looks_again(self) -> bool:
        """Whether somebody may have come to where it was looked at before; once in a mission."""
        mission = self._mission
        if not self.params.viewpoints.look_again or self.coverage is None or mission is None or mission.sightings:
            return False
        if self._called_at == -math.inf or self._seen_before:
            return False
        self._seen_before = self.coverage.share
        self.coverage.forget(self._called_at)
        if self.coverage.share == self._seen_before:
            return False
        log.info("%s: something moved there meanwhile: what was seen before is looked at again", mission.room.title)
        self._began, self._views, self._tried = self._now, 0, []
        return True

    def _next(self, inputs: Inputs) -> Viewpoint | None:
        p, mission = self.params, self._mission
        self._began = self._now if self._began is None else self._began
        if p.look_around == "spin" or mission is None or self.coverage is None or inputs.pose is None:
            return None
        if not self._has_eye:
            return None
        wanted, least = self.coverage.unseen(), None
        if self.coverage.share >= p.viewpoints.coverage_goal:
            wanted, least = self._hideouts(wanted), math.pi * p.viewpoints.hideout**2
        is_late = self._now - self._began > p.viewpoints.viewpoints_time
        if not is_late and self._second_looks < p.viewpoints.second_looks_most:
            self._doubts.follow((thing.x, thing.y) for thing in self._witness.things if thing.has_moved)
            doubts = self._of_here(self._doubts.open())
            nearer = self._nearer(doubts, inputs.pose, inputs) if doubts else None
            if nearer is not None:
                self._second_looks += 1
                return nearer
        if not wanted.any():
            return None
        if is_late or self._views >= p.viewpoints.viewpoints_most:
            why = "time is up" if is_late else "enough were tried"
            log.info("%s: no further viewpoint, %s", mission.room.title, why)
            return None
        assert self._planner is not None
        found = self._planner.next(
            inputs.pose,
            self._room(mission.room),
            wanted,
            width=self._width,
            stands=self._stands(inputs),
            tried=tuple(self._tried),
            least=least,
        )
        if found is not None:
            self._views += 1
            self._tried.append((found.pose.x, found.pose.y))
            log.info(
                "%s: %.0f %% of the floor seen, on to (%.1f, %.1f), which shows %.1f m2 more",
                mission.room.title,
                100.0 * self.coverage.share,
                found.pose.x,
                found.pose.y,
                found.gain,
            )
        return found

    def turn_from(self, pose: Pose2D | None, view: Viewpoint) -> float:
        """How far to turn from where the robot stands [rad]: to the beginning first, where it is not yet there."""
        if pose is None or view.turn >= math.tau:
            return view.turn
        ahead = angle_difference(view.pose.yaw, pose.yaw)
        if not view.turn:
            return ahead % math.tau if abs(ahead) > _LATE else 0.0
        return min(max(view.turn + (ahead if ahead > -_LATE else ahead + math.tau), 0.0), math.tau)

    def share(self) -> float | None:
        """Of the room's floor that was seen, None where no map shows any or no camera tells what it sees."""
        if self.coverage is None or not self.coverage.area or not self._has_eye:
            return None
        return max(self.coverage.share, self._seen_before)

    def blind(self) -> str:
        """Why what was seen is too little."""
        doubts = self._of_here(self._doubts.grave())
        if doubts:
            return doubts[0].text
        unsure = self._doubts.unsure(bool(self._witness.text()))
        if unsure:
            return unsure
        share = self.share()
        if share is None or share >= self.params.clear_share:
            return ""
        return f"only {share:.0%} of its floor could be seen"

    def is_seen(self) -> bool:
        """Whether as much of the floor was seen as is wanted."""
        share = self.share()
        return share is not None and share >= self.params.viewpoints.coverage_goal

    def moved(self) -> str:
        """What the lidar saw move."""
        return self._witness.text()

    # -- for a room whose own point cannot be reached

    def instead(self, room: Room, inputs: Inputs, most: int = 3) -> list[Pose2D]:
        """Other poses from which a room is seen, the best first."""
        self._settle_in(inputs)
        if self._house is None or self._planner is None or inputs.pose is None:
            return []
        tried = [(room.pose.x, room.pose.y)]
        found: list[Pose2D] = []
        for _ in range(most):
            view = self._planner.instead(inputs.pose, self._room(room), tried=tuple(tried), width=self._width)
            if view is None:
                break
            found.append(view.pose)
            tried.append((view.pose.x, view.pose.y))
        return found

    # -- doubts

    def _of_here(self, doubts: Sequence[Doubt]) -> list[Doubt]:
        """Those in the mission's room, or right before the robot."""
        house, mission = self._house, self._mission
        if house is None or mission is None:
            return []
        return [d for d in doubts if d.is_near or house.room_at(*self._before_walls(d, house)) == mission.room.id]

    @staticmethod
    def _before_walls(doubt: Doubt, house: RoomRegions) -> tuple[float, float]:
        """What is measured beyond a wall stands before it."""
        if not doubt.seen_from:
            return doubt.x, doubt.y
        eye = doubt.seen_from[-1]
        return house.floor.before((eye.x, eye.y), doubt.x, doubt.y, BEYOND)

    def _nearer(self, doubts: Sequence[Doubt], pose: Pose2D, inputs: Inputs) -> Viewpoint | None:
        """A viewpoint for the first doubt that has one."""
        assert self._planner is not None
        # Last by the map alone: move_base gets through where we see no way.
        stood = self._stands(inputs), None
        for doubt in doubts:
            manners = [(stands, span) for stands in stood for span in doubt.spans]
            found = next(filter(None, (self._view_of(doubt, pose, *manner) for manner in manners)), None)
            if found is not None:
                doubt.visit(found.pose)
                log.info(
                    "something like a %s at (%.1f, %.1f) is to be looked at from (%.1f, %.1f)",
                    doubt.label,
                    doubt.x,
                    doubt.y,
                    found.pose.x,
                    found.pose.y,
                )
                return self._second_look(doubt, found)
        return None

    @staticmethod
    def _second_look(doubt: Doubt, view: Viewpoint) -> Viewpoint:
        """For how long, and what looks a little like a person is turned over: each picture shows it otherwise."""
        if doubt.is_near:
            return replace(view, stay=_STAY_NEAR)
        if not doubt.seen_from:
            return view
        first = view.pose._replace(yaw=wrap_angle(view.pose.yaw - _SWEEP / 2.0))
        return replace(view, pose=first, turn=_SWEEP, stay=_STAY)

    def _view_of(self, doubt: Doubt, pose: Pose2D, stands: Mask | None, span: Mapping[str, float]) -> Viewpoint | None:
        assert self._planner is not None
        return self._planner.near(
            pose,
            doubt.x,
            doubt.y,
            stands=stands,
            seen_from=doubt.seen_from,
            tried=doubt.tried,
            **span,
        )

    # -- parts

    def _settle_in(self, inputs: Inputs) -> None:
        """Take the newest map of the house, and begin with the room where it has not yet."""
        p = self.params
        if inputs.house is not None and inputs.house is not self._house and self.coverage is None:
            self._house = inputs.house
            self._planner = ViewpointPlanner(inputs.house.floor, p.viewpoints, p.coverage)
        if self._house is None or self._mission is None or self.coverage is not None:
            return
        self.coverage = Coverage(self._house.floor, self._room(self._mission.room), p.coverage)
        for x, y, yaw in self._mission.views_done:
            self._recall_turn(x, y, yaw)

    def _recall_turn(self, x: float, y: float, yaw: float) -> None:
        assert self.coverage is not None
        assert self._house is not None
        sight = sight_on_map(self._house.floor, x, y, self.params.coverage.view_range)
        for k in range(12 * self.params.coverage.seen_in):
            self.coverage.look(Eye(pose=Pose2D(x, y, yaw + math.tau * k / 12.0), width=self._width), sight)

    def _room(self, room: Room) -> Mask:
        assert self._house is not None
        return self._house.mask(room.id)

    def _sight(self, inputs: Inputs, eye: Eye) -> Sight:
        assert self._house is not None
        floor, reach = self._house.floor, self.params.coverage.view_range
        if inputs.scan is None:
            return sight_on_map(floor, eye.pose.x, eye.pose.y, reach)
        return sight_of_scan(inputs.scan.scan, inputs.scan.map_from_laser, floor, reach)

    def _hideouts(self, unseen: Mask) -> Mask:
        """Unseen floor that is large enough to hide somebody."""
        radius = self.params.viewpoints.hideout
        if self._house is None or radius <= 0.0:
            return np.zeros(unseen.shape, bool)
        return self._house.floor.open_to(unseen, radius)

    def _stands(self, inputs: Inputs) -> Mask | None:
        """Where no way leads: what the lidar sees and the map does not know, and whoever was met; None: no idea."""
        if self._house is None or self._mission is None:
            return None
        floor, met = self._house.floor, [place for place in self._mission.people if place is not None]
        if inputs.scan is None and not met:
            return None
        mask = np.zeros(floor.info.shape, bool)
        if inputs.scan is not None:
            points = transform_points(inputs.scan.map_from_laser, scan_points(inputs.scan.scan))
            off = off_the_map(floor, points, self.params.witness.off_map)
            mask |= floor.mark_near(off, _ROBOT)
        if met:
            mask |= floor.mark_near(np.array(met), self.params.person_distance)
        return mask
