"""The points file: rooms, and the point from which each is searched.

Matches the tutorial's room_points.yaml (`rooms_num`, `rooms: room0: {name, x, y, angle}`).

Differs:
- `angle_unit: deg|rad` is the unit of `angle`; without it the file is read in radians as in the original, with a
  warning for each angle beyond a full turn.
- `rooms_num` must agree with the rooms listed; each fault is one sentence with file and key.
- Two rooms with the same name cause a warning.
- A duplicate key is a fault, while yaml itself keeps the last.

Files and people name rooms by number or by name.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from rosbot_patrol import params
from rosbot_patrol.errors import ParamError
from rosbot_patrol.files import write_atomic
from rosbot_patrol.geometry import Pose2D, wrap_angle
from rosbot_patrol.yaml_files import read_mapping

log = logging.getLogger(__name__)

MAX_ROOMS = 256  # EspTrigger.id is a byte


@dataclass(frozen=True, kw_only=True)
class Room:
    """A point to search from; room 0 is the base.

    Attributes:
        id: number of the room.
        name: in messages.
        pose: place and heading in the frame `map`.
    """

    id: int
    name: str
    pose: Pose2D

    @property
    def title(self) -> str:
        """Number and name, as in "room 3 (kitchen)"."""
        return f"room {self.id} ({self.name})"


class Rooms:
    """The rooms of one points file."""

    def __init__(self, rooms: tuple[Room, ...], source: str = "the points file") -> None:
        if not rooms:
            raise ParamError(source, "lists no room, expected at least room0, the base")
        self._rooms = {room.id: room for room in rooms}
        self.source = source

    @property
    def base(self) -> Room:
        """Room 0, where the robot waits."""
        return self._rooms[0]

    def find(self, room_id: int) -> Room | None:
        """Room of an id, None if the file has none."""
        return self._rooms.get(room_id)

    def get(self, room_id: int) -> Room:
        """Room of an id in the file. Raises KeyError."""
        return self._rooms[room_id]

    def refusal(self, room_id: int) -> str:
        """Reason in one sentence why an id is refused."""
        return f"there is no room {room_id}: {self.source} has the rooms 0 to {max(self._rooms)}"

    def __iter__(self) -> Iterator[Room]:
        return iter(self._rooms.values())

    def __len__(self) -> int:
        return len(self._rooms)


def _not_finite(value: float) -> str | None:
    return None if math.isfinite(value) else f"is {value}, expected a finite number"


def bad_name(value: str) -> str | None:
    """Problem of a room's name, None if it is valid."""
    if not value.strip():
        return "is empty, expected a name"
    if not value.isprintable():
        return f"is {value!r}, expected one line without control characters"
    return None


@dataclass(frozen=True, kw_only=True)
class _Entry:
    name: str = params.param(doc="name in messages", check=bad_name)
    x: float = params.param(unit="m", check=_not_finite)
    y: float = params.param(unit="m", check=_not_finite)
    angle: float = params.param(doc="heading, in the file's angle_unit", check=_not_finite)


@dataclass(frozen=True, kw_only=True)
class _File:
    rooms_num: int = params.param(lo=1, hi=MAX_ROOMS, doc="number of rooms listed, room0 included")
    rooms: dict[str, Any] = params.param(doc="entries room0, room1, ...")
    angle_unit: str = params.param("", choices=("", "deg", "rad"), doc="unit of every angle")


def load_rooms(path: str | Path) -> Rooms:
    """Read a points file.

    Raises:
        ParamError: it cannot be read or is wrong; names the file and the key.
    """
    path = Path(path)
    prefix = f"{path}: "
    file = params.load(_File, read_mapping(path, keys="rooms_num and rooms"), name=prefix)
    expected = [f"room{i}" for i in range(file.rooms_num)]
    _check_listed(file, expected, prefix)
    rooms = tuple(_room(file, i, key, prefix) for i, key in enumerate(expected))
    _warn_of_namesakes(rooms, prefix)
    return Rooms(rooms, str(path))


