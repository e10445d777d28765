"""Evaluation of one patrol: its recording, and the guard's own record, compared with ground truth."""

from __future__ import annotations

import logging
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import dropwhile
from pathlib import Path

import numpy as np

from rosbot_patrol.alerts.records.incident import Incident
from rosbot_patrol.alerts.records.store import IncidentStore, has_incidents
from rosbot_patrol.campaign.floor import Floor
from rosbot_patrol.campaign.houses.files import HouseFiles, load_house
from rosbot_patrol.campaign.plan import CONFIRMED, Patrol
from rosbot_patrol.campaign.record import Result
from rosbot_patrol.campaign.share import seen_floor, unseen_shares
from rosbot_patrol.campaign.truth import Presence, Track, place_error, presence, shown, touches
from rosbot_patrol.errors import StoreError
from rosbot_patrol.msg import Alert, PatrolState
from rosbot_patrol.patrol.visibility.coverage import Coverage
from rosbot_patrol.ros.campaign.watch import Recording, State
from rosbot_patrol.ros.models.packages import read_world

_ON_THE_WAY = "going to a further viewpoint"
HOME = 0.35  # largest distance from the start at which the robot counts as home [m]

Times = dict[str, float]

log = logging.getLogger(__name__)


@dataclass(frozen=True, kw_only=True)
class Run:
    """Facts about the programs of one patrol.

    Attributes:
        problem: reason why the house did not run to the end, "" if it did.
        mails: incident of each mail, by its id.
        contacts: names of the things that the robot touched, without the floor.
        wall_s: duration in real time [s].
    """

    problem: str
    mails: Sequence[str]
    contacts: list[str]
    wall_s: float


class Mission:
    """The first mission to a room in a recording.

    Attributes:
        id: id of the mission, None if none has begun.
        states: its states, and the first state after it if there is one.
        end: first state after it, None while it runs.
        triggered: time of the room's first trigger [s], 0 if there was none.
        was_called_again: whether another mission followed, or this one has not ended.
    """

    def __init__(self, heard: Recording, room: int) -> None:
        states = dropwhile(lambda s: not s.message.mission or s.message.room_id != room, heard.states)
        self.states: list[State] = []
        self.id: str | None = None
        self.end: State | None = None
        for state in states:
            self.states.append(state)
            self.id = self.id or state.message.mission
            if state.message.mission != self.id:
                self.end = state
                break
        rest = () if self.end is None else (self.end, *states)
        self.was_called_again = self.end is None or any(s.message.mission for s in rest)
        trigger = next((t for t, triggered in heard.triggers if triggered == room), None)
        self.triggered = trigger or 0.0
        self._start = trigger if trigger is not None or not self.states else self.states[0].time
        self._heard = heard

    @property
    def verdict(self) -> tuple[str, str]:
        """Verdict and reason, both "" before the end."""
        return (self.end.message.last_verdict, self.end.message.why) if self.end is not None else ("", "")

    @property
    def share_told(self) -> float | None:
        """Share of the floor that the guard reports as seen, None if it reports none."""
        largest = max((float(s.message.share_seen) for s in self.states), default=-1.0)
        return largest if largest >= 0.0 else None

    @property
    def viewpoints(self) -> list[float]:
        """Share of the floor that the guard reports at the end of each viewpoint."""
        shares: list[float] = []
        was_looking = False
        for state in self.states:
            message = state.message
            is_looking = message.state == PatrolState.LOOKING and not message.why.startswith(_ON_THE_WAY)
            if is_looking and not was_looking:
                shares.append(0.0)
            if shares and message.share_seen >= 0.0:
                shares[-1] = float(message.share_seen)
            was_looking = is_looking
        return shares

    @property
    def decided(self) -> float | None:
        """Time of the verdict: the first notice, else the end of the look-around [s]."""
        moments = self._moments()
        return moments.get("notice", moments.get("looked"))

    def times(self) -> Times:
        """Seconds from the trigger to later events."""
        return {name: at - self._start for name, at in self._moments().items()} if self._start is not None else {}

    def _moments(self) -> Times:
        if self.id is None or self._start is None:
            return {}
        moments = {
            "goal": _first(t for t in self._heard.goals if t >= self._start),
            "arrived": self._first_state(PatrolState.LOOKING),
            "looked": self._first_state(PatrolState.RETURNING),
            "notice": self._first_alert(Alert.SEEN),
            "mail": self._first_alert(Alert.DELIVERED),
            "home": self.end.time if self.end is not None else None,
        }
        return {name: at for name, at in moments.items() if at is not None}

    def _first_state(self, phase: str) -> float | None:
        return _first(s.time for s in self.states if s.message.state == phase)

    def _first_alert(self, kind: str) -> float | None:
        return _first(t for t, alert in self._heard.alerts if alert.id.startswith(self.id) and alert.kind == kind)


