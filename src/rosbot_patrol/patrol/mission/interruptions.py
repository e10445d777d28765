"""What ends a mission early: a low battery, the emergency stop, disarming, a point off the map, old age."""

from __future__ import annotations

import logging

from rosbot_patrol.patrol.guard.battery import BatteryParams, BatteryWatch
from rosbot_patrol.patrol.guard.modes import DISARMED
from rosbot_patrol.patrol.mission.mission_run import MissionRun
from rosbot_patrol.patrol.mission.missions import Missions
from rosbot_patrol.patrol.records.activity import ON_GUARD, Activity, Place, Whereabouts
from rosbot_patrol.patrol.records.commands import Commands, OwnerMessage
from rosbot_patrol.patrol.records.inputs import Inputs
from rosbot_patrol.patrol.records.mission import Phase, Verdict
from rosbot_patrol.patrol.records.request import Origin

log = logging.getLogger(__name__)

_GUARDING = (Origin.TRIGGER, Origin.SILENT_SENSOR, Origin.SCHEDULE)  # what a disarmed house does not want
_STOP = "emergency stop"


class LowBattery:
    """Sends the robot home while the battery is low, and lets no mission begin.

    A look at somebody goes on, until the battery is empty.

    Args:
        params: thresholds.
        missions: that it ends.
    """

    def __init__(self, params: BatteryParams, missions: Missions) -> None:
        self._battery, self._missions = BatteryWatch(params), missions
        self._charging_wait = params.charging_wait
        self._went_home = False
        self._resting_since: float | None = None
        self._was_told = False  # that no charger is there

    @property
    def is_low(self) -> bool:
        """Whether the robot has to wait at home."""
        return self._battery.is_low

    @property
    def text(self) -> str:
        """What to say at rest."""
        return f"{Activity.WAITING_FOR_BATTERY.value}, which is low ({self._battery.text})"

    def step(self, now: float, inputs: Inputs, out: Commands, *, sees_somebody: bool = False) -> None:
        """Look at the battery.

        Args:
            now: steady time [s].
            inputs: of this step.
            out: takes the commands.
            sees_somebody: the camera shows what may be an intruder.
        """
        run = self._missions.run
        at_rest = run is None and self._missions.way_home is None
        has_changed = self._battery.step(now, inputs.battery, at_rest=at_rest)
        is_low, level = self._battery.is_low, self._battery.text
        if has_changed:
            text = f"the battery is low ({level}): the robot goes home and waits there"
            text = text if is_low else f"the battery is no longer low ({level})"
            (log.warning if is_low else log.info)("%s", text)
            out.words += (OwnerMessage(kind="battery", text=text, is_over=not is_low),)
            self._went_home = False
        if not is_low or run is None or run.mission.phase is Phase.RETURNING:
            return
        looks = run.mission.phase is Phase.LOOKING and (sees_somebody or run.mission.verdict is Verdict.CONFIRMED)
        if not looks or self._battery.is_empty:
            run.give_up(f"the battery is low ({level})")
            run.turn_home(out)

    def rest(self, now: float, out: Commands, *, is_home: bool) -> None:
        """Drive home once while the battery is low; tell the owner if no charger is found.

        Args:
            now: steady time [s].
            out: takes the commands.
            is_home: the robot stands at home.
        """
        if self.is_low and not is_home and not self._went_home and self._missions.way_home is None:
            self._went_home = True
            self._missions.drive_home()
        if self._missions.way_home is None:
            self._tell_of_charger(now, out, is_home=is_home)

    def _tell_of_charger(self, now: float, out: Commands, *, is_home: bool) -> None:
        if not self.is_low or self._battery.is_charging:
            if self._was_told:
                text = f"the battery is being charged ({self._battery.text})"
                text = text if self._battery.is_charging else "the battery is no longer low"
                out.words += (OwnerMessage(kind="charger", text=text, is_over=True),)
            self._resting_since, self._was_told = None, False
            return
        self._resting_since = now if self._resting_since is None else self._resting_since
        if self._was_told or (is_home and now - self._resting_since < self._charging_wait):
            return
        self._was_told = True
        where = "at home, but is not being charged" if is_home else "away from home, where it cannot be charged"
        text = f"the battery is low ({self._battery.text}) and the robot stands {where}: plug it in"
        log.warning("%s", text)
        out.words += (OwnerMessage(kind="charger", text=text),)


class EmergencyHold:
    """Keeps the robot where the emergency stop caught it.

    Args:
        missions: that it ends.

    Attributes:
        is_on: the stop holds the robot.
    """

    def __init__(self, missions: Missions) -> None:
        self._missions = missions
        self.is_on = False

    def step(self, inputs: Inputs, out: Commands) -> bool:
        """Obey the stop; whether it holds."""
        if inputs.stop:
            self._hold(inputs.stop, out)
        elif self.is_on:
            self.is_on = False
            out.words += (OwnerMessage(kind=_STOP, text="the emergency stop is released", is_over=True),)
        return self.is_on

    def _hold(self, why: str, out: Commands) -> None:
        missions, place = self._missions, Place(Whereabouts.STOPPED)
        if not self.is_on:
            self.is_on = True
            out.cancel = out.cancel_all = True
            out.words += (OwnerMessage(kind=_STOP, text=f"{why}: nobody looks until it is released"),)
        missions.way_home = None
        out.goal, out.speed = None, 0.0
        if missions.run is not None:
            missions.run.give_up(why)
            missions.end(missions.run, out, place)
        missions.ready.at_rest = f"{ON_GUARD}, {place.text}"
        missions.say(out, Phase.STOPPED, f"{why}; it holds until it is released")


def drop_the_old(missions: Missions, wall: float, max_age: float, out: Commands) -> None:
    """Give up what was called for so long before a restart that a look would come too late.

    Args:
        missions: that it ends.
        wall: now, in seconds since 1970.
        max_age: of a call [s].
        out: takes the commands.
    """
    hours = max_age / 3600.0
    why = f"the patrol was down for more than {'an hour' if hours == 1.0 else f'{hours:g} hours'}"
    missions.give_up(missions.agenda.drop_called_before(wall - max_age), why, wall, out)
    run = missions.run
    if run is not None and run.mission.called < wall - max_age:
        run.give_up(why)
        missions.end(run, out, Place(Whereabouts.LEFT))


def stand_down(missions: Missions, inputs: Inputs, out: Commands) -> None:
    """Give up what sensors and rounds called for if the house is disarmed."""
    if inputs.guarded.mode != DISARMED:
        return
    why = inputs.guarded.why
    missions.give_up(missions.agenda.queue.drop(*_GUARDING), why, inputs.wall, out)
    run = missions.run
    if run is not None and run.mission.origin in _GUARDING and run.mission.phase is not Phase.RETURNING:
        run.give_up(why)
        run.return_home()
        out.cancel = out.changed = True


def leave_out_off_the_map(run: MissionRun, inputs: Inputs, out: Commands) -> None:
    """End the look at a room with a point off the map: the robot would call another place clear."""
    mission = run.mission
    if inputs.house is None or mission.phase is Phase.RETURNING:
        return
    problem = inputs.house.refusal(mission.room)
    if not problem:
        return
    run.decide(Verdict.UNVERIFIED, f"{mission.room.title} was not looked at: {problem}")
    run.tell_of_call(f"which cannot be looked at: {problem}", out)
    out.cancel = True
    run.turn_home(out)
