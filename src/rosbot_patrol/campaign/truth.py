"""Ground truth of a patrol from the simulator's own poses: who was in the room, and who was in view."""

from __future__ import annotations

import bisect
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from rosbot_patrol.campaign.cast import Person
from rosbot_patrol.campaign.floor import RECOGNISED, Floor
from rosbot_patrol.geometry import Pose2D, angle_difference

ENOUGH = 1.5  # time in view after which a person should be found [s]
_ONE_TOUCH = 1.0  # pause that separates two touches [s]
_LONGEST = 0.5  # longest time between two poses of an actor; more is a gap [s]


@dataclass(frozen=True)
class Track:
    """Poses over simulated time [s], in order."""

    times: Sequence[float]
    poses: Sequence[Pose2D]

    def at(self, time: float) -> Pose2D | None:
        """Last pose at or before a time; None before the first."""
        i = bisect.bisect_right(self.times, time) - 1
        return self.poses[i] if i >= 0 else None

    def speed(self, time: float, span: float = 0.4) -> float | None:
        """Speed over a span up to a time [m/s], None before the first pose."""
        before, after = self.at(time - span), self.at(time)
        return None if before is None or after is None else math.dist(before[:2], after[:2]) / span

    def turning(self, time: float, span: float = 0.4) -> float | None:
        """Turning speed over a span up to a time, unsigned [rad/s], None before the first pose."""
        before, after = self.at(time - span), self.at(time)
        return None if before is None or after is None else abs(angle_difference(after.yaw, before.yaw)) / span


@dataclass(frozen=True, kw_only=True)
class Presence:
    """Ground truth on the people of a patrol between trigger and verdict.

    Attributes:
        in_room: seconds with anybody in the triggered room.
        in_view: seconds with anybody in the camera's view.
        first_view: simulated time at which somebody first came into view, None: never.
    """

    in_room: float = 0.0
    in_view: float = 0.0
    first_view: float | None = None

    @property
    def was_there(self) -> bool:
        """Whether there was a person to be found."""
        return self.in_room >= ENOUGH or self.in_view >= ENOUGH

    @property
    def was_seen(self) -> bool:
        """Whether anybody was in the room or in view at all, even for a time too short to require a detection."""
        return self.in_room > 0.0 or self.in_view > 0.0


def presence(
    floor: Floor,
    room: int,
    people: Sequence[Person],
    tracks: dict[str, Track],
    robot: Track,
    *,
    begin: float,
    end: float,
) -> Presence:
    """Presence of people from `begin` to `end` [s].

    Args:
        floor: of the house.
        room: the triggered room.
        people: the persons that count.
        tracks: of each actor, by name.
        robot: the robot's true poses.
        begin: of the mission.
        end: time of the verdict.
    """
    in_room: set[float] = set()
    in_view: set[float] = set()
    steps: dict[float, float] = {}
    for person in people:
        for time, step, pose in _between(tracks.get(person.name), begin, end):
            steps[time] = step
            if floor.room_at(pose.x, pose.y) == room:
                in_room.add(time)
            if _is_in_view(floor, person, pose, robot.at(time)):
                in_view.add(time)
    return Presence(
        in_room=round(sum(steps[t] for t in in_room), 2),
        in_view=round(sum(steps[t] for t in in_view), 2),
        first_view=min(in_view, default=None),
    )


def shown(
    floor: Floor, people: Sequence[Person], tracks: dict[str, Track], robot: Track, *, begin: float, end: float
) -> int:
    """Number of people who were each in the camera's view for long enough to be found, from `begin` to `end` [s]."""
    spans = [
        sum(
            step
            for time, step, pose in _between(tracks.get(person.name), begin, end)
            if _is_in_view(floor, person, pose, robot.at(time))
        )
        for person in people
    ]
    return sum(span >= ENOUGH for span in spans)


def _between(track: Track | None, begin: float, end: float) -> Iterator[tuple[float, float, Pose2D]]:
    """Time, duration [s] and pose of each step of a track from `begin` to `end`."""
    if track is None:
        return
    for i, (time, pose) in enumerate(zip(track.times, track.poses, strict=True)):
        if begin <= time <= end:
            after = track.times[i + 1] if i + 1 < len(track.times) else time
            yield time, min(after - time, _LONGEST), pose


def _is_in_view(floor: Floor, person: Person, pose: Pose2D, robot: Pose2D | None) -> bool:
    return robot is not None and floor.in_view(robot, pose, person.posture) >= RECOGNISED


def place_error(tracks: dict[str, Track], people: Sequence[Person], time: float, x: float, y: float) -> float | None:
    """Distance of a notified place from the nearest person at that time [m]; None if no position is known."""
    there = [pose for p in people if p.name in tracks and (pose := tracks[p.name].at(time)) is not None]
    return min((math.dist(pose[:2], (x, y)) for pose in there), default=None)


def touches(contacts: Sequence[tuple[float, str]], robot: Track, tracks: dict[str, Track]) -> list[str]:
    """Each touch in words: what, when, where, and who moved.

    Args:
        contacts: simulated time and name of what the robot touched, for each moment of a touch.
        robot: its poses.
        tracks: of the actors.
    """
    sentences: list[str] = []
    last: dict[str, float] = {}
    for time, name in contacts:
        is_new = time - last.get(name, -math.inf) > _ONE_TOUCH
        last[name] = time
        pose = robot.at(time)
        if not is_new or pose is None:
            continue
        whose = f", {name} {_motion(tracks[name], time)}" if name in tracks else ""
        sentences.append(
            f"{name} at {time:.1f} s, the robot at ({pose.x:.2f}, {pose.y:.2f}), {_motion(robot, time)}{whose}"
        )
    return sentences


def _motion(track: Track, time: float) -> str:
    turning = track.turning(time) or 0.0
    return f"at {track.speed(time) or 0.0:.2f} m/s" + (f" and turning at {turning:.1f} rad/s" if turning > 0.05 else "")
