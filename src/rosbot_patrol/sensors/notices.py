"""When the owner is told of motion sensors: once, again when all is well, and everything of one time in one notice.

- A problem is told when it has lasted a while, so that a blip of the Wi-Fi is no mail.
- What is wrong at that moment goes into the same notice, however many they are; then there is a pause.
- Sensors that nobody hears because their bridge has gone are the bridge's problem. A sensor that comes and goes is told
  to flap, and not each time to be silent.
- What was told outlives the program: who restarts it is not told again.
- In a room that is not guarded people move as they like: what motion alone says of its sensor is no notice. It is told
  where it still lasts once the room is guarded again, and the motion of those who leave has come to its end.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from rosbot_patrol.sensors import wording
from rosbot_patrol.sensors.problems import Key, Kind, Problem
from rosbot_patrol.sensors.settings import NoticeTimes
from rosbot_patrol.sensors.supervisor import SensorStatus, Supervisor
from rosbot_patrol.sensors.wording import Item

log = logging.getLogger(__name__)

ALONG = 5.0  # a problem that has lasted so long goes along with a notice that is due [s]
PATIENCE = 900.0  # a problem told before a restart may need so long to show again [s]
_SAID_BY_MOTION = (Kind.STUCK_ON, Kind.NO_MOTION)
_SHOWN_BY_BEING_HEARD = (Kind.SILENT, Kind.BRIDGE_GONE, Kind.PATROL_GONE)


@dataclass(frozen=True, kw_only=True)
class Notice:
    """What to send: an id unlike any other's, a line, a text; `items` of it."""

    id: str
    subject: str
    text: str
    items: tuple[Item, ...]


@dataclass
class _Told:
    """A problem that the owner knows of: since when [s since 1970]; how long it is over by now [s], None: it is not."""

    since: float
    well_since: float | None = None
    is_recalled: bool = False


class Notices:
    """Decides what to tell.

    Args:
        times: when.
        now: time, of any monotonic clock [s].
        memory: what `snapshot` gave before the program ended.
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
        self._told: dict[Key, _Told] = {}
        self._count = 0
        if memory:
            self._recall(memory)

    def snapshot(self) -> dict[str, Any]:
        """What has to outlive the program, for JSON."""
        told = [[key.kind_name, key.sensor_id, key.bridge, told.since] for key, told in self._told.items()]
        return {"count": self._count, "told": told}

    def _recall(self, memory: Mapping[str, Any]) -> None:
        try:
            told = {
                Key(Kind(kind).value, int(sensor_id), str(bridge)): _Told(float(since), is_recalled=True)
                for kind, sensor_id, bridge, since in memory["told"]
            }
            self._count, self._told = int(memory["count"]), told
        except (KeyError, TypeError, ValueError) as err:
            log.warning("what was kept of the notices about sensors makes no sense (%r), starting afresh", err)

    def update(self, watch: Supervisor, listed: Sequence[SensorStatus], now: float, wall: float) -> Notice | None:
        """What to send now, None for nothing; call it about once a second.

        Args:
            watch: what is wrong.
            listed: all sensors, as of `watch.statuses`.
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
        untold = {key: p for key, p in problems.items() if key not in self._told and key not in calm}
        new = {key: p for key, p in untold.items() if not self._is_covered(p, problems)}
        well = self._well(problems, statuses, watch, now)
        due = any(now - self._seen[key] >= self._times.notice_after for key in new)
        if not (due or well) or now - self._last < self._times.notice_interval:
            return None
        along = min(ALONG, self._times.notice_after)
        items = [self._tell(p, watch, wall) for key, p in new.items() if now - self._seen[key] >= along]
        items += self._tell_well(well, watch, wall)
        self._last = now
        self._count += 1
        return self._notice(tuple(items), statuses, watch, wall)

    def _is_calm(self, key: Key, watch: Supervisor) -> bool:
        """Whether a problem may be people who are at home."""
        return key.kind in _SAID_BY_MOTION and not self._is_guarded(watch.sensors.room_of(key.sensor_id))

    def _is_covered(self, problem: Problem, problems: Mapping[Key, Problem]) -> bool:
        """Whether another problem says it already."""
        if problem.key.kind is not Kind.SILENT:
            return False
        gone = Key(Kind.BRIDGE_GONE.value, bridge=problem.bridge)
        return gone in problems or Key(Kind.FLAPPING.value, problem.key.sensor_id) in problems

    def _well(
        self, problems: Mapping[Key, Problem], statuses: Mapping[int, SensorStatus], watch: Supervisor, now: float
    ) -> list[Key]:
        """What was told and is over, for sensors and bridges with which nothing else is wrong."""
        bad = {(key.sensor_id, key.bridge) for key in problems}
        found = []
        for key, told in self._told.items():
            if (key.sensor_id, key.bridge) in bad or not self._may_be_well(key, told, statuses, watch, now):
                told.well_since = None
                if key in problems:
                    told.is_recalled = False
                continue
            if told.well_since is None:
                told.well_since = now
            if now - told.well_since >= self._times.well_after:
                found.append(key)
        return found

    def _may_be_well(
        self, key: Key, told: _Told, statuses: Mapping[int, SensorStatus], watch: Supervisor, now: float
    ) -> bool:
        """Whether its absence means anything: after a restart nothing is known yet."""
        if not told.is_recalled:
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
        self._told[problem.key] = _Told(wall - lasted)
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
            since = min(self._told.pop(key).since for key in of_one)
            what = wording.short([key.kind for key in of_one])
            items.append(Item(kind=None, title=title, what=what, since=since, lasted=max(wall - since, 0.0)))
        return items

    def _notice(
        self, items: tuple[Item, ...], statuses: Mapping[int, SensorStatus], watch: Supervisor, wall: float
    ) -> Notice:
        expected = [status for status in statuses.values() if status.watched]
        well = sum(not s.problems and not s.waiting for s in expected)
        stamp = time.strftime("%Y%m%dT%H%M%SZ", time.gmtime(wall))
        return Notice(
            id=f"{stamp}-sensors{self._count}",
            subject=wording.subject(items),
            text=wording.text(items, watched=len(expected), well=well),
            items=items,
        )
