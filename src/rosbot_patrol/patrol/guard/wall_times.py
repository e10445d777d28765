"""Wall times: times of day, days of the week and windows between two times, in a time zone.

Days and times are those of a wall clock in that zone. When it is put forward, a skipped time is the same moment by the
old clock (02:30 becomes 03:30). When it is put back, a time that occurs twice counts the first time.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from datetime import datetime, timedelta, tzinfo
from typing import Any
from zoneinfo import ZoneInfo, ZoneInfoNotFoundError

from rosbot_patrol.errors import ParamError
from rosbot_patrol.params import unknown_name

_LONG = ("monday", "tuesday", "wednesday", "thursday", "friday", "saturday", "sunday")
DAYS = ("mon", "tue", "wed", "thu", "fri", "sat", "sun")
_TIME = re.compile(r"(\d{1,2}):(\d{2})")


def parse_time(value: Any, name: str) -> int:
    """Minutes since midnight of "22:30".

    yaml reads an unquoted 22:30 as a number to the base of 60, which is just that value.

    Raises:
        ParamError: it is no time of day.
    """
    match = _TIME.fullmatch(value.strip()) if isinstance(value, str) else None
    minutes = int(match[1]) * 60 + int(match[2]) if match and int(match[2]) < 60 else value
    if not isinstance(minutes, int) or isinstance(minutes, bool) or not 0 <= minutes < 1440:
        raise ParamError(name, f"is {value!r}, expected a time of day such as 22:30")
    return minutes


def parse_days(values: Iterable[Any], name: str) -> frozenset[int]:
    """Days of the week, Monday 0; all if none is named.

    Raises:
        ParamError: one is no day.
    """
    days = set()
    for i, value in enumerate(values):
        text = str(value).strip().lower()
        if text not in DAYS + _LONG:
            raise ParamError(f"{name}[{i}]", unknown_name(str(value), DAYS))
        days.add(DAYS.index(text[:3]))
    return frozenset(days or range(7))


def parse_zone(value: str, name: str) -> tzinfo | None:
    """Time zone such as Europe/Warsaw; None: this machine's own.

    Raises:
        ParamError: there is none of that name.
    """
    if not value:
        return None
    try:
        return ZoneInfo(value)
    except (ZoneInfoNotFoundError, ValueError, OSError) as err:
        raise ParamError(name, f"is {value!r}, expected a time zone such as Europe/Warsaw") from err


def moment(day: datetime, minutes: int, zone: tzinfo | None) -> float:
    """Seconds since 1970 of a time on a day."""
    naive = datetime(day.year, day.month, day.day, minutes // 60, minutes % 60)
    return naive.replace(tzinfo=zone).timestamp()


def local(wall: float, zone: tzinfo | None) -> datetime:
    """Date and wall time."""
    return datetime.fromtimestamp(wall, zone)


@dataclass(frozen=True, kw_only=True)
class Window:
    """Time from one time of day to another, over midnight if the second is not later; on the days of its start."""

    start: int
    end: int
    days: frozenset[int] = frozenset(range(7))

    def contains(self, wall: float, zone: tzinfo | None) -> bool:
        """Whether a time lies in it."""
        now = local(wall, zone)
        minutes = now.hour * 60 + now.minute
        if self.start < self.end:
            return self.start <= minutes < self.end and now.weekday() in self.days
        if minutes >= self.start:
            return now.weekday() in self.days
        return minutes < self.end and (now - timedelta(days=1)).weekday() in self.days


def parse_window(value: Any, name: str) -> Window:
    """A window of `{from: "22:00", to: "06:30", days: [mon]}`.

    Raises:
        ParamError: it is none.
    """
    if not isinstance(value, dict):
        raise ParamError(name, f"is {value!r}, expected from, to and perhaps days")
    for key in value:
        if key not in ("from", "to", "days"):
            raise ParamError(f"{name}/{key}", unknown_name(str(key), ("from", "to", "days")))
    for key in ("from", "to"):
        if key not in value:
            raise ParamError(f"{name}/{key}", "is missing, expected a time of day such as 22:30")
    days = value.get("days") or []
    if not isinstance(days, list):
        raise ParamError(f"{name}/days", f"is {days!r}, expected a list such as [mon, fri]")
    return Window(
        start=parse_time(value["from"], f"{name}/from"),
        end=parse_time(value["to"], f"{name}/to"),
        days=parse_days(days, f"{name}/days"),
    )
