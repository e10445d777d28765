"""Choice between several velocity sources: the active one of the highest priority drives (twist_mux's rules)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from rosbot_patrol.errors import ParamError
from rosbot_patrol.geometry import STOP, Twist2D
from rosbot_patrol.params import param


@dataclass(frozen=True, kw_only=True)
class SourceParams:
    """One velocity topic."""

    name: str = param(doc="name in messages")
    topic: str = param(doc="topic (geometry_msgs/Twist)")
    timeout: float = param(0.5, lo=0.0, unit="s", doc="silence after which the source is ignored; 0: never")
    priority: int = param(lo=0, hi=255, doc="the active source of the highest priority drives")


@dataclass(frozen=True, kw_only=True)
class LockParams:
    """One lock: while it is true, sources of lower priority are ignored."""

    name: str = param(doc="name in messages")
    topic: str = param(doc="topic (std_msgs/Bool)")
    timeout: float = param(0.0, lo=0.0, unit="s", doc="silence after which it counts as true; 0: never")
    priority: int = param(lo=0, hi=255, doc="sources of lower priority are locked")


@dataclass(frozen=True, kw_only=True)
class MuxParams:
    """Keys of twist_mux's configuration file that the choice needs; the node reads `range_topics` itself."""

    topics: tuple[SourceParams, ...] = param(doc="velocity sources")
    locks: tuple[LockParams, ...] = param((), doc="locks")


@dataclass(frozen=True)
class Choice:
    """Command for the base.

    Attributes:
        source: the source that drives, None: none.
        lock: the lock that holds while no source drives, None: none.
        fresh: whether the command is chosen for the first time.
    """

    source: str | None
    twist: Twist2D
    lock: str | None = None
    fresh: bool = False


class _Input:
    def __init__(self, timeout: float) -> None:
        self.timeout = timeout
        self.stamp = -math.inf

    def has_expired(self, now: float) -> bool:
        if now < self.stamp:  # the clock went back: earlier commands are old
            self.stamp = -math.inf
        return self.timeout > 0.0 and now - self.stamp > self.timeout


class _Source(_Input):
    def __init__(self, params: SourceParams) -> None:
        super().__init__(params.timeout)
        self.params = params
        self.twist: Twist2D | None = None
        self.count = 0


class _Lock(_Input):
    def __init__(self, params: LockParams) -> None:
        super().__init__(params.timeout)
        self.params = params
        self.is_set = False

    def holds(self, now: float) -> bool:
        return self.is_set or self.has_expired(now)


class TwistMux:
    """Chooses between velocity sources.

    Raises:
        ParamError: two sources or locks share a name, or two sources a priority.
    """

    def __init__(self, params: MuxParams) -> None:
        _check_distinct("topics", "name", [s.name for s in params.topics])
        _check_distinct("topics", "priority", [s.priority for s in params.topics])
        _check_distinct("locks", "name", [lock.name for lock in params.locks])
        self._sources = {s.name: _Source(s) for s in sorted(params.topics, key=lambda s: -s.priority)}
        self._locks = {lock.name: _Lock(lock) for lock in sorted(params.locks, key=lambda lock: -lock.priority)}
        self._taken: tuple[str, int] | None = None

    def command(self, name: str, twist: Twist2D, now: float) -> None:
        """Store a source's command; values that are not finite count as a stop."""
        source = self._sources[name]
        source.twist = twist if all(map(math.isfinite, twist)) else STOP
        source.stamp = now
        source.count += 1

    def forget(self, name: str) -> bool:
        """Silence a source whose publisher has gone, until its next command; returns whether it was active."""
        source = self._sources[name]
        had, source.twist = source.twist is not None, None
        return had

    def lock(self, name: str, value: bool, now: float) -> None:
        """Set or release a lock."""
        self._locks[name].is_set = value
        self._locks[name].stamp = now

    def choose(self, now: float) -> Choice:
        """Choose the source that drives now, and its command."""
        barrier = next((lock for lock in self._locks.values() if lock.holds(now)), None)
        for source in self._sources.values():
            if source.twist is None or source.has_expired(now):
                continue
            if barrier is not None and barrier.params.priority > source.params.priority:
                continue
            this = (source.params.name, source.count)
            fresh, self._taken = this != self._taken, this
            return Choice(source.params.name, source.twist, None, fresh)
        self._taken = None
        return Choice(None, STOP, barrier.params.name if barrier is not None else None)


def _check_distinct(group: str, key: str, values: Sequence[object]) -> None:
    for value in values:
        if values.count(value) > 1:
            raise ParamError(f"{group}/{key}", f"{value!r} is given twice")