def evaluate(patrol: Patrol, heard: Recording, files: HouseFiles, state_dir: Path, run: Run) -> Result:
    """Compare a recording, and the guard's own record, with ground truth.

    Args:
        patrol: the plan.
        heard: the recording.
        files: of the house.
        state_dir: folder of the guard's state.
        run: facts about the programs.
    """
    mission = Mission(heard, patrol.room)
    verdict, reason = mission.verdict
    times = mission.times()
    robot, tracks = heard.robot_track(), heard.actor_tracks()
    last = mission.decided if mission.decided is not None else _last(robot)
    house = load_house(files, read_world)
    floor = Floor(house.bodies, house.rooms)
    there = presence(floor, patrol.room, patrol.people, tracks, robot, begin=mission.triggered, end=last)
    times |= _from_view(there, heard)
    kept = _kept(state_dir, mission.id)
    seen = _seen(floor, patrol.room, robot, mission)
    viewpoints = mission.viewpoints
    drive = floor.drive_to(patrol.room)
    home = math.dist(robot.poses[-1][:2], robot.poses[0][:2]) if robot.times else None
    return Result(
        number=patrol.number,
        seed=patrol.seed,
        kind=patrol.kind,
        house=patrol.house,
        room=patrol.room,
        title=patrol.title,
        expected=patrol.expected,
        verdict=verdict,
        reason=reason,
        problem=run.problem,
        was_there=there.was_there or (verdict == CONFIRMED and there.was_seen),
        in_room=there.in_room,
        in_view=there.in_view,
        place_error=_place_error(kept, patrol, tracks, last),
        share_told=kept.share_seen if kept is not None else mission.share_told,
        share_true=seen.share if seen is not None else None,
        share_first=viewpoints[0] if viewpoints else None,
        viewpoints=len(viewpoints),
        unseen=unseen_shares(floor, patrol.room, seen) if seen is not None else {},
        way=float(np.hypot(*np.diff(drive, axis=0).T).sum()) if len(drive) else None,
        times={name: round(value, 2) for name, value in times.items()},
        contacts=run.contacts,
        touches=touches(heard.contacts, robot, tracks),
        localisation=heard.localisation(),
        home_error=home,
        home=None if home is None or mission.was_called_again else home < HOME,
        suspects=[event.text for event in kept.events if event.kind == "suspect"] if kept is not None else [],
        mishap=patrol.mishap,
        allowed=patrol.allowed,
        people=len(patrol.people),
        shown=_shown(floor, patrol, tracks, robot, mission),
        mails=sum(mission.id is not None and mail.startswith(mission.id) for mail in run.mails),
        missions=len({s.message.mission for s in heard.states if s.message.mission}),
        sim_s=round(_last(robot), 1),
        wall_s=round(run.wall_s, 1),
    )


def _first(times: Iterable[float]) -> float | None:
    return next(iter(times), None)


def _last(track: Track) -> float:
    return track.times[-1] if track.times else 0.0


def _place_error(kept: Incident | None, patrol: Patrol, tracks: dict[str, Track], time: float) -> float | None:
    if kept is None or not kept.person:
        return None
    return place_error(tracks, patrol.people, time, *kept.person)


def _shown(floor: Floor, patrol: Patrol, tracks: dict[str, Track], robot: Track, mission: Mission) -> int:
    """Number of people whom the camera could see before the end of the look-around, 0 if it did not end."""
    looked = mission.times().get("looked")
    if looked is None:
        return 0
    begin = mission.triggered
    return shown(floor, patrol.people, tracks, robot, begin=begin, end=begin + looked)


def _seen(floor: Floor, room: int, robot: Track, mission: Mission) -> Coverage | None:
    """Floor that the camera really saw from the trigger to the end of the look-around."""
    looked = mission.times().get("looked")
    return seen_floor(floor, room, robot, mission.triggered, mission.triggered + looked) if looked else None


def _from_view(there: Presence, heard: Recording) -> Times:
    """Seconds from the first view of somebody to the notice."""
    if there.first_view is None:
        return {}
    alert = _first(t for t, a in heard.alerts if a.kind == Alert.SEEN and t >= there.first_view - 1.0)
    return {} if alert is None else {"seen_to_notice": max(alert - there.first_view, 0.0)}


def _kept(state_dir: Path, mission: str | None) -> Incident | None:
    """The guard's own record of a mission, None if there is none."""
    if mission is None or not has_incidents(state_dir):
        return None
    try:
        with IncidentStore(state_dir, read_only=True) as store:
            return store.get(mission)
    except StoreError as err:
        log.error("the incident %s cannot be read: %s", mission, err)
        return None
