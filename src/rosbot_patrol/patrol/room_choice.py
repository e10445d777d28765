"""Rooms as files and people name them: by number or by name."""

from __future__ import annotations

from typing import Any

from rosbot_patrol.errors import ParamError
from rosbot_patrol.patrol.rooms import Rooms


def choose_rooms(value: Any, rooms: Rooms, name: str) -> tuple[int, ...] | None:
    """Numbers of the rooms of `all`, or of a list of numbers and names; None for all.

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
