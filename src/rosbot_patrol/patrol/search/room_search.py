"""The search of a room: what was seen, where to look from next, what moved there. It is the `Views` of a mission."""

from __future__ import annotations

import logging
import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from rosbot_patrol.geometry import Pose2D, angle_difference, wrap_angle
from rosbot_patrol.grid import GridInfo
from rosbot_patrol.patrol.belief.belief import Belief
from rosbot_patrol.patrol.belief.hypothesis import Hypothesis
from rosbot_patrol.patrol.belief.second_look import best_second_look
from rosbot_patrol.patrol.house.floor import Mask
from rosbot_patrol.patrol.house.rooms import Room
from rosbot_patrol.patrol.intruder.lidar_motion import LidarMotion, LidarTrack
from rosbot_patrol.patrol.records.inputs import Inputs
from rosbot_patrol.patrol.records.mission import Mission
from rosbot_patrol.patrol.search.survey import Ground, SightParams, Survey
from rosbot_patrol.patrol.visibility.coverage import Sight
from rosbot_patrol.patrol.visibility.viewpoints import Viewpoint, ViewpointPlanner

log = logging.getLogger(__name__)

VIEW_WIDTH = 1.047  # [rad] until a camera has told its own
_STAY = 1.5  # [s] somebody half hidden shows well in one picture and hardly in the next
_STAY_NEAR = 3.0  # [s] a pet rests for some seconds before it goes on
_SWEEP = 0.5  # [rad] sweep of the camera, centred on what looks a little like a person
_LOOKS = 4  # second looks at one hypothesis
_LATE = 0.15  # [rad] a turn that should have begun this far back begins where the robot stands


@dataclass(kw_only=True)
class _Search:
    """The search of one mission's room.

    Attributes:
        survey: what was seen, None until the map comes; has_eye: a camera tells what it sees.
        belief: who may be there.
        now, began: steady time of the last step, and of the end of the first viewpoint, inf before [s].
        views, second_looks: viewpoints chosen; tried: where [m].
        calls: of the room's sensor; called_at: when it or the lidar last told of motion [s].
        seen_before: share of the floor that was seen before it was looked at again, 0 if it was not.
    """

    mission: Mission
    belief: Belief
    calls: int
    survey: Survey | None = None
    has_eye: bool = False
    now: float = 0.0
    began: float = math.inf
    views: int = 0
    second_looks: int = 0
    tried: list[tuple[float, float]] = field(default_factory=list)
    called_at: float = -math.inf
    seen_before: float = 0.0


