"""A small world for the patrol: a robot that glides to goals and turns by command, a detector that sees by room."""

import dataclasses
import math

from belief_pictures import good_network

from rosbot_patrol.geometry import Pose2D, wrap_angle
from rosbot_patrol.goal import GoalLink, GoalState
from rosbot_patrol.patrol.house.rooms import Room, Rooms
from rosbot_patrol.patrol.mission.manager import PatrolManager
from rosbot_patrol.patrol.records.inputs import Box, Frame, Guarded, Inputs
from rosbot_patrol.patrol.records.mission import Phase

ROOMS = Rooms(
    tuple(Room(id=i, name=f"name{i}", pose=Pose2D(10.0 * i, 0.0, 0.0)) for i in range(4)), source="rooms.yaml"
)
PERSON = Box(label="person", probability=0.9, xmin=10, ymin=10, xmax=60, ymax=200)


class World:
    def __init__(self, manager=None, **given):
        self.manager = manager or PatrolManager(ROOMS, network=good_network)
        self.now, self.x, self.yaw = 100.0, 0.0, 0.0
        self.speed = 2.0
        self.link = GoalLink(is_up=True)
        self.goal = None
        self.refuse = set()
        self.person_when = lambda world: False
        self.boxes, self.house = lambda world: (PERSON,), None
        self.detector, self.camera, self.moves = True, True, True
        self.detector_at = self.camera_at = self.now
        self.triggers, self.requests = [], []
        self.guarded, self.stop, self.battery, self.wall = Guarded(), "", None, 1.7e9
        self.all = []
        self.goals, self.reports, self.notices, self.ended, self.speeds, self.words = [], [], [], [], [], []
        self.cancels = 0
        for key, value in given.items():
            setattr(self, key, value)

    def step(self):
        frames = []
        if round(self.now * 25) % 3 == 0:
            if self.detector:
                self.detector_at = self.now
                frames = [Frame(stamp=self.now - 0.05, boxes=self.boxes(self))] if self.person_when(self) else [Frame()]
            if self.camera:
                self.camera_at = self.now
        out = self.manager.step(
            self.now,
            Inputs(
                wall=self.wall + self.now,
                triggers=tuple(self.triggers),
                requests=tuple(self.requests),
                house=self.house,
                guarded=self.guarded,
                stop=self.stop,
                battery=self.battery,
                frames=tuple(frames),
                yaw=wrap_angle(self.yaw),
                pose=Pose2D(self.x, 0.0, wrap_angle(self.yaw)),
                link=self.link,
                detector_at=self.detector_at,
                camera_at=self.camera_at,
            ),
        )
        self.triggers, self.requests = [], []
        self.all.append(out)
        self._apply(out)
        self.now += 0.04
        return out

    def _apply(self, out):
        if out.cancel:
            self.cancels += 1
            self.link = dataclasses.replace(self.link, state=GoalState.FAILED)
        if out.goal:
            self.goals.append(out.goal)
            self.link = GoalLink(is_up=self.link.is_up, tag=out.goal.tag, state=GoalState.ACTIVE)
        if self.link.state is GoalState.ACTIVE and self.link.is_up:
            self._glide()
        if out.speed is not None and self.moves:
            self.yaw += out.speed * 0.04
        self.speeds.append(out.speed)
        self.reports += [out.report] if out.report else []
        self.notices += out.alarms
        self.ended += out.ended
        self.words += out.words

    def _glide(self):
        target = self.goals[-1].pose.x
        if target in self.refuse:
            self.link = dataclasses.replace(self.link, state=GoalState.FAILED, text="Failed to find a valid plan.")
            return
        left = target - self.x
        self.x += math.copysign(min(abs(left), self.speed * 0.04), left)
        if self.x == target:
            self.link = dataclasses.replace(self.link, state=GoalState.SUCCEEDED, text="Goal reached.")

    def run(self, until, limit=400.0):
        end = self.now + limit
        while self.now < end:
            self.step()
            if until(self):
                return
        raise AssertionError(f"did not come; last: {self.reports[-1]}")

    def mission(self, *rooms, count=1):
        self.triggers = list(rooms)
        self.run(lambda w: len(w.ended) >= count)
        return self.ended[-1]

    @property
    def phases(self):
        names = [r.phase.value for r in self.reports]
        return [n for i, n in enumerate(names) if i == 0 or names[i - 1] != n]


def phase(world):
    return world.manager.mission.phase if world.manager.mission else Phase.IDLE


def looking(world):
    return phase(world) is Phase.LOOKING
