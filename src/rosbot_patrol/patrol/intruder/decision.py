"""Decide from the detector's pictures who is an intruder, who is met for the first time, and where the camera looks."""

from __future__ import annotations

import dataclasses
import logging
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from rosbot_patrol.patrol.house.regions import NOBODYS, RoomRegions
from rosbot_patrol.patrol.house.rooms import Room, Rooms
from rosbot_patrol.patrol.intruder.camera_tracking import CameraTracking, CameraTrackingParams
from rosbot_patrol.patrol.intruder.close_ups import CloseUps, SeenAt
from rosbot_patrol.patrol.intruder.exclusions import Exclusions
from rosbot_patrol.patrol.intruder.persons import Persons, PersonsParams
from rosbot_patrol.patrol.intruder.sightings import Sightings, SightingsParams
from rosbot_patrol.patrol.intruder.weak_sightings import WeakSighting, WeakSightingParams, WeakSightings
from rosbot_patrol.patrol.records.findings import Confirmation, Person
from rosbot_patrol.patrol.records.inputs import Frame, Inputs

log = logging.getLogger(__name__)

_LEAST_SEEN = 2  # of the last three pictures that show somebody, before the robot stops for them


@dataclass(frozen=True, kw_only=True)
class IntruderParams:
    """The groups of parameters that the decision is made with."""

    alarm_classes: Sequence[str]
    watch: SightingsParams
    suspects: WeakSightingParams
    people: PersonsParams
    track: CameraTrackingParams


@dataclass(frozen=True, kw_only=True)
class Finding:
    """Somebody was confirmed.

    Attributes:
        seen: what the detector saw.
        number: of the person, from 1 on; is_new: met for the first time on this mission.
        places: x, y in map [m] of each person met so far, None where unknown; this one's at `number - 1`.
        room: in which the person is, None if unknown; is_outside: the place is known and lies in no room.
    """

    seen: Confirmation
    number: int
    is_new: bool
    places: tuple[tuple[float, float] | None, ...]
    room: Room | None
    is_outside: bool


class IntruderDecision:
    """Takes pictures, gives findings; holds what was seen since `start`.

    Args:
        rooms: of the points file.
        params: how sure to be.
        exclusions: what cannot be an intruder.
    """

    def __init__(self, rooms: Rooms, params: IntruderParams, exclusions: Exclusions) -> None:
        self._rooms, self._params, self._exclusions = rooms, params, exclusions
        self._sightings = Sightings(tuple(params.alarm_classes), params.watch, exclusions)
        self._weak_sightings = WeakSightings(params.suspects)
        self._close_ups = CloseUps(exclusions)
        self._persons = Persons(params.people)
        self._camera_tracking = CameraTracking(params.track)

    def start(self, now: float, met: Iterable[tuple[float, float] | None]) -> None:
        """Forget everything, for a new mission.

        Args:
            now: steady time [s]; pictures taken before it do not count.
            met: places in map [m] of persons who were met before a restart, None where unknown.
        """
        self._sightings.start(now)
        self._weak_sightings.start(now)
        self._close_ups.start()
        self._camera_tracking.reset()
        self._persons = Persons(self._params.people)
        self._persons.recall(met, now)

    # -- who is there

    def see(self, now: float, inputs: Inputs, harmless: Iterable[SeenAt]) -> list[Finding]:
        """Take in a step's pictures.

        Args:
            now: steady time [s], as the stamps of `inputs`.
            inputs: of this step.
            harmless: things that move and are no persons.
        """
        if inputs.house is not None:
            self._exclusions.floor = inputs.house.floor
        self._close_ups.add_pets(harmless)
        findings = []
        for given in inputs.frames:
            frame = self._leave_out_close_ups(now, given)
            for seen in self._sightings.add(now, frame):
                self._weak_sightings.note_confirmed(seen.measured)
                findings.append(self._find(now, seen, inputs.house))
            findings += [self._find(now, seen, inputs.house) for seen in self._weigh(frame)]
            self._point_camera(now, frame, inputs)
        return findings

    def has_candidate(self, now: float) -> bool:
        """Whether a picture of the last moment shows something that may become an intruder."""
        return self._sightings.candidate(now)

    @property
    def doubtful(self) -> Sequence[WeakSighting]:
        """Things that look like a person, from too few sides to tell."""
        return self._weak_sightings.doubtful()

    @property
    def too_near(self) -> Sequence[SeenAt]:
        """Things too near to tell a person from a pet."""
        return self._close_ups.doubtful

    @property
    def weak_sightings(self) -> Sequence[WeakSighting]:
        """Everything that looked a little like somebody."""
        return self._weak_sightings.all

    @property
    def refusals(self) -> Mapping[str, int]:
        """Reasons why boxes were refused, and how often."""
        return self._sightings.refusals

    @property
    def met(self) -> Sequence[Person]:
        """Persons who were confirmed."""
        return self._persons.met

    def _leave_out_close_ups(self, now: float, frame: Frame) -> Frame:
        """Boxes too near to tell a person from a pet prove nothing, but the robot stops for them."""
        if not frame.counts or frame.stamp is None:
            return frame
        boxes, is_left = self._close_ups.sort(frame.stamp, frame.boxes, frame.eye)
        if is_left:
            self._sightings.glimpse(now)
        return dataclasses.replace(frame, boxes=boxes)

    def _weigh(self, frame: Frame) -> tuple[Confirmation, ...]:
        """Gather weak sightings by place."""
        if not frame.counts or frame.stamp is None or frame.eye is None:
            return ()
        return self._weak_sightings.add(frame.stamp, frame.eye.pose, self._sightings.plausible(frame), frame.picture)

    def _find(self, now: float, seen: Confirmation, house: RoomRegions | None) -> Finding:
        person, is_new = self._persons.note(now, seen.measured)
        room, is_outside = self._room_at(person, house)
        person.label, person.room = seen.label, room.title if room else ""
        return Finding(
            seen=seen,
            number=person.number,
            is_new=is_new,
            places=tuple(self._persons.places),
            room=room,
            is_outside=is_outside,
        )

    def _room_at(self, person: Person, house: RoomRegions | None) -> tuple[Room | None, bool]:
        """The room in which a person is, and whether they are known to be in none."""
        if house is None or person.x is None or person.y is None:
            return None, False
        found = house.room_at(person.x, person.y)
        return self._rooms.find(found), found == NOBODYS

    # -- the camera is kept on a person

    def camera_speed(self, now: float, inputs: Inputs) -> float | None:
        """Turning speed that keeps somebody in view [rad/s], None if nobody is followed."""
        lost = " and ".join(["its pose in the map"] * (inputs.pose is None) + ["its heading"] * (inputs.yaw is None))
        if lost and self._camera_tracking.is_on:
            log.warning("the camera no longer follows whom it sees: the robot does not know %s", lost)
            self._camera_tracking.release(now)
        return self._camera_tracking.step(now, inputs.yaw)

    def _point_camera(self, now: float, frame: Frame, inputs: Inputs) -> None:
        boxes = self._sightings.plausible(frame)
        if not boxes or (self._sightings.lately(now) < _LEAST_SEEN and not self._camera_tracking.is_on):
            return
        if frame.eye is None or inputs.pose is None or inputs.yaw is None:
            return
        column = (boxes[0].xmin + boxes[0].xmax) / 2.0
        in_odom = frame.eye.pose.yaw - inputs.pose.yaw + inputs.yaw  # a correction of the map's part does not turn odom
        self._camera_tracking.see(now, frame.eye.bearing(column), in_odom)
