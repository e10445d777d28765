"""Notices about motion sensors: one for a problem, one when all is well again, several problems in one.

- A problem is reported after it has lasted a while, so that a short Wi-Fi dropout causes no mail.
- All problems of that moment go into the same notice; then there is a pause.
- Sensors that nobody hears because their bridge has gone are the bridge's problem. A sensor that comes and goes is
  reported as flapping, and not each time as silent.
- The notices sent are stored, so that a restart does not repeat them.
- In an unguarded room people move as they like, so motion alone causes no notice about its sensor. If the problem
  lasts, it is reported after the room is guarded again and the motion of those who leave has ended.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from rosbot_patrol.sensors import wording
from rosbot_patrol.sensors.problems import OF_GRAPH, Key, Kind, Problem
from rosbot_patrol.sensors.settings import NoticeTimes
from rosbot_patrol.sensors.supervisor import SensorStatus, Supervisor
from rosbot_patrol.sensors.wording import Item

log = logging.getLogger(__name__)

ALONG = 5.0  # a problem that has lasted this long joins a notice that is due [s]
PATIENCE = 900.0  # time in which a problem reported before a restart may show again [s]
_SAID_BY_MOTION = (Kind.STUCK_ON, Kind.NO_MOTION)
_SHOWN_BY_BEING_HEARD = (Kind.SILENT, Kind.BRIDGE_GONE, Kind.PATROL_GONE)


@dataclass(frozen=True, kw_only=True)
class SensorReport:
    """What the owner hears about sensors: a unique id, a subject line, a text, and the problems in it."""

    id: str
    subject: str
    text: str
    items: tuple[Item, ...]


@dataclass
class _Reported:
    """A problem that the owner knows: its begin [s since 1970]; time since its end [s], None: not over."""

    since: float
    well_since: float | None = None
    is_recalled: bool = False


class Notices:
    """Decides which notices to send.

    Args:
        times: delays and intervals.
        now: time of any monotonic clock [s].
        memory: the last `snapshot` before the program ended.
        is_guarded: whether a room is guarded now; None stands for a sensor without a room.
    """

    def __init__(
        self,
        times: NoticeTimes,
        now: float,
        memory: Mapping[str, Any] | None = None,
        *,
        is_guarded: Callable[[int | None], bool] = lambda room: True,
    ) -> None:
        self._times, self._is_guarded = times, is_guarded
        self._began = now
        self._last = float("-inf")
        self._seen: dict[Key, float] = {}
        self._reported: dict[Key, _Reported] = {}
        self._count = 0
        if memory:
            self._recall(memory)

    def snapshot(self) -> dict[str, Any]:
        """State that must survive a restart, for JSON."""
        reported = [
            [key.kind_name, key.sensor_id, key.bridge, reported.since] for key, reported in self._reported.items()
        ]
        return {"count": self._count, "told": reported}

    def _recall(self, memory: Mapping[str, Any]) -> None:
        try:
            reported = {
                Key(Kind(kind).value, int(sensor_id), str(bridge)): _Reported(float(since), is_recalled=True)
                for kind, sensor_id, bridge, since in memory["told"]
            }
            self._count, self._reported = int(memory["count"]), reported
        except (KeyError, TypeError, ValueError) as err:
            log.warning("the stored notices about sensors are invalid (%r): starting without them", err)

    def update(self, watch: Supervisor, listed: Sequence[SensorStatus], now: float, wall: float) -> SensorReport | None:
        """Report to send now, None: none; call it about once a second.

        Args:
            watch: the supervisor with the present problems.
            listed: all sensors, from `watch.statuses`.
            now: time [s].
            wall: seconds since 1970.
        """
        problems = watch.problems()
        statuses = {status.sensor_id: status for status in listed}
        for key in [key for key in self._seen if key not in problems]:
            del self._seen[key]
        calm = {key for key in problems if self._is_calm(key, watch)}
        for key in problems:
            self._seen.setdefault(key, now)
        for key in calm:
            self._seen[key] = now + watch.motion_pause
        unreported = {key: p for key, p in problems.items() if key not in self._reported and key not in calm}
        new = {key: p for key, p in unreported.items() if not self._is_covered(p, problems)}
        well = self._well(problems, statuses, watch, now)
        due = any(now - self._seen[key] >= self._delay(key) for key in new)
        if not (due or well) or now - self._last < self._times.notice_interval:
            return None
        along = {key: min(ALONG, self._delay(key)) for key in new}
        items = [self._tell(p, watch, wall) for key, p in new.items() if now - self._seen[key] >= along[key]]
        items += self._tell_well(well, watch, wall)
        self._last = now
        self._count += 1
        return self._report(tuple(items), statuses, watch, wall)

    def _delay(self, key: Key) -> float:
        """How long a problem must last [s]; one of the graph may be an attack, and is reported at once."""
        return 0.0 if key.kind in OF_GRAPH else self._times.notice_after

    def _is_calm(self, key: Key, watch: Supervisor) -> bool:
        """Whether the cause of a problem may be people at home."""
        return key.kind in _SAID_BY_MOTION and not self._is_guarded(watch.sensors.room_of(key.sensor_id))

    def _is_covered(self, problem: Problem, problems: Mapping[Key, Problem]) -> bool:
        """Whether another problem already says it."""
        if problem.key.kind is Kind.LINK_GONE:
            return any(key.kind in (Kind.PATROL_GONE, Kind.BRIDGE_GONE) for key in problems)
        if problem.key.kind is not Kind.SILENT:
            return False
        gone = Key(Kind.BRIDGE_GONE.value, bridge=problem.bridge)
        return gone in problems or Key(Kind.FLAPPING.value, problem.key.sensor_id) in problems

    def _well(
        self, problems: Mapping[Key, Problem], statuses: Mapping[int, SensorStatus], watch: Supervisor, now: float
    ) -> list[Key]:
        """Reported problems that are over, for sensors and bridges without other problems."""
        bad = {(key.sensor_id, key.bridge) for key in problems}
        found = []
        for key, reported in self._reported.items():
            if (key.sensor_id, key.bridge) in bad or not self._may_be_well(key, reported, statuses, watch, now):
                reported.well_since = None
                if key in problems:
                    reported.is_recalled = False
                continue
            if reported.well_since is None:
                reported.well_since = now
            if now - reported.well_since >= self._times.well_after:
                found.append(key)
        return found

    def _may_be_well(
        self, key: Key, reported: _Reported, statuses: Mapping[int, SensorStatus], watch: Supervisor, now: float
    ) -> bool:
        """Whether a missing problem means anything: after a restart nothing is known yet."""
        if not reported.is_recalled:
            return True
        if key.kind not in _SHOWN_BY_BEING_HEARD:
            return now - self._began > PATIENCE
        if key.kind is Kind.PATROL_GONE:
            return watch.patrol == key.bridge
        if key.sensor_id < 0:
            return bool(watch.bridges().get(key.bridge))
        status = statuses.get(key.sensor_id)
        return status is not None and status.heard is not None

    def _tell(self, problem: Problem, watch: Supervisor, wall: float) -> Item:
        lasted = watch.age(problem.since)
        self._reported[problem.key] = _Reported(wall - lasted)
        what = problem.what
        if problem.key.kind is Kind.BRIDGE_GONE:
            behind = [
                watch.title(key)
                for key, p in watch.problems().items()
                if key.kind is Kind.SILENT and p.bridge == problem.key.bridge
            ]
            listed = ", ".join(behind[: wording.MAX_LISTED]) + (", ..." if len(behind) > wording.MAX_LISTED else "")
            what += f", and with it of {listed}" if behind else ""
        return Item(
            kind=problem.key.kind, title=watch.title(problem.key), what=what, since=wall - lasted, lasted=lasted
        )

    def _tell_well(self, keys: list[Key], watch: Supervisor, wall: float) -> list[Item]:
        by_title: dict[str, list[Key]] = {}
        for key in keys:
            by_title.setdefault(watch.title(key), []).append(key)
        items = []
        for title, of_one in by_title.items():
            since = min(self._reported.pop(key).since for key in of_one)
            what = wording.short([key.kind for key in of_one])
            of_graph = any(key.kind in OF_GRAPH for key in of_one)
            lasted = max(wall - since, 0.0)
            items.append(Item(kind=None, title=title, what=what, since=since, lasted=lasted, is_of_graph=of_graph))
        return items

    def _report(
        self, items: tuple[Item, ...], statuses: Mapping[int, SensorStatus], watch: Supervisor, wall: float
    ) -> SensorReport:
        expected = [status for status in statuses.values() if status.watched]
        well = sum(not s.problems and not s.waiting for s in expected)
        stamp = time.strftime("%Y%m%dT%H%M%SZ", time.gmtime(wall))
        return SensorReport(
            id=f"{stamp}-sensors{self._count}",
            subject=wording.subject(items),
            text=wording.text(items, watched=len(expected), well=well),
            items=items,
        )
