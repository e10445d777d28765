"""Supervision of motion sensors: which are well, which are not, since when; a function of time and messages.

Time is any monotonic wall clock. If the caller itself was stopped for a while (a suspended machine, SIGSTOP) or the
clock goes back, the supervisor's own clock stands still as well. So no sensor counts as silent while nobody could hear
it.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from rosbot_patrol.graph.judge import Fault, Finding
from rosbot_patrol.sensors.problems import (
    OF_GRAPH,
    Event,
    Key,
    Kind,
    Link,
    Problem,
    bridge_key,
    duration,
    sensor_key,
)
from rosbot_patrol.sensors.sensor_file import SensorList
from rosbot_patrol.sensors.settings import WatchTimes
from rosbot_patrol.sensors.tracked import Tracked, clock_words

ASLEEP = 5.0  # a longer pause between calls, or a step back, means that the caller was stopped or its clock set [s]
SETTLING = 15.0  # time after a bridge's start in which new connections are no drop-outs [s]
MAX_BRIDGES = 64

# Times [s] for which a condition must hold to begin, and must not hold to be over.
_DELAYS: dict[Kind, tuple[float, float]] = {
    Kind.PATROL_GONE: (0.0, 3.0),
    Kind.MASTER_GONE: (0.0, 5.0),  # has its own time
    Kind.SECOND_DRIVER: (3.0, 10.0),
    Kind.SECOND_WITNESS: (3.0, 10.0),
    Kind.STRANGE_NODE: (0.0, 10.0),
    Kind.LINK_GONE: (0.0, 5.0),  # has its own time
    Kind.SETTINGS_CHANGED: (0.0, 0.0),
    Kind.SILENT: (0.0, 0.0),  # has its own times
    Kind.FLAPPING: (0.0, 0.0),  # has its own times, too
    Kind.STUCK_ON: (0.0, 0.0),
    Kind.NO_MOTION: (0.0, 0.0),
    Kind.UNKNOWN_ID: (0.0, 0.0),
    Kind.DUPLICATE_ID: (5.0, 30.0),
    Kind.WRONG_PEER: (1.0, 60.0),
    Kind.NEW_ADDRESS: (0.0, 0.0),  # has its own time
    Kind.CLOCK_OFF: (10.0, 30.0),
    Kind.BRIDGE_GONE: (0.0, 15.0),
}


@dataclass
class _Bridge:
    """A bridge: last heard and uninterruptedly present since [s]; time of its last return."""

    heard: float
    since: float
    returns: deque[float]
    clock_offset: float = 0.0


@dataclass
class _Condition:
    """A possible problem: since when it has held, or has not held, without interruption."""

    problem: Problem
    true_since: float
    false_since: float | None = None
    is_active: bool = False


@dataclass(frozen=True, kw_only=True)
class SensorStatus:
    """Present state of one sensor.

    Attributes:
        problems: the worst first.
        waiting: it has not been heard yet, within start_grace.
        enabled: it is not out of service.
        watched: its silence would be noticed.
        link: over which it was last heard, None if unknown; bridge: of that link.
        heard, motion: seconds since the last, None: never.
    """

    sensor_id: int
    problems: tuple[Problem, ...]
    waiting: bool
    enabled: bool
    watched: bool
    link: Link | None
    bridge: str
    heard: float | None
    motion: float | None
    messages: int
    triggers: int


class Supervisor:
    """Tracks all sensors and bridges; both are bounded in number, so memory is too.

    Args:
        sensors: the expected sensors.
        times: limits of problems.
        now: time [s].
    """

    def __init__(self, sensors: SensorList, times: WatchTimes, now: float) -> None:
        self.sensors = sensors
        self._times = times
        self._now = self._last = now
        self._slept = 0.0
        self._bridges: dict[str, _Bridge] = {}
        self._patrol: tuple[str, float] | None = None
        self._graph: tuple[Finding, ...] = ()
        self._conditions: dict[Key, _Condition] = {}
        self._tracked = {spec.id: Tracked(spec, times, now, is_listed=True) for spec in sensors}

    # -- messages

    def heard(self, sensor_id: int, sender: str, now: float, *, move: bool) -> None:
        """Record a message of a sensor, published by a node."""
        tracked = self._tracked.get(sensor_id)
        if tracked is None:
            spec = self.sensors.find(sensor_id)
            tracked = Tracked(spec, self._times, self._own(now), is_listed=False)
            self._tracked[sensor_id] = tracked
        tracked.hear(sender, self._own(now), move=move)

    def linked(self, bridge: str, links: Iterable[Link], now: float, *, clock_offset: float = 0.0) -> None:
        """Record a bridge's report of its links.

        Args:
            bridge: its node name.
            links: all of its connections on which a sensor was heard.
            now: time [s].
            clock_offset: lead of its clock over ours [s].
        """
        t = self._own(now)
        known = self._bridges.get(bridge)
        if known is None and len(self._bridges) >= MAX_BRIDGES:
            del self._bridges[min(self._bridges, key=lambda name: self._bridges[name].heard)]
        if known is None:
            known = self._bridges[bridge] = _Bridge(t, t, deque(maxlen=self._times.flap_count))
        elif t - known.heard > self._times.bridge_after / 2.0:
            known.since = t
            known.returns.append(t)
        known.heard, known.clock_offset = t, clock_offset
        by_sensor: dict[int, list[Link]] = {}
        for link in links:
            by_sensor.setdefault(link.sensor_id, []).append(link)
        settled = t - known.since > SETTLING
        for sensor_id, tracked in self._tracked.items():
            tracked.link(bridge, by_sensor.get(sensor_id, []), t, is_settled=settled)

    def patrol_heard(self, node: str, now: float) -> None:
        """Record a sign of life of the patrol's node."""
        self._patrol = node, self._own(now)

    def addresses(self) -> dict[str, str]:
        """Address of each sensor of the file that speaks without a key, by id."""
        return {str(number): t.address for number, t in self._tracked.items() if t.address and t.is_listed}

    def recall_addresses(self, known: Mapping[str, str]) -> None:
        """Set the addresses of before a restart."""
        for number, tracked in self._tracked.items():
            tracked.address = tracked.address or known.get(str(number), "")

    def graph_seen(self, findings: Iterable[Finding]) -> None:
        """Record what is wrong with the ROS graph now; open ports are no problem of a moment, and left out."""
        self._graph = tuple(each for each in findings if each.fault is not Fault.GRAPH_OPEN)

    def _own(self, now: float) -> float:
        """Time on the supervisor's own clock; a message that waited in a queue may be slightly late."""
        step = now - self._last
        if step < -ASLEEP or step > ASLEEP:
            self._slept += step
            self._last = now
        self._last = max(self._last, now)
        self._now = max(now - self._slept, self._now)
        return self._now

    # -- evaluation

    def tick(self, now: float) -> list[Event]:
        """Changes since the last call; call it a few times a second."""
        t = self._own(now)
        events: list[Event] = []
        held: set[Key] = set()
        for problem in self._present(t):
            held.add(problem.key)
            events += self._hold(problem, t)
        for key in [key for key in self._conditions if key not in held]:
            events += self._release(key, t)
        return events

    def _present(self, t: float) -> Iterable[Problem]:
        gone = {name for name, b in self._bridges.items() if t - b.heard > self._times.bridge_after / 3.0}
        if self._patrol is not None and t - self._patrol[1] > self._times.patrol_after:
            node, heard = self._patrol
            what = "has gone, or hangs: nothing is heard of it, and motion is not answered"
            yield Problem(key=bridge_key(Kind.PATROL_GONE, node), since=heard, what=what)
        for found in self._graph:
            yield Problem(key=bridge_key(Kind(found.fault.value), found.subject), since=t, what=found.what)
        for name, bridge in self._bridges.items():
            yield from self._of_bridge(name, bridge, t)
        for sensor_id, tracked in list(self._tracked.items()):
            if tracked.spec is None:
                if tracked.heard is not None and t - tracked.heard <= self._times.unknown_calm:
                    yield self._problem(Kind.UNKNOWN_ID, sensor_id, tracked.began, self._unknown(sensor_id))
                else:
                    del self._tracked[sensor_id]
                continue
            for kind, (since, what) in tracked.tick(t, bridge_is_there=tracked.bridge not in gone).items():
                yield self._problem(kind, sensor_id, since, what)

    def _of_bridge(self, name: str, bridge: _Bridge, t: float) -> Iterable[Problem]:
        if t - bridge.heard > self._times.bridge_after:
            yield Problem(
                key=bridge_key(Kind.BRIDGE_GONE, name), since=bridge.heard, what="has gone: nothing is heard of it"
            )
        elif abs(bridge.clock_offset) > self._times.clock_limit:
            what = f"runs on a machine whose clock is {clock_words(bridge.clock_offset)}"
            yield Problem(key=bridge_key(Kind.CLOCK_OFF, name), since=t, what=what)
        returns = bridge.returns
        while returns and t - returns[0] > self._times.flap_window:
            returns.popleft()
        if len(returns) == self._times.flap_count:
            what = f"comes and goes: it came back {len(returns)} times within {duration(returns[-1] - returns[0])}"
            yield Problem(key=bridge_key(Kind.FLAPPING, name), since=returns[0], what=what)

    def _unknown(self, sensor_id: int) -> str:
        return f"is not known: {self.sensors.refusal(sensor_id)}"

    def _problem(self, kind: Kind, sensor_id: int, since: float, what: str) -> Problem:
        key, bridge = sensor_key(kind, sensor_id), self._tracked[sensor_id].bridge
        return Problem(key=key, since=since, what=what, bridge=bridge)

    def _hold(self, problem: Problem, t: float) -> list[Event]:
        condition = self._conditions.get(problem.key)
        if condition is None:
            condition = self._conditions[problem.key] = _Condition(problem, t)
        began = condition.problem.since
        condition.problem = problem
        condition.false_since = None
        if condition.is_active:  # it continues: since its first begin
            condition.problem = Problem(key=problem.key, since=began, what=problem.what, bridge=problem.bridge)
            return []
        if t - condition.true_since < _DELAYS[problem.key.kind][0]:
            return []
        condition.is_active = True
        return [self._event(problem, t, active=True)]

    def _release(self, key: Key, t: float) -> list[Event]:
        condition = self._conditions[key]
        if condition.is_active:
            if condition.false_since is None:
                condition.false_since = t
            if t - condition.false_since < _DELAYS[key.kind][1]:
                return []
        del self._conditions[key]
        return [self._event(condition.problem, t, active=False)] if condition.is_active else []

    def _event(self, problem: Problem, t: float, *, active: bool) -> Event:
        lasted = t - problem.since
        who = self.title(problem.key)
        text = f"{who} {problem.what}"
        if not active:
            text = f"{who} is well again: {problem.key.kind_name.replace('_', ' ')} for {duration(lasted)}"
        return Event(problem=problem, active=active, lasted=lasted, text=text)

    # -- reports

    def title(self, key: Key) -> str:
        """Name of a problem's sensor or bridge, for people."""
        if key.kind is Kind.PATROL_GONE:
            return f"the patrol ({key.bridge.strip('/')})"
        if key.kind in OF_GRAPH:
            return key.bridge
        return f"bridge {key.bridge}" if key.sensor_id < 0 else self.sensors.title(key.sensor_id)

    def problems(self) -> dict[Key, Problem]:
        """All present problems."""
        return {key: c.problem for key, c in self._conditions.items() if c.is_active}

    def age(self, since: float) -> float:
        """Age of a problem's time on this clock [s]."""
        return max(self._now - since, 0.0)

    @property
    def motion_pause(self) -> float:
        """Time after the last motion of a leaving person at which a sensor no longer counts as stuck [s]."""
        return self._times.motion_pause

    @property
    def patrol(self) -> str:
        """Name of the patrol's node, "" if it was never heard."""
        return self._patrol[0] if self._patrol is not None else ""

    def bridges(self) -> Mapping[str, bool]:
        """Every bridge heard so far, and whether it is present."""
        gone = {key.bridge for key in self.problems() if key.kind is Kind.BRIDGE_GONE}
        return {name: name not in gone for name in self._bridges}

    def statuses(self) -> list[SensorStatus]:
        """All sensors in the file or heard so far, by id."""
        wrong: dict[int, list[Problem]] = {}
        order = list(Kind)
        for key, problem in self.problems().items():
            wrong.setdefault(key.sensor_id, []).append(problem)
        for listed in wrong.values():
            listed.sort(key=lambda p: order.index(p.key.kind))
        return [self._status(n, t, tuple(wrong.get(n, ()))) for n, t in sorted(self._tracked.items())]

    def _status(self, sensor_id: int, tracked: Tracked, problems: tuple[Problem, ...]) -> SensorStatus:
        return SensorStatus(
            sensor_id=sensor_id,
            problems=problems,
            waiting=tracked.is_waiting(self._now),
            enabled=tracked.spec is None or tracked.spec.enabled,
            watched=tracked.is_watched,
            link=tracked.last_link,
            bridge=tracked.bridge,
            heard=None if tracked.heard is None else self.age(tracked.heard),
            motion=None if tracked.motion is None else self.age(tracked.motion),
            messages=tracked.messages,
            triggers=tracked.triggers,
        )