class RoomSearch:
    """Searches the room of one mission after the other.

    Args:
        params: thoroughness.
    """

    def __init__(self, params: SightParams | None = None) -> None:
        self.params = params or SightParams()
        self._ground: Ground | None = None  # until the map comes
        self._width = VIEW_WIDTH
        self._lidar_motion = LidarMotion(self.params.witness)
        self._started: _Search | None = None

    # -- Views

    def start(self, mission: Mission, belief: Belief) -> None:
        """Begin with a room; viewpoints done before a restart count as seen, by the map."""
        self._lidar_motion.start()
        self._started = _Search(mission=mission, belief=belief, calls=mission.triggers)

    @property
    def _search(self) -> _Search:
        if self._started is None:
            raise RuntimeError("the search of a room has to be started first")
        return self._started

    def see(self, now: float, inputs: Inputs) -> None:
        """Take in what detector and lidar saw since the last step."""
        search, view = self._search, inputs.scan
        search.now = now
        self._settle_in(inputs)
        if search.mission.triggers > search.calls:
            search.calls, search.called_at = search.mission.triggers, now
        if self._ground is None or search.survey is None:
            return
        if view is not None:
            self._lidar_motion.see(view.scan, view.map_from_laser, self._ground.house.floor)
            if search.survey.has_motion(self._lidar_motion.tracks, view.scan.stamp):  # as good as the sensor's call
                search.called_at = now
        self._see_frames(search, search.survey, inputs)

    def _see_frames(self, search: _Search, survey: Survey, inputs: Inputs) -> None:
        sight: Sight | None = None
        for frame in inputs.frames:
            if frame.eye is None:
                continue
            search.has_eye, self._width = True, frame.eye.width
            sight = sight or survey.sight(inputs, frame.eye)
            survey.coverage.look(frame.eye, sight, search.now)

    def tracks(self) -> Sequence[LidarTrack]:
        """What the lidar follows."""
        return self._lidar_motion.tracks

    def share(self) -> float | None:
        """Share of the room's floor that was seen, None without a map of it or a camera."""
        search = self._started
        if search is None or search.survey is None or not search.survey.coverage.area or not search.has_eye:
            return None
        return max(search.survey.coverage.share, search.seen_before)

    def seen_floor(self) -> tuple[GridInfo, Mask] | None:
        """The floor's grid and the part of the room that was seen, None without a map of it or a camera."""
        search = self._started
        if self._ground is None or search is None or search.survey is None or not search.has_eye:
            return None
        return self._ground.house.floor.info, search.survey.coverage.seen()

    def blind(self) -> str:
        """Reason why the room cannot be called clear, "" if it can."""
        search, share = self._started, self.share()
        if search is None:
            return ""
        doubts = search.belief.open if search.survey is None else search.survey.doubts_here(search.belief.open)
        if doubts:
            return search.belief.why(doubts[0])
        is_enough = share is None or share >= self.params.clear_share
        return "" if is_enough else f"only {share:.0%} of its floor could be seen"

    def is_seen(self) -> bool:
        """Whether as much of the floor was seen as is wanted."""
        share = self.share()
        return share is not None and share >= self.params.viewpoints.coverage_goal

    def moved(self) -> str:
        """What the lidar saw move, "" if nothing did."""
        return self._lidar_motion.text()

    def turn_from(self, pose: Pose2D | None, view: Viewpoint) -> float:
        """Angle to turn from where the robot stands [rad], the turn to the view's beginning with it."""
        if pose is None or view.turn >= math.tau:
            return view.turn
        ahead = angle_difference(view.pose.yaw, pose.yaw)
        if not view.turn:
            return ahead % math.tau if abs(ahead) > _LATE else 0.0
        return min(max(view.turn + (ahead if ahead > -_LATE else ahead + math.tau), 0.0), math.tau)

    # -- the next viewpoint

    def next(self, inputs: Inputs) -> Viewpoint | None:
        """The best further viewpoint within the bounds; if there is none, one for what may have changed."""
        search = self._search
        search.began = min(search.began, search.now)
        if search.survey is None:
            return None
        found = self._next(search, search.survey, inputs)
        if found is None and self._looks_again(search, search.survey):
            found = self._next(search, search.survey, inputs)
        return found

    def _next(self, search: _Search, survey: Survey, inputs: Inputs) -> Viewpoint | None:
        p = self.params.viewpoints
        if self.params.look_around == "spin" or inputs.pose is None or not search.has_eye:
            return None
        wanted, least = survey.wanted()
        is_late = search.now - search.began > p.viewpoints_time
        if not is_late and search.second_looks < p.second_looks_most:
            view = self._second_look(search, survey, inputs.pose, inputs)
            if view is not None:
                search.second_looks += 1
                return view
        if not wanted.any():
            return None
        if is_late or search.views >= p.viewpoints_most:
            why = "time is up" if is_late else "enough were tried"
            log.info("%s: no further viewpoint, %s", search.mission.room.title, why)
            return None
        view = survey.planner.next(
            inputs.pose,
            survey.mask,
            wanted,
            width=self._width,
            stands=survey.blocked(inputs),
            tried=tuple(search.tried),
            least=least,
        )
        if view is not None:
            self._note_view(search, survey, view)
        return view

    @staticmethod
    def _note_view(search: _Search, survey: Survey, view: Viewpoint) -> None:
        search.views += 1
        search.tried.append((view.pose.x, view.pose.y))
        log.info(
            "%s: %.0f %% of the floor seen, on to (%.1f, %.1f), which shows %.1f m2 more",
            search.mission.room.title,
            100.0 * survey.coverage.share,
            view.pose.x,
            view.pose.y,
            view.gain,
        )

    def _looks_again(self, search: _Search, survey: Survey) -> bool:
        """Whether somebody may have come to floor that was seen before; once in a mission."""
        coverage = survey.coverage
        if not self.params.viewpoints.look_again or search.mission.sightings:
            return False
        if search.called_at == -math.inf or search.seen_before:
            return False
        search.seen_before = coverage.share
        coverage.forget(search.called_at)
        if coverage.share == search.seen_before:
            return False
        title = search.mission.room.title
        log.info("%s: something moved there meanwhile: what was seen before is looked at again", title)
        search.began, search.views, search.tried = search.now, 0, []
        return True

    # -- second looks

    def _second_look(self, search: _Search, survey: Survey, pose: Pose2D, inputs: Inputs) -> Viewpoint | None:
        """A viewpoint for the most probable open hypothesis that has one."""
        doubts = [each for each in survey.doubts_here(search.belief.open) if each.is_placed]
        # If nothing is found, plan again without live obstacles: move_base may find a way that this planner misses.
        blocked = survey.blocked(inputs), None
        for doubt in doubts:
            if len(doubt.second_looks) >= _LOOKS:
                continue
            x, y = float(doubt.place[0]), float(doubt.place[1])
            tried = tuple((at.x, at.y) for at in doubt.second_looks)
            for stands in blocked:
                candidates = survey.planner.views_of(pose, x, y, stands=stands, tried=tried)
                found = best_second_look(search.belief, doubt, candidates, 2.0 * math.tan(0.5 * self._width))
                if found is not None:
                    doubt.second_looks.append(found.pose)
                    log.info("%s is to be looked at from (%.1f, %.1f)", search.belief.why(doubt), *found.pose[:2])
                    return _with_sweep(doubt, found)
        return None

    # -- for a room whose own point cannot be reached

    def fallback_viewpoints(self, room: Room, inputs: Inputs, most: int = 3) -> list[Pose2D]:
        """Other poses that show a room, the best first."""
        self._settle_in(inputs)
        ground, pose = self._ground, inputs.pose
        if ground is None or pose is None:
            return []
        mask, tried = ground.house.mask(room.id), [(room.pose.x, room.pose.y)]
        found: list[Pose2D] = []
        for _ in range(most):
            view = ground.planner.fallback(pose, mask, tried=tuple(tried), width=self._width)
            if view is None:
                break
            found.append(view.pose)
            tried.append((view.pose.x, view.pose.y))
        return found

    def _settle_in(self, inputs: Inputs) -> None:
        """Take the newest map of the house, unless the search of a room has begun on another."""
        search, house, p = self._started, inputs.house, self.params
        if search is not None and search.survey is not None:
            return
        if house is not None and (self._ground is None or house is not self._ground.house):
            self._ground = Ground(house, ViewpointPlanner(house.floor, p.viewpoints, p.coverage))
        if search is not None and self._ground is not None:
            search.survey = Survey(search.mission, self._ground, p, self._width)


def _with_sweep(doubt: Hypothesis, view: Viewpoint) -> Viewpoint:
    """The viewpoint with its stay, and a sweep over what looks a little like a person: each picture differs."""
    if doubt.is_near_only:
        return replace(view, stay=_STAY_NEAR)
    first = view.pose._replace(yaw=wrap_angle(view.pose.yaw - _SWEEP / 2.0))
    return replace(view, pose=first, turn=_SWEEP, stay=_STAY)
