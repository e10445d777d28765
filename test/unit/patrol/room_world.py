"""A room to look at: a robot that glides over a drawn house, a camera that sees people in its view, a lidar."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable

from belief_pictures import good_network
from floors import drawn_floor, points, scan_over, sight_from

from rosbot_patrol.geometry import Pose2D, wrap_angle
from rosbot_patrol.goal import GoalLink, GoalState
from rosbot_patrol.patrol.house.regions import RoomRegions, part_rooms
from rosbot_patrol.patrol.house.rooms import Rooms
from rosbot_patrol.patrol.intruder.known_objects import KnownObject
from rosbot_patrol.patrol.mission.manager import ManagerParams, PatrolManager
from rosbot_patrol.patrol.records.inputs import Box, Eye, Frame, Inputs, Measured, ScanView
from rosbot_patrol.patrol.records.mission import Phase
from rosbot_patrol.patrol.search.room_search import RoomSearch
from rosbot_patrol.patrol.search.survey import SightParams

WIDTH = 1.047
HOUSE = (
    "########################",
    "#......................#",
    "#......................#",
    "#......................#",
    "#......................#",
    "#......................#",
    "#########..#############",
    "#########..#############",
    "#....#.................#",
    "#....#.................#",
    "#....#.................#",
    "#......................#",
    "#......................#",
    "########################",
)  # the room at the bottom has a corner on the left that its point does not see
FLOOR = drawn_floor(*HOUSE)
POINT = Pose2D(9.5, 2.0, 0.0)
ROOMS = points((2.0, 4.7), POINT[:2])
REGIONS = part_rooms(FLOOR, ROOMS)

Place = tuple[float, float]


class World:
    """12.5 steps a second, a picture and a scan at each other one.

    Args:
        people: gives where people are at a time [s].
        camera: whether it shows anything.
    """

    def __init__(
        self,
        people: Callable[[float], list[Place]] = lambda now: [],
        *,
        params: ManagerParams | None = None,
        eyes: SightParams | None = None,
        known: tuple[KnownObject, ...] = (),
        memory: dict | None = None,
        camera: bool = True,
        refused: Callable[[Pose2D], bool] = lambda pose: False,
        rooms: Rooms = ROOMS,
    ) -> None:
        self.views = RoomSearch(eyes)
        self.house: RoomRegions | None = REGIONS if rooms is ROOMS else part_rooms(FLOOR, rooms)
        self.manager = PatrolManager(
            rooms,
            params,
            views=self.views,
            viewpoints=self.views.fallback_viewpoints,
            known=lambda: known,
            network=good_network,
            memory=memory,
        )
        self.people, self.camera, self.refused = people, camera, refused
        self.now, self.pose = 100.0, ROOMS.base.pose
        self.words, self.ignored = [], []
        self.view: ScanView | None = None
        self.link = GoalLink(is_up=True)
        self.camera_at = self.now
        self.triggers: tuple[int, ...] = ()
        self.goals, self.notices, self.ended, self.reports, self.tracked = [], [], [], [], []
        self.cancels, self.flat, self.count, self.measures_to, self.sees_to = 0, False, 0, 99.0, 7.0
        self.top, self.beyond = 1.7, 0.0  # height of people, and how much farther off they are measured
        self.score: Callable[[Pose2D], float] = lambda pose: 0.9

    def frame(self) -> Frame:
        sight = sight_from(FLOOR, self.pose.x, self.pose.y, 8.0)
        boxes = []
        for x, y in self.people(self.now):
            dx, dy = x - self.pose.x, y - self.pose.y
            away, bearing = math.hypot(dx, dy), wrap_angle(math.atan2(dy, dx) - self.pose.yaw)
            seen = sight_reaches(sight, math.atan2(dy, dx), away - 0.2)
            if abs(bearing) < WIDTH / 2 and away < self.sees_to and seen:
                boxes.append(self.box(x, y, away, bearing))
        eye = Eye(pose=self.pose, width=WIDTH, columns=640)
        return Frame(stamp=self.now - 0.05 if boxes else None, boxes=tuple(boxes), eye=eye)

    def box(self, x: float, y: float, away: float, bearing: float) -> Box:
        middle = 320 - 554 * math.tan(bearing)
        most = 0.2 + 0.43 * away  # the picture ends there
        top, is_cut = min(self.top, most), most < self.top
        x, y = x + self.beyond * (x - self.pose.x) / away, y + self.beyond * (y - self.pose.y) / away
        measured = Measured(
            x=x, y=y, error=0.15, away=away, top=top, height=top, width=0.5, is_cut=is_cut, is_flat=self.flat
        )
        is_far = away > self.measures_to
        left, right = round(max(middle - 40, 0)), round(min(middle + 40, 640))
        return Box(
            label="person",
            probability=self.score(self.pose),
            xmin=left,
            xmax=right,
            ymin=0 if is_cut else 20,
            ymax=300,
            measured=None if is_far else measured,
            doubt=(x, y) if is_far else None,
        )

    def step(self) -> None:
        self.count += 1
        has_picture = self.count % 2 == 0 and self.camera
        self.camera_at = self.now if has_picture else self.camera_at
        if self.count % 2 == 0:
            scan = scan_over(FLOOR, self.pose, self.now, [(x, y, 0.15) for x, y in self.people(self.now)])
            self.view = ScanView(scan=scan, map_from_laser=self.pose)
        out = self.manager.step(
            self.now,
            Inputs(
                wall=1.7e9 + self.now,
                triggers=self.triggers,
                frames=(self.frame(),) if has_picture else (),
                yaw=self.pose.yaw,
                pose=self.pose,
                link=self.link,
                detector_at=self.now,
                camera_at=self.camera_at,
                scan=self.view,
                house=self.house,
            ),
        )
        self.triggers = ()
        self.cancels += out.cancel
        if out.cancel:
            self.link = dataclasses.replace(self.link, state=GoalState.FAILED)
        if out.goal:
            self.goals.append(out.goal.pose)
            state = GoalState.FAILED if self.refused(out.goal.pose) else GoalState.ACTIVE
            self.link = GoalLink(is_up=True, tag=out.goal.tag, state=state)
        if self.link.state is GoalState.ACTIVE:
            self.glide(self.goals[-1])
        if out.speed is not None:
            self.pose = self.pose._replace(yaw=wrap_angle(self.pose.yaw + out.speed * 0.08))
        self.notices += out.alarms
        self.ended += out.ended
        self.words += out.words
        self.ignored += out.ignored
        self.reports += [out.report] if out.report else []
        self.now += 0.08

    def glide(self, goal: Pose2D) -> None:
        """By the straight line, as if there were no walls; a metre a second."""
        left = math.dist(self.pose[:2], goal[:2])
        if left < 0.08:
            self.pose = goal
            self.link = dataclasses.replace(self.link, state=GoalState.SUCCEEDED)
            return
        share = min(0.08 / left, 1.0)
        x, y = self.pose.x + (goal.x - self.pose.x) * share, self.pose.y + (goal.y - self.pose.y) * share
        self.pose = Pose2D(x, y, math.atan2(goal.y - self.pose.y, goal.x - self.pose.x))

    def mission(self, room: int = 1, limit: float = 200.0):
        self.triggers = (room,)
        return self.until(lambda w: bool(w.ended), limit).ended[-1]

    def mission_after(self, room: int):
        """A further one."""
        count = len(self.ended)
        self.triggers = (room,)
        return self.until(lambda w: len(w.ended) > count).ended[-1]

    def until(self, is_so: Callable[[World], bool], limit: float = 200.0) -> World:
        end = self.now + limit
        while not is_so(self):
            self.step()
            assert self.now < end, self.reports[-1]
        return self

    @property
    def phase(self) -> Phase | None:
        return self.manager.mission.phase if self.manager.mission else None


def sight_reaches(sight, bearing: float, away: float) -> bool:
    return away <= sight.lengths[round((bearing % math.tau) / sight.step) % len(sight.lengths)]
