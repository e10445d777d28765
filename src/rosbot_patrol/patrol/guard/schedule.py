"""Scheduled rounds, at times of day or intervals: config/patrol_schedule.yaml.

    rounds:
      - {name: evening, at: ["22:30", "02:00"], days: [mon, tue, wed, thu, fri], rooms: all}
      - {name: hourly, every: 3600, rooms: [1, kitchen], modes: [armed_away]}

- Times of day (`at`) are wall times in `time_zone`, whatever ROS time says. Each is due once: an hour that is skipped
  or repeated by a change of the clock neither drops nor doubles a round (`wall_times`).
- Intervals (`every`) are counted in ROS time, from the start of the last round of that name, over restarts.
- A missed round (the program was down, the clock was set past it) is run once when that is noticed, however many were
  missed; `missed: skip` leaves it out. A round in a mode that it does not list is left out.
- A clock that goes back by more than LONGEST_BACK was wrong before: the schedule starts again from there.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import timedelta, tzinfo
from pathlib import Path
from typing import Any

from rosbot_patrol import params
from rosbot_patrol.errors import ParamError
from rosbot_patrol.params import param
from rosbot_patrol.patrol.guard.modes import DISARMED, MODES, parse_mode, unknown_mode
from rosbot_patrol.patrol.guard.wall_times import local, moment, parse_days, parse_time, parse_zone
from rosbot_patrol.patrol.house.rooms import Rooms, choose_rooms
from rosbot_patrol.yaml_files import read_mapping

log = logging.getLogger(__name__)

MISSED = 60.0  # [s]; a round noticed later than this counts as missed
LONGEST_BACK = 3 * 3600.0  # [s]
GUARDING = frozenset(MODES) - {DISARMED}


@dataclass(frozen=True, kw_only=True)
class RoundSpec:
    """One entry of `rounds`."""

    name: str = param(doc="name in messages, unique in the file")
    at: list[Any] = param([], doc='times of day, such as "22:30"')
    days: list[Any] = param([], doc="days of the week for those times, mon to sun; empty: every day")
    every: float = param(0.0, unit="s", lo=0.0, doc="interval in ROS time, at least 60; 0: none")
    rooms: Any = param("all", doc="rooms to visit, in this order: all, or a list by number or name")
    modes: list[str] = param([], doc="modes in which the round runs; empty: all but disarmed")
    missed: str = param(
        "once", choices=("once", "skip"), doc="treatment of a missed round: once: run it once, skip: leave it out"
    )


@dataclass(frozen=True, kw_only=True)
class ScheduleFile:
    """Keys of config/patrol_schedule.yaml."""

    rounds: list[Any] = param(doc="list of rounds; may be empty")
    time_zone: str = param("", doc="time zone of the times of day, such as Europe/Warsaw; empty: this machine's")


@dataclass(frozen=True, kw_only=True)
class Round:
    """A round in a particular house.

    Attributes:
        name: in messages; rooms: in order.
        minutes: times of day since midnight; days: Monday 0.
        every: interval in ROS time [s], 0: none.
        modes: in which it runs.
        skips_missed: a missed round is left out.
    """

    name: str
    rooms: tuple[int, ...]
    minutes: tuple[int, ...] = ()
    days: frozenset[int] = frozenset(range(7))
    every: float = 0.0
    modes: frozenset[str] = GUARDING
    skips_missed: bool = False


def load_schedule(path: str, rooms: Rooms) -> tuple[tuple[Round, ...], tzinfo | None]:
    """Read a schedule; "" gives an empty one.

    Raises:
        ParamError: it cannot be read or is wrong; names the file and the key.
    """
    if not path:
        return (), None
    prefix = f"{path}: "
    file = params.load_strict(ScheduleFile, read_mapping(Path(path), keys="rounds"), name=prefix)
    rounds = tuple(_round(item, f"{prefix}rounds[{i}]/", rooms) for i, item in enumerate(file.rounds))
    names = [entry.name for entry in rounds]
    for i, name in enumerate(names):
        if name in names[:i]:
            raise ParamError(f"{prefix}rounds[{i}]/name", f"is '{name}', which rounds[{names.index(name)}] has already")
    return rounds, parse_zone(file.time_zone, f"{prefix}time_zone")


def _mode(name: str, where: str) -> str:
    mode = parse_mode(name)
    if mode is None:
        raise ParamError(where, unknown_mode(name))
    return mode


def _round(item: Any, prefix: str, rooms: Rooms) -> Round:
    spec = params.load_strict(RoundSpec, item, name=prefix)
    if bool(spec.at) == bool(spec.every):
        raise ParamError(f"{prefix}at", "expected either times of day (at) or an interval (every)")
    if 0.0 < spec.every < 60.0:
        raise ParamError(f"{prefix}every", f"is {spec.every:g}, expected at least 60 s")
    modes = frozenset(_mode(name, f"{prefix}modes[{i}]") for i, name in enumerate(spec.modes))
    chosen = choose_rooms(spec.rooms, rooms, f"{prefix}rooms")
    return Round(
        name=spec.name,
        rooms=tuple(all_rooms(rooms)) if chosen is None else chosen,
        minutes=tuple(sorted({parse_time(value, f"{prefix}at[{i}]") for i, value in enumerate(spec.at)})),
        days=parse_days(spec.days, f"{prefix}days"),
        every=spec.every,
        modes=modes or GUARDING,
        skips_missed=spec.missed == "skip",
    )


def all_rooms(rooms: Rooms) -> list[int]:
    """Every room in the file's order, with the base last, because the round ends there."""
    return sorted((room.id for room in rooms), key=lambda number: (number == rooms.base.id, number))


