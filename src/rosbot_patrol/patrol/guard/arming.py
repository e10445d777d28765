"""Arming: the modes armed_away, armed_home, night and disarmed, with exit and entry delays.

- Arming starts with the exit delay: a sensor's call during it starts no mission.
- A call from an entry room starts the entry delay. The mission starts at once and everything it sees is kept. Notices
  wait for the end of the delay; if the owner disarms before, they are dropped (and stay on record).
- Disarming ends missions started by sensors and rounds at once.
- The mode survives restarts. A fresh install is armed_away without delays, so that the first patrol mails.
- Setting the clock cannot make a delay longer.
- A room can be muted for a while: calls of its sensors start no mission, in any mode.
- `armed` means armed_away.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import tzinfo
from pathlib import Path
from typing import Any

from rosbot_patrol import params
from rosbot_patrol.errors import StateError
from rosbot_patrol.files import read_json
from rosbot_patrol.params import param
from rosbot_patrol.patrol.guard.modes import DISARMED, MODES, parse_mode, unknown_mode
from rosbot_patrol.patrol.guard.wall_times import Window, local, parse_window, parse_zone
from rosbot_patrol.patrol.house.rooms import Room, Rooms, choose_rooms
from rosbot_patrol.patrol.records.inputs import Guarded
from rosbot_patrol.yaml_files import read_mapping

log = logging.getLogger(__name__)

MUTED_MOST = 86400.0  # [s]


@dataclass(frozen=True, kw_only=True)
class ModeSpec:
    """What a mode guards: the groups armed_away, armed_home and night of the file."""

    rooms: Any = param("all", doc="guarded rooms: all, or a list by number or name")
    exit_delay: float = param(30.0, unit="s", lo=0.0, hi=600.0, doc="time to leave the house after arming")
    entry_delay: float = param(
        0.0, unit="s", lo=0.0, hi=600.0, doc="time that notices wait after a call from an entry room"
    )


@dataclass(frozen=True, kw_only=True)
class ArmingFile:
    """Keys of config/arming.yaml."""

    first_mode: str = param("armed_away", choices=MODES, doc="mode after installation")
    entry_rooms: list[Any] = param([], doc="rooms through which people come in, by number or name")
    quiet_hours: list[Any] = param([], doc="windows {from, to, days} in which no round starts")
    time_zone: str = param("", doc="time zone of the quiet hours, such as Europe/Warsaw; empty: this machine's")
    armed_away: ModeSpec = ModeSpec()
    armed_home: ModeSpec = ModeSpec()
    night: ModeSpec = ModeSpec()


@dataclass(frozen=True, kw_only=True)
class Mode:
    """A mode in a particular house: rooms (None: all) and delays [s]."""

    rooms: frozenset[int] | None = None
    exit_delay: float = 0.0
    entry_delay: float = 0.0


@dataclass(frozen=True, kw_only=True)
class ArmingRules:
    """Contents of the file, checked against the rooms of the house."""

    first_mode: str = "armed_away"
    modes: Mapping[str, Mode] = field(default_factory=lambda: {name: Mode() for name in MODES})
    entry_rooms: frozenset[int] = frozenset()
    quiet_hours: tuple[Window, ...] = ()
    zone: tzinfo | None = None


def load_rules(path: str, rooms: Rooms) -> ArmingRules:
    """Read config/arming.yaml; "" gives rules without delays.

    Raises:
        ParamError: it cannot be read or is wrong; names the file and the key.
    """
    if not path:
        return ArmingRules()
    prefix = f"{path}: "
    file = params.load_strict(ArmingFile, read_mapping(Path(path), keys="armed_away"), name=prefix)
    modes = {DISARMED: Mode(rooms=frozenset())}
    for name in MODES[:3]:
        spec: ModeSpec = getattr(file, name)
        chosen = choose_rooms(spec.rooms, rooms, f"{prefix}{name}/rooms")
        kept = None if chosen is None else frozenset(chosen)
        modes[name] = Mode(rooms=kept, exit_delay=spec.exit_delay, entry_delay=spec.entry_delay)
    return ArmingRules(
        first_mode=file.first_mode,
        modes=modes,
        entry_rooms=frozenset(choose_rooms(file.entry_rooms, rooms, f"{prefix}entry_rooms") or ()),
        quiet_hours=tuple(parse_window(w, f"{prefix}quiet_hours[{i}]") for i, w in enumerate(file.quiet_hours)),
        zone=parse_zone(file.time_zone, f"{prefix}time_zone"),
    )


class Arming:
    """The mode and its delays.

    Args:
        rules: of the file.
        memory: the last `snapshot` before the program ended.

    Attributes:
        mode: one of MODES.
    """

    def __init__(self, rules: ArmingRules, memory: Mapping[str, Any] | None = None) -> None:
        self._rules = rules
        self.mode = rules.first_mode
        self._exit_until: float | None = None
        self._entry_until: float | None = None
        self._seen: set[str] = set()
        self._muted: dict[int, float] = {}  # until when, by room
        if memory:
            self._recall(memory)

    def snapshot(self) -> dict[str, Any]:
        """State that must survive a restart, for JSON."""
        return {
            "mode": self.mode,
            "exit_until": self._exit_until,
            "entry_until": self._entry_until,
            "muted": dict(self._muted),
        }

    def _recall(self, memory: Mapping[str, Any]) -> None:
        if memory.get("mode") not in MODES:
            log.error("the mode that was kept, %r, is none: the mode is %s", memory.get("mode"), self.mode)
            return
        self.mode = str(memory["mode"])
        for name in ("exit_until", "entry_until"):
            until = memory.get(name)
            setattr(self, f"_{name}", float(until) if isinstance(until, (int, float)) else None)
        muted = memory.get("muted", {})
        try:
            self._muted = {int(room): float(until) for room, until in muted.items()}
        except (AttributeError, TypeError, ValueError):
            log.error("the muted rooms that were kept, %r, are none: no room is muted", muted)

    def arm(self, name: str, wall: float) -> tuple[bool, str]:
        """Change the mode.

        Args:
            name: of the mode, as typed.
            wall: seconds since 1970.

        Returns:
            Whether it was accepted, and one sentence.
        """
        mode = parse_mode(name)
        if mode is None:
            return False, f"the mode {unknown_mode(name)}; the mode stays {self.mode}"
        was, self.mode = self.mode, mode
        self._entry_until = None
        delay = self._rules.modes[mode].exit_delay if mode != DISARMED else 0.0
        if was == mode and self._exit_until is None:
            return True, f"the mode is {mode} already"
        self._exit_until = wall + delay if delay else None
        after = f"; it guards in {delay:.0f} s" if delay else ""
        return True, f"the mode is {mode} now, it was {was}{after}"

    def mute(self, room: Room, seconds: float, wall: float) -> tuple[bool, str]:
        """Let the sensors of a room start no mission for a while, 0: let them count again.

        Returns:
            Whether it was accepted, and one sentence.
        """
        if not 0.0 <= seconds <= MUTED_MOST:
            return False, f"{room.title} cannot be muted for {seconds:g} s, expected 0 to {MUTED_MOST:g}"
        self._muted.pop(room.id, None)
        if not seconds:
            return True, f"the sensors of {room.title} count again"
        self._muted[room.id] = wall + seconds
        until = local(self._muted[room.id], self._rules.zone)
        return True, f"the sensors of {room.title} start no mission until {until:%H:%M}"

    def follow(self, missions: Mapping[str, int], wall: float) -> None:
        """Start the entry delay if a mission, by id, answers a new call from an entry room."""
        delay = self._rules.modes[self.mode].entry_delay
        for mission, room_id in missions.items():
            if mission not in self._seen and room_id in self._rules.entry_rooms and delay and not self._entry_until:
                self._entry_until = wall + delay
                log.info("the entry delay runs for %.0f s: notices wait", delay)
        self._seen = set(missions)

    def step(self, wall: float) -> Guarded:
        """What is guarded at `wall` seconds since 1970."""
        mode = self._rules.modes[self.mode]
        self._exit_until = _still(self._exit_until, wall, mode.exit_delay)
        self._entry_until = _still(self._entry_until, wall, mode.entry_delay)
        is_leaving = self._exit_until is not None
        self._muted = {room: until for room, until in self._muted.items() if _still(until, wall, MUTED_MOST)}
        return Guarded(
            mode=self.mode,
            rooms=frozenset() if is_leaving or self.mode == DISARMED else mode.rooms,
            why=self._why(wall),
            is_quiet=any(window.contains(wall, self._rules.zone) for window in self._rules.quiet_hours),
            holds_until=self._entry_until,
            muted=dict(self._muted),
        )

    def exit_left(self, wall: float) -> float:
        """Remaining seconds of the exit delay."""
        return max(self._exit_until - wall, 0.0) if self._exit_until is not None else 0.0

    def _why(self, wall: float) -> str:
        if self.mode == DISARMED:
            return "the house is disarmed"
        if self._exit_until is not None:
            return f"the exit delay of {self.mode} runs"
        return ""


def _still(until: float | None, wall: float, delay: float) -> float | None:
    """End of a running delay; a clock that went back does not make it longer."""
    return until if until is not None and 0.0 < until - wall <= delay else None


def read_memory(path: Path) -> Mapping[str, Any]:
    """Read the stored mode; empty, with a warning, if it cannot be used."""
    try:
        return read_json(path) or {}
    except StateError as err:
        log.error("%s; the mode is that of a fresh install", err)
        return {}
