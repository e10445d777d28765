"""Decide from the detector's pictures who is an intruder, who is met for the first time, and where the camera looks."""

from __future__ import annotations

import dataclasses
import logging
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

from rosbot_patrol.patrol.belief.belief import Belief, PictureView
from rosbot_patrol.patrol.belief.hypothesis import Hypothesis
from rosbot_patrol.patrol.belief.networks import Network
from rosbot_patrol.patrol.belief.params import BeliefParams
from rosbot_patrol.patrol.house.regions import NOBODYS, RoomRegions
from rosbot_patrol.patrol.house.rooms import Room, Rooms
from rosbot_patrol.patrol.intruder.camera_tracking import CameraTracking, CameraTrackingParams
from rosbot_patrol.patrol.intruder.known_objects import KnownObject
from rosbot_patrol.patrol.intruder.lidar_motion import LidarTrack
from rosbot_patrol.patrol.intruder.persons import Persons, PersonsParams
from rosbot_patrol.patrol.records.findings import Confirmation, Person
from rosbot_patrol.patrol.records.inputs import Eye, Frame, Inputs, Measured
from rosbot_patrol.patrol.visibility.coverage import Sight, free_way

log = logging.getLogger(__name__)

_LEAST_SEEN = 2  # of the last three pictures that show somebody, before the robot stops for them
_RECENT = 0.6  # [s] since a picture showed somebody: they are in view
_LATELY = 3.0  # [s] age of the pictures that count for stopping
_SHOWN = 0.4  # score of the other boxes that a picture for the owner shows
_OLDEST = 10.0  # [s] age of a picture that still counts
_PICTURES = 8  # kept until it is known whether they show an intruder


@dataclass(frozen=True, kw_only=True)
class IntruderParams:
    """The groups of parameters that the decision is made with."""

    alarm_classes: Sequence[str]
    belief: BeliefParams
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
    """Takes pictures and scans, gives findings; holds what was seen since `start`.

    Args:
        rooms: of the points file.
        params: how sure to be.
        known: gives the objects that look like somebody, asked at each `start`.
        network: gives the network that runs, asked at each `start`.

    Attributes:
        belief: who may be in the house.
        pictures: stamps of the camera's pictures that the owner would want to see of them [s].
    """

    def __init__(
        self,
        rooms: Rooms,
        params: IntruderParams,
        known: Callable[[], tuple[KnownObject, ...]] = tuple,
        network: Callable[[], Network] = Network,
    ) -> None:
        self._rooms, self._params, self._known, self._network = rooms, params, known, network
        self.belief = self._belief_of(Network())
        self.pictures: tuple[float, ...] = ()
        self._persons = Persons(params.people)
        self._camera_tracking = CameraTracking(params.track)
        self._showing: deque[tuple[float, bool]] = deque(maxlen=3)  # arrival of a picture, whether it shows somebody

    def _belief_of(self, network: Network) -> Belief:
        return Belief(
            network.calibration,
            self._params.belief,
            threshold=network.threshold,
            known=self._known(),
            classes=self._params.alarm_classes,
        )

    def start(self, now: float, met: Iterable[tuple[float, float] | None]) -> None:
        """Forget everything, for a new mission.

        Args:
            now: steady time [s]; pictures taken before it do not count.
            met: places in map [m] of persons who were met before a restart, None where unknown.
        """
        self.belief = self._belief_of(self._network())
        self.belief.start(now)
        self.pictures = ()
        self._camera_tracking.reset()
        self._showing.clear()
        self._persons = Persons(self._params.people)
        self._persons.recall(met, now)

    # -- who is there

    def see(self, now: float, inputs: Inputs, tracks: Iterable[LidarTrack]) -> list[Finding]:
        """Take in a step's pictures.

        Args:
            now: steady time [s], as the stamps of `inputs`.
            inputs: of this step.
            tracks: what the lidar follows.
        """
        if inputs.house is not None:
            self.belief.floor = inputs.house.floor
        self.belief.motion(tracks)
        for each in self.belief.hypotheses:
            if each.moved > 0.0:
                self._persons.walks(each.number)
        findings: list[Finding] = []
        for frame in inputs.frames:
            if frame.stamp is not None and now - frame.stamp > _OLDEST:
                continue
            shown = self.belief.see(now, frame, self._view(inputs, frame))
            if shown:
                self.pictures = self.belief.pictures(_PICTURES)
            findings += [self._find(now, each, inputs, frame.eye) for each in shown if each.is_confirmed]
            somebody = [each for each in shown if each.last in frame.boxes and self.belief.may_be_somebody(each)]
            is_early = not frame.counts and bool(self.belief.plausible(frame))  # it cannot be judged yet
            self._showing.append((now, bool(somebody) or is_early))
            self._point_camera(now, frame, somebody, inputs)
        return findings

    def _view(self, inputs: Inputs, frame: Frame) -> PictureView:
        return PictureView(self._sight(inputs, frame.eye), frame.is_dark, has_scan=inputs.scan is not None)

    def _sight(self, inputs: Inputs, eye: Eye | None) -> Sight | None:
        if inputs.house is None or eye is None:
            return None
        return free_way(inputs.house.floor, inputs.scan, eye, self._params.belief.view_range)

    def has_candidate(self, now: float) -> bool:
        """Whether a picture of the last moment shows something that may become an intruder."""
        return any(shows and now - at <= _RECENT for at, shows in self._showing)

    @property
    def met(self) -> Sequence[Person]:
        """Persons who were confirmed."""
        return self._persons.met

    def _find(self, now: float, hypothesis: Hypothesis, inputs: Inputs, eye: Eye | None) -> Finding:
        seen = _confirmation(hypothesis, self.belief.posterior(hypothesis))
        key = hypothesis.number if hypothesis.is_placed else None
        pose = None if eye is None else eye.pose
        stays = inputs.scan is not None and not hypothesis.moved
        person, is_new = self._persons.note(now, seen.measured, key, hypothesis.others, eye=pose, stays=stays)
        room, is_outside = self._room_at(person, inputs.house)
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

    def _point_camera(self, now: float, frame: Frame, somebody: Sequence[Hypothesis], inputs: Inputs) -> None:
        lately = sum(shows and now - at <= _LATELY for at, shows in self._showing)
        if not somebody or (lately < _LEAST_SEEN and not self._camera_tracking.is_on):
            return
        if frame.eye is None or inputs.pose is None or inputs.yaw is None:
            return
        box = max((each.last for each in somebody if each.last is not None), key=lambda each: each.probability)
        column = (box.xmin + box.xmax) / 2.0
        in_odom = frame.eye.pose.yaw - inputs.pose.yaw + inputs.yaw  # a correction of the map's part does not turn odom
        self._camera_tracking.see(now, frame.eye.bearing(column), in_odom)


def _confirmation(hypothesis: Hypothesis, probability: float) -> Confirmation:
    assert hypothesis.best is not None
    others = tuple(b for b in hypothesis.shown if b is not hypothesis.best and b.probability >= _SHOWN)
    return Confirmation(
        label=hypothesis.label,
        probability=probability,
        stamp=hypothesis.picture,
        boxes=(hypothesis.best, *others),
        pictures=hypothesis.boxes,
        measured=_measured(hypothesis),
    )


def _measured(hypothesis: Hypothesis) -> Measured | None:
    """The newest measurement, at the place that all of them give."""
    if hypothesis.measured is None or not hypothesis.is_placed:
        return hypothesis.measured
    x, y = map(float, hypothesis.place)
    return dataclasses.replace(hypothesis.measured, x=x, y=y, error=hypothesis.error)