class Schedule:
    """Decides when a round is due.

    Args:
        rounds: of the file.
        zone: of the times of day, None: this machine's.
        memory: the last `snapshot` before the program ended.
    """

    def __init__(
        self, rounds: tuple[Round, ...], zone: tzinfo | None = None, memory: Mapping[str, Any] | None = None
    ) -> None:
        self._rounds, self._zone = rounds, zone
        self._handled = {r.name: _number(memory, r.name) for r in rounds}  # time up to which each round is handled
        self.changed = False

    def snapshot(self) -> dict[str, float]:
        """State that must survive a restart, for JSON: seconds since 1970, or of ROS time, by name."""
        return {name: at for name, at in self._handled.items() if at is not None}

    def step(self, now: float, wall: float, mode: str) -> list[Round]:
        """Rounds that are due; sets `changed` if the snapshot has changed.

        Args:
            now: ROS time [s].
            wall: seconds since 1970.
            mode: of arming.
        """
        before = self.snapshot()
        due = [r for r in self._rounds if (self._is_due_by_clock(r, wall) if r.minutes else self._is_over(r, now))]
        self.changed = self.snapshot() != before
        for entry in due:
            if mode not in entry.modes:
                log.info("the round '%s' is left out, as the mode is %s", entry.name, mode)
        return [entry for entry in due if mode in entry.modes]

    def _is_due_by_clock(self, entry: Round, wall: float) -> bool:
        handled = self._handled[entry.name]
        if handled is None or handled - wall > LONGEST_BACK:
            if handled is not None:
                log.warning("the clock went back: the times of the round '%s' count anew from here", entry.name)
            self._handled[entry.name] = wall
            return False
        last = self._last_time(entry, wall)
        if last is None or last <= handled:
            return False
        self._handled[entry.name] = last
        return self._take(entry, wall - last)

    def _last_time(self, entry: Round, wall: float) -> float | None:
        """Last of the round's times not later than `wall`."""
        today = local(wall, self._zone)
        days = [today - timedelta(days=n) for n in range(8)]
        times = [moment(d, m, self._zone) for d in days if d.weekday() in entry.days for m in entry.minutes]
        return max((at for at in times if at <= wall), default=None)

    def _is_over(self, entry: Round, now: float) -> bool:
        last = self._handled[entry.name]
        if last is None or last > now:  # the round, or simulated time, starts now
            self._handled[entry.name] = now
            return False
        if now - last < entry.every:
            return False
        self._handled[entry.name] = now
        return self._take(entry, now - last - entry.every)

    def _take(self, entry: Round, late: float) -> bool:
        if late <= MISSED:
            return True
        word = "is left out" if entry.skips_missed else "is made now"
        log.warning("the round '%s' was missed %.0f minutes ago and %s", entry.name, late / 60.0, word)
        return not entry.skips_missed


def _number(memory: Mapping[str, Any] | None, name: str) -> float | None:
    value = (memory or {}).get(name)
    return float(value) if isinstance(value, (int, float)) and not isinstance(value, bool) else None
