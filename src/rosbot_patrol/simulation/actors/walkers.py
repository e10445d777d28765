"""Walking actors in the plane: people, pets and fire hydrants that stand, walk along points, roam and stop.

A walker accelerates and brakes like a person, turns before it starts, and stops before the robot and a door's leaf
until they have gone. It knows nothing of walls: `ways.Ways` refuses a path through one. A wandering actor also stops
before others and then goes elsewhere; actors with a path walk through each other.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from rosbot_patrol.counts import count_of
from rosbot_patrol.errors import WorldError
from rosbot_patrol.geometry import Pose2D, angle_difference, distance, wrap_angle
from rosbot_patrol.simulation.actors.figures import MODELS, make_figure
from rosbot_patrol.simulation.scene.matrices import Matrix, from_pose2d
from rosbot_patrol.simulation.scene.scene import Body
from rosbot_patrol.simulation.scene.slices import Slice

__all__ = ["FASTEST", "MODELS", "Obstacle", "Walker"]

FASTEST = 8.0  # largest speed of an actor [m/s]

_GAIN, _BRAKE = 1.2, 2.0  # acceleration at the start and deceleration before a stop [m/s2]
_LAST_STEP = 0.1  # speed of arrival at a goal [m/s]
_ARRIVED = 0.05
_ROOM = 0.17  # distance between a walker and the robot's middle, beyond the walker's own radius [m]
_SHARP = 1.2  # at a sharper corner the walker stands while it turns [rad]
_TRIES = 12  # number of places that a wandering actor tries before it waits
_PATIENCE = 2.0  # a blocked wandering actor goes elsewhere after this time [s]


class Obstacle(Protocol):
    """A moving obstacle that stops walkers."""

    def distance_to(self, x: float, y: float) -> float:
        """Distance from a point to the obstacle [m]."""


@dataclass(frozen=True)
class _Roaming:
    centre: Pose2D
    radius: float
    rng: np.random.Generator
    is_free: Callable[[Pose2D, Pose2D], bool]


class Walker:
    """One actor.

    Args:
        name: unique in the world.
        model: person, fire_hydrant, cat or dog.
        look: name of a person's or pet's look, "" for a random one.
        pose: initial pose.
        rng: random generator of the look.
        posture: posture of a person, "" for standing.
        detailed: draw people, and those on posters, with detailed figures.

    Raises:
        WorldError: the model, look or posture is unknown.
    """

    def __init__(
        self,
        name: str,
        model: str,
        look: str,
        pose: Pose2D,
        rng: np.random.Generator,
        *,
        posture: str = "",
        detailed: bool = False,
    ) -> None:
        self.name = name
        self.model = model
        self.pose = pose
        self._figure = make_figure(name, model, look, posture, rng, detailed=detailed)
        self._phase = 0.0
        self._pace = 0.0
        self._path: list[Pose2D] = []
        self._next = 0
        self._speed = 0.0
        self._loop = False
        self._pause = 0.0
        self.yields = True
        self._waits = 0.0
        self._held_up = 0.0
        self._roaming: _Roaming | None = None

    @property
    def body(self) -> Body:
        """Body for the scene."""
        return self._figure.body

    @property
    def is_walking(self) -> bool:
        """Whether it is moving along its path."""
        return self._pace > 0.0

    @property
    def has_arrived(self) -> bool:
        """Whether it stands at the end of its path, or has none."""
        return not self._path and self._roaming is None

    @property
    def speed(self) -> float:
        """Present walking speed [m/s]."""
        return self._pace

    @property
    def is_roaming(self) -> bool:
        """Whether it wanders."""
        return self._roaming is not None

    def distance_to(self, x: float, y: float) -> float:
        """Distance from a point to its cylinder [m], 0 inside."""
        return max(math.hypot(x - self.pose.x, y - self.pose.y) - self.radius, 0.0)

    @property
    def is_warm(self) -> bool:
        """Whether a motion sensor can notice it."""
        return self._figure.warmth > 0.0

    @property
    def warmth(self) -> float:
        """Range at which a motion sensor notices it, relative to a person's."""
        return self._figure.warmth

    @property
    def warm_heights(self) -> tuple[float, ...]:
        """Heights above the floor of the points that represent its warm surface [m]."""
        return self._figure.warm_heights

    @property
    def radius(self) -> float:
        """Radius of its vertical bounding cylinder, without limbs [m]."""
        return self._figure.radius

    @property
    def look_name(self) -> str:
        """Name of the look, "" if it has none."""
        return self._figure.look

    @property
    def matrix(self) -> Matrix:
        """world_from_body."""
        return from_pose2d(self.pose)

    def walk(
        self, path: Sequence[Pose2D], speed: float, loop: bool = False, *, pause: float = 0.0, yields: bool = True
    ) -> None:
        """Walk along points; a single point with speed 0 places it there.

        Args:
            path: points; it turns to the yaw of the last.
            speed: a person strolls at 0.4 and hurries at 1.4 [m/s].
            loop: begin again after the last point.
            pause: time to stand at each point [s].
            yields: stop before the robot; otherwise it walks on, even over the robot.

        Raises:
            WorldError: no points, a number that is not finite, a path without speed, or a speed above the limit.
        """
        numbers = [speed, pause, *(v for p in path for v in p)]
        if not path or not all(map(math.isfinite, numbers)):
            raise WorldError(f"actor '{self.name}'", "needs a path of at least one point, of finite numbers")
        if speed <= 0.0 and (len(path) > 1 or speed < 0.0):
            raise WorldError(f"actor '{self.name}'", f"cannot walk {count_of(len(path), 'point')} at {speed} m/s")
        self._check(speed, pause)
        self._roaming = None
        self._waits = self._pace = 0.0
        self._next, self._speed, self._loop, self._pause = 0, speed, loop, pause
        self.yields = yields
        self._path = list(path) if speed > 0.0 else []
        if speed == 0.0:
            self.pose = path[0]

    def roam(
        self,
        radius: float,
        speed: float,
        rng: np.random.Generator,
        is_free: Callable[[Pose2D, Pose2D], bool],
        *,
        pause: float = 2.0,
    ) -> None:
        """Wander around its present position, from one free place to another, until the next command.

        Args:
            radius: largest distance from that position [m].
            speed: walking speed [m/s].
            rng: chooses the places.
            is_free: whether the straight path between two places is free.
            pause: time to stand at each place [s].

        Raises:
            WorldError: a number is invalid.
        """
        if not (math.isfinite(radius) and radius > 0.0 and speed > 0.0):
            raise WorldError(f"actor '{self.name}'", f"cannot wander within {radius} m at {speed} m/s")
        self._check(speed, pause)
        self.yields = True
        self._roaming = _Roaming(self.pose, radius, rng, is_free)
        self._path, self._loop, self._speed, self._pause = [], False, speed, pause
        self._waits = self._held_up = self._pace = 0.0

    def step(self, dt: float, robot: Pose2D | None, obstacles: Sequence[Obstacle] = ()) -> bool:
        """Advance by `dt` [s]; returns whether it moved. It waits for the robot and obstacles to go."""
        if self._waits > 0.0:
            self._waits -= dt
            self._pace = 0.0
            return False
        if not self._path and not self._finds_a_way():
            self._pace = 0.0
            return False
        goal = self._path[self._next]
        gap = distance(self.pose, goal)
        if gap < _ARRIVED:
            return self._arrive(goal, dt)
        heading = math.atan2(goal.y - self.pose.y, goal.x - self.pose.x)
        error = angle_difference(heading, self.pose.yaw)
        self._pace = self._pace_for(error, gap, dt)
        stride = min(self._pace * dt, gap)
        yaw = self._turned(error, dt, heading)
        moved = Pose2D(self.pose.x + stride * math.cos(yaw), self.pose.y + stride * math.sin(yaw), yaw)
        if self._is_in_the_way(moved, robot, obstacles):
            self._pace = 0.0
            self._give_up_later(dt)
            return False
        changed = moved != self.pose
        self.pose = moved
        self._held_up = 0.0
        self._phase = (self._phase + stride / self._figure.cycle) % 1.0
        return changed

    def pose_parts(self) -> Matrix | None:
        """body_from_visuals of the limbs, None without moving parts."""
        return self._figure.pose_parts(self._phase, self._pace)

    def cut(self, height: float) -> Slice:
        """Its horizontal section at a height [m], in the world frame."""
        return self._figure.cut(height, self._phase, self._pace).placed(self.pose)

    def _check(self, speed: float, pause: float) -> None:
        if speed > FASTEST:
            raise WorldError(f"actor '{self.name}'", f"cannot run at {speed} m/s, at most at {FASTEST}")
        if not pause >= 0.0 or not math.isfinite(pause):
            raise WorldError(f"actor '{self.name}'", f"cannot pause for {pause} s")

    def _pace_for(self, error: float, gap: float, dt: float) -> float:
        """The next speed, limited by the distance ahead and the acceleration [m/s]."""
        if abs(error) >= _SHARP:
            return max(self._pace - _BRAKE * dt, 0.0) if self._pace > _LAST_STEP else 0.0
        at_goal = self._pace_at_goal()
        braking = math.sqrt(at_goal**2 + 2.0 * _BRAKE * max(gap - _ARRIVED, 0.0))
        wanted = min(self._speed * math.cos(error), max(braking, min(_LAST_STEP, self._speed)))
        return min(max(wanted, self._pace - _BRAKE * dt), self._pace + _GAIN * dt)

    def _pace_at_goal(self) -> float:
        last = self._next + 1 == len(self._path)
        if self._pause > 0.0 or (last and not self._loop):
            return 0.0
        goal, after = self._path[self._next], self._path[(self._next + 1) % len(self._path)]
        coming = math.atan2(goal.y - self.pose.y, goal.x - self.pose.x)
        corner = angle_difference(math.atan2(after.y - goal.y, after.x - goal.x), coming)
        return self._speed * math.cos(corner) if abs(corner) < _SHARP else 0.0

    def _turned(self, error: float, dt: float, heading: float) -> float:
        most = self._figure.turn_rate * dt
        return heading if abs(error) <= most else wrap_angle(self.pose.yaw + math.copysign(most, error))

    def _is_in_the_way(self, moved: Pose2D, robot: Pose2D | None, obstacles: Sequence[Obstacle]) -> bool:
        """Whether a move would bring it closer to something that is already close; turning is always free."""
        if (
            self.yields
            and robot is not None
            and distance(moved, robot) < min(self.radius + _ROOM, distance(self.pose, robot))
        ):
            return True
        for thing in obstacles:
            after = thing.distance_to(moved.x, moved.y)
            if after < self.radius and after < thing.distance_to(self.pose.x, self.pose.y):
                return True
        return False

    def _give_up_later(self, dt: float) -> None:
        self._held_up += dt
        if self._roaming is not None and self._held_up > _PATIENCE:
            self._path, self._held_up = [], 0.0

    def _finds_a_way(self) -> bool:
        """Whether the wandering actor has found a place to go to."""
        if self._roaming is None:
            return False
        centre, rng = self._roaming.centre, self._roaming.rng
        for _ in range(_TRIES):
            far, bearing = self._roaming.radius * math.sqrt(rng.random()), math.tau * rng.random()
            x, y = centre.x + far * math.cos(bearing), centre.y + far * math.sin(bearing)
            goal = Pose2D(x, y, math.atan2(y - self.pose.y, x - self.pose.x))
            if distance(goal, self.pose) > 2.0 * _ARRIVED and self._roaming.is_free(self.pose, goal):
                self._path, self._next = [goal], 0
                return True
        self._waits = 1.0
        return False

    def _arrive(self, goal: Pose2D, dt: float) -> bool:
        last = self._next + 1 == len(self._path)
        if not last or self._loop:
            self._next = (self._next + 1) % len(self._path)
            self._waits = self._pause
            return False
        error = angle_difference(goal.yaw, self.pose.yaw)
        self.pose = Pose2D(self.pose.x, self.pose.y, self._turned(error, dt, goal.yaw))
        self._pace = 0.0
        if abs(error) <= self._figure.turn_rate * dt:
            self._path = []
            self._waits = self._pause
        return error != 0.0