def _warn_of_namesakes(rooms: tuple[Room, ...], prefix: str) -> None:
    seen: dict[str, int] = {}
    for room in rooms:
        first = seen.setdefault(room.name.casefold(), room.id)
        if first != room.id:
            log.warning(
                "%srooms/room%d/name is '%s', as room %d's: both are patrolled, but notices and people tell them apart"
                " by number only, and files that mean one of them have to give the number",
                prefix,
                room.id,
                room.name,
                first,
            )


def _check_listed(file: _File, expected: list[str], prefix: str) -> None:
    missing = [key for key in expected if key not in file.rooms]
    extra = [str(key) for key in file.rooms if key not in expected]
    if missing or extra:
        parts = [f"{', '.join(missing)} not listed"] * bool(missing)
        parts += [f"{', '.join(extra)} beyond it"] * bool(extra)
        first, last = expected[0], expected[-1]
        raise ParamError(
            prefix + "rooms_num",
            f"is {file.rooms_num}, expected exactly {first} to {last} under rooms: {' and '.join(parts)}",
        )


def _room(file: _File, index: int, key: str, prefix: str) -> Room:
    entry = params.load(_Entry, file.rooms[key], name=f"{prefix}rooms/{key}/")
    angle = math.radians(entry.angle) if file.angle_unit == "deg" else entry.angle
    if not file.angle_unit and abs(entry.angle) > math.tau:
        log.warning(
            "%srooms/%s/angle is %g and is read in radians (%.1f degrees), as the file has no angle_unit;"
            " is it in degrees? Then add 'angle_unit: deg'",
            prefix,
            key,
            entry.angle,
            math.degrees(wrap_angle(entry.angle)),
        )
    return Room(id=index, name=entry.name.strip(), pose=Pose2D(entry.x, entry.y, wrap_angle(angle)))


def save_rooms(path: str | Path, rooms: Iterable[Room]) -> None:
    """Write a points file atomically; angles in degrees. Raises OSError."""
    listed = list(rooms)
    head = (
        "# Where the robot looks from in each room, and the base (room 0) that it comes home to. Frame: map, metres.\n"
    )
    content = {
        "rooms_num": len(listed),
        "angle_unit": "deg",
        "rooms": {
            f"room{room.id}": {
                "name": room.name,
                "x": round(room.pose.x, 3),
                "y": round(room.pose.y, 3),
                "angle": round(math.degrees(room.pose.yaw), 1),
            }
            for room in listed
        },
    }
    text = head + yaml.safe_dump(content, sort_keys=False, allow_unicode=True)
    write_atomic(Path(path), text.encode())


def choose_rooms(value: Any, rooms: Rooms, name: str) -> tuple[int, ...] | None:
    """Numbers of the rooms for `all`, or a list of numbers and names; None: all.

    Raises:
        ParamError: no list, no such room, or a name that two rooms have.
    """
    if value == "all":
        return None
    if not isinstance(value, list):
        raise ParamError(name, f"is {value!r}, expected all, or a list of rooms by number or name")
    chosen = [_choose(item, rooms, f"{name}[{i}]") for i, item in enumerate(value)]
    return tuple(dict.fromkeys(chosen))


def _choose(item: Any, rooms: Rooms, name: str) -> int:
    if isinstance(item, int) and not isinstance(item, bool):
        if rooms.find(item) is None:
            raise ParamError(name, rooms.refusal(item))
        return item
    found = [room.id for room in rooms if isinstance(item, str) and room.name.casefold() == item.strip().casefold()]
    if len(found) > 1:
        numbers = " and ".join(map(str, found))
        raise ParamError(name, f"'{item}' is the name of the rooms {numbers} in {rooms.source}: give the number")
    if not found:
        raise ParamError(name, f"there is no room '{item}' in {rooms.source}")
    return found[0]
