"""Player of a scenario on an engine: each step at its exact simulated time, on the simulation's thread."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

from rosbot_patrol.errors import ParamError
from rosbot_patrol.params import unknown_name
from rosbot_patrol.simulation.engine import Engine
from rosbot_patrol.simulation.scenario.faults import ALL_SENSORS, DoorwayBlocked, Fault, LinkPoor, SensorFault, Timed
from rosbot_patrol.simulation.scenario.file import ActorEntry, Scenario, Way, pose_of

log = logging.getLogger(__name__)

_CLOSE = 1e-9  # tolerance for equal times [s]


@dataclass(frozen=True)
class _Act:
    after: str
    at: float
    text: str
    do: Callable[[], object]


def _act(entry: Timed, text: str, do: Callable[[], object]) -> _Act:
    return _Act(entry.after, entry.at, text, do)


class ScenarioPlayer:
    """Execute a scenario; call `advance` before each step of the engine.

    Args:
        scenario: the scenario to play.
        engine: engine to play it on; its doorways and doors are added at once.
        trigger: makes a motion sensor call.
        tell: receives each step as a sentence.

    Raises:
        ParamError: the scenario names things that the world does not have; the text names file and key.
    """

    def __init__(
        self, scenario: Scenario, engine: Engine, trigger: Callable[[int], None], tell: Callable[[str], None]
    ) -> None:
        self._scenario = scenario
        self._engine = engine
        self._trigger = trigger
        self._tell = tell
        self._events: dict[str, float] = {}
        engine.faults.doorways.update(scenario.doorways)
        for door in scenario.doors:
            engine.population.spawn_door(door.place)
            engine.population.set_door(door.name, door.opening, 0.0)
        self._check()
        self._waiting = self._acts()
        self._next = -math.inf

    @property
    def waiting(self) -> tuple[str, ...]:
        """Steps that have not been played yet."""
        return tuple(act.text for act in self._waiting)

    def event(self, name: str) -> None:
        """Record an event of the patrol at the present time; only the first of a name counts."""
        if name not in self._events:
            self._events[name] = self._engine.now
            self._next = -math.inf

    def advance(self) -> None:
        """Execute the steps that are due; the first call is the event `start`.

        Raises:
            WorldError: a step is impossible, such as a box at the robot's position.
        """
        self.event("start")
        now = self._engine.now
        if now < self._next - _CLOSE:
            return
        due = sorted((a for a in self._waiting if self._due(a) <= now + _CLOSE), key=self._due)
        for act in due:
            self._waiting.remove(act)
            self._tell(act.text)
            log.info("scenario at %.2f s: %s", now, act.text)
            act.do()
        self._next = min(map(self._due, self._waiting), default=math.inf)

    def _due(self, act: _Act) -> float:
        return self._events.get(act.after, math.inf) + act.at

    def _acts(self) -> list[_Act]:
        s, engine = self._scenario, self._engine
        acts = []
        for actor in s.actors:
            text = f"{actor.name} ({actor.model}) appears at ({actor.start[0]:.1f}, {actor.start[1]:.1f})"
            acts.append(_act(actor, text, partial(self._enter, actor)))
            if actor.stays:
                gone = replace(actor, at=actor.at + actor.stays)
                acts.append(_act(gone, f"{actor.name} is gone", partial(engine.population.remove, actor.name)))
        for walk in s.walks:
            acts.append(_act(walk, f"{walk.actor} walks on", partial(self._walk, walk.actor, walk)))
        for move in s.door_moves:
            text = f"the door {move.door} {'opens' if move.opening else 'closes'}"
            acts.append(_act(move, text, partial(engine.population.set_door, move.door, move.opening, move.speed)))
        for fault in s.faults:
            lasts = f" for {fault.duration:g} s" if fault.duration else ""
            acts.append(_act(fault, f"fault: {fault}{lasts}", partial(self._break, fault)))
        for trigger in s.triggers:
            text = f"motion sensor {trigger.sensor} is made to call"
            acts.append(_act(trigger, text, partial(self._trigger, trigger.sensor)))
        return acts

    def _break(self, fault: Fault) -> None:
        self._engine.faults.begin(fault, self._engine.now)

    def _enter(self, actor: ActorEntry) -> None:
        self._engine.population.spawn_actor(
            actor.name, actor.model, actor.look, pose_of(actor.start), posture=actor.posture
        )
        self._walk(actor.name, actor)

    def _walk(self, name: str, way: Way) -> None:
        if way.roam:
            self._engine.population.roam_actor(name, way.roam, way.speed, pause=way.pause)
        elif way.path:
            path = [pose_of(p) for p in way.path]
            self._engine.population.move_actor(name, path, way.speed, way.loop, pause=way.pause, yields=way.yields)

    def _check(self) -> None:
        """Check that all named things exist."""
        s, engine = self._scenario, self._engine
        actors = [*(a.name for a in s.actors), *(a.name for a in engine.population.walkers)]
        for i, walk in enumerate(s.walks):
            self._known(f"walks[{i}]/actor", walk.actor, actors)
        for i, move in enumerate(s.door_moves):
            self._known(f"door_moves[{i}]/door", move.door, [d.name for d in engine.population.doors])
        for i, trigger in enumerate(s.triggers):
            self._sensor(f"triggers[{i}]/sensor", trigger.sensor)
        for i, fault in enumerate(s.faults):
            self._check_fault(f"faults[{i}]/target", fault)

    def _check_fault(self, key: str, fault: Fault) -> None:
        if isinstance(fault, DoorwayBlocked) and fault.target and fault.x is None:
            self._known(key, fault.target, list(self._engine.faults.doorways))
        if isinstance(fault, SensorFault) or (isinstance(fault, LinkPoor) and fault.target != ALL_SENSORS):
            self._sensor(key, fault.target)

    def _known(self, key: str, name: str, known: list[str]) -> None:
        if name not in known:
            problem = unknown_name(name, known) if known else f"'{name}' is not there, and nothing else either"
            raise ParamError(f"{self._scenario.file}: {key}", problem)

    def _sensor(self, key: str, sensor: int) -> None:
        ids = [place.id for place in self._engine.motion_sensors.places]
        if sensor not in ids:
            there = ", ".join(map(str, ids)) or "none"
            raise ParamError(f"{self._scenario.file}: {key}", f"there is no motion sensor {sensor} (there: {there})")
