"""Changes of the house's files, as a page asks for them: each a function on the files' keys and values."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from ruamel.yaml.comments import CommentedMap, CommentedSeq

from rosbot_patrol.console.house.files import KNOWN, SHAPES, HouseFiles
from rosbot_patrol.errors import AccessError, ParamError
from rosbot_patrol.patrol.house.own_files import ARMING, CHANNELS, ROOMS, SCHEDULE, SENSORS
from rosbot_patrol.patrol.house.rooms import MAX_ROOMS, Room, Rooms
from rosbot_patrol.patrol.intruder.known_objects import KnownObject

_MODES = ("armed_away", "armed_home", "night")


def save_room(files: HouseFiles, room: Room) -> None:
    """Change a room, or add the next one. Raises ParamError, OSError."""
    tree, number, name = files.tree(ROOMS), room.id, room.name.strip()
    rooms = tree.setdefault("rooms", CommentedMap())
    if number > len(rooms) or number >= MAX_ROOMS:
        raise ParamError(f"{files.path(ROOMS)}: rooms_num", f"expected at most {MAX_ROOMS} rooms, in order")
    entry = rooms.setdefault(f"room{number}", CommentedMap())
    angle = math.degrees(room.pose.yaw) if tree.get("angle_unit") == "deg" else room.pose.yaw
    values = {"name": name, "x": round(room.pose.x, 3), "y": round(room.pose.y, 3), "angle": round(angle, 4)}
    _refuse_namesake(files, number, name, rooms)
    entry.update(values)
    tree["rooms_num"] = len(rooms)
    files.save(f"{number} ({name})", {ROOMS: tree})


def _refuse_namesake(files: HouseFiles, number: int, name: str, rooms: Mapping[str, Any]) -> None:
    for key, entry in rooms.items():
        is_other = key != f"room{number}" and isinstance(entry, Mapping)
        if is_other and str(entry.get("name", "")).strip().casefold() == name.casefold():
            raise ParamError(f"{files.path(ROOMS)}: rooms/room{number}/name", f"is '{name}', which {key} has already")


def remove_room(files: HouseFiles, number: int) -> None:
    """Remove a room; the later ones move up, also where other files name them by number.

    Raises:
        AccessError: it is the base, or another file still needs it.
        ParamError, OSError: as for `HouseFiles.save`.
    """
    rooms = files.rooms
    if rooms is None or rooms.find(number) is None or number == 0:
        raise AccessError(f"room {number}", "cannot be removed: the robot needs its base" if number == 0 else "is gone")
    _refuse_needed(files, number, rooms)
    trees = {name: files.tree(name) for name in (ROOMS, ARMING, SCHEDULE) if files.path(name).exists()}
    trees[SENSORS] = files.tree(SENSORS)
    _spell_out(files, trees[SENSORS])
    sensors = trees[SENSORS]["sensors"]
    sensors[:] = [each for each in sensors if each["room"] != number]
    entries = trees[ROOMS]["rooms"]
    for k in range(number, len(rooms) - 1):
        entries[f"room{k}"] = entries[f"room{k + 1}"]
    del entries[f"room{len(rooms) - 1}"]
    trees[ROOMS]["rooms_num"] = len(entries)
    for sensor in sensors:
        if sensor["room"] > number:
            sensor["room"] -= 1
    for listed in _lists_of_rooms(trees):
        listed[:] = [each - 1 if _is_number(each) and each > number else each for each in listed]
    files.save(f"{number} ({rooms.get(number).name})", trees)


def _is_number(value: object) -> bool:
    return isinstance(value, int) and not isinstance(value, bool)


def _lists_of_rooms(trees: Mapping[str, Any]) -> list[list[Any]]:
    arming, schedule = trees.get(ARMING, {}), trees.get(SCHEDULE, {})
    found: list[Any] = [arming.get("entry_rooms"), *(arming.get(mode, {}).get("rooms") for mode in _MODES)]
    found += [entry.get("rooms") for entry in schedule.get("rounds", ())]
    return [each for each in found if isinstance(each, list)]


def _refuse_needed(files: HouseFiles, number: int, rooms: Rooms) -> None:
    name = rooms.get(number).name
    for sensor in files.sensors:
        if sensor.room == number:
            raise AccessError(name, f"is still watched by the motion sensor {sensor.id}: give that another room first")
    trees = {each: files.tree(each) for each in (ARMING, SCHEDULE) if files.path(each).exists()}
    for listed in _lists_of_rooms(trees):
        if any(each == number or str(each).strip().casefold() == name.casefold() for each in listed):
            raise AccessError(name, "is still part of a mode or a round: take it out there first")


def save_sensor(files: HouseFiles, number: int, room: int, name: str, *, is_enabled: bool) -> None:
    """Change a motion sensor, or add one. Raises ParamError, OSError."""
    tree = files.tree(SENSORS)
    _spell_out(files, tree)
    sensors = tree["sensors"]
    entry = next((each for each in sensors if each.get("id") == number), None)
    if entry is None:
        entry = _in_a_line({"id": number})
        sensors.append(entry)
    entry["room"] = room
    _set(entry, "name", name.strip())
    _set(entry, "enabled", None if is_enabled else False)
    files.save(f"motion sensor {number}", {SENSORS: tree})


def remove_sensor(files: HouseFiles, number: int) -> None:
    """Remove a motion sensor. Raises ParamError, OSError."""
    tree = files.tree(SENSORS)
    _spell_out(files, tree)
    tree["sensors"][:] = [each for each in tree["sensors"] if each.get("id") != number]
    files.save(f"motion sensor {number}", {SENSORS: tree})


def spell_out_sensors(files: HouseFiles) -> None:
    """Write a list of the sensors if there is none: an id is its room's number. Raises ParamError, OSError."""
    if not files.path(SENSORS).exists():
        tree = files.tree(SENSORS)
        _spell_out(files, tree)
        files.save("motion sensors", {SENSORS: tree})


def _spell_out(files: HouseFiles, tree: CommentedMap) -> None:
    """Name all sensors where there was no file, which means that an id is the number of its room."""
    if not files.path(SENSORS).exists():
        rooms = files.rooms
        tree["sensors"] = [_in_a_line({"id": room.id, "room": room.id}) for room in rooms or () if room.id]


def save_round(files: HouseFiles, old: str, given: Mapping[str, Any]) -> None:
    """Change the round of a name, or add one where that is "". Raises ParamError, OSError.

    Args:
        files: of the house.
        old: name of the round until now.
        given: keys of RoundSpec; empty ones are left out.
    """
    tree = files.tree(SCHEDULE)
    rounds = _listed(tree, "rounds")
    index = next((i for i, each in enumerate(rounds) if each.get("name") == old), len(rounds))
    entry = _in_a_line({key: value for key, value in given.items() if value not in ("", None, [], 0.0)})
    rounds[index : index + 1] = [entry]
    files.save(f"round {given.get('name') or old}", {SCHEDULE: tree})


def remove_round(files: HouseFiles, name: str) -> None:
    """Remove a round. Raises ParamError, OSError."""
    tree = files.tree(SCHEDULE)
    _listed(tree, "rounds")[:] = [each for each in tree["rounds"] if each.get("name") != name]
    files.save(f"round {name}", {SCHEDULE: tree})


def save_modes(files: HouseFiles, modes: Mapping[str, Mapping[str, Any]], entry_rooms: Sequence[int]) -> None:
    """Change what the modes guard, and through which rooms people come in. Raises ParamError, OSError."""
    tree = files.tree(ARMING)
    for mode, given in modes.items():
        entry = tree.setdefault(mode, _in_a_line({}))
        entry.update(given)
    tree["entry_rooms"] = _sequence(entry_rooms)
    files.save("modes", {ARMING: tree})


def save_quiet_hours(files: HouseFiles, windows: Iterable[Mapping[str, Any]]) -> None:
    """Change the windows in which no round starts. Raises ParamError, OSError."""
    tree = files.tree(ARMING)
    tree["quiet_hours"] = [_in_a_line(window) for window in windows]
    files.save("quiet hours", {ARMING: tree})


def add_zone(files: HouseFiles, name: str, points: Sequence[tuple[float, float]]) -> None:
    """Add a keep-out zone. Raises ParamError, OSError."""
    tree = files.tree(SHAPES)
    if any(each.get("name") == name.strip() for each in _listed(tree, "zones")):
        raise ParamError(f"{files.path(SHAPES)}: zones/name", f"is '{name}', which another zone has already")
    corners = [[round(x, 2), round(y, 2)] for x, y in points]
    tree["zones"].append(_in_a_line({"name": name.strip(), "points": corners}))
    files.save(f"zone {name}", {SHAPES: tree})


def remove_zone(files: HouseFiles, name: str) -> None:
    """Remove a keep-out zone. Raises ParamError, OSError."""
    tree = files.tree(SHAPES)
    _listed(tree, "zones")[:] = [each for each in tree["zones"] if each.get("name") != name]
    files.save(f"zone {name}", {SHAPES: tree})


def add_object(files: HouseFiles, thing: KnownObject) -> None:
    """Add a known object. Raises ParamError, OSError."""
    tree = files.tree(KNOWN)
    entry = {"name": thing.name.strip(), "x": round(thing.x, 2), "y": round(thing.y, 2), "radius": thing.radius}
    _listed(tree, "objects").append(_in_a_line(entry))
    files.save(f"known object {thing.name}", {KNOWN: tree})


def remove_object(files: HouseFiles, index: int) -> None:
    """Remove a known object by its place in the list. Raises ParamError, OSError."""
    tree = files.tree(KNOWN)
    objects = _listed(tree, "objects")
    if not 0 <= index < len(objects):
        raise ParamError(f"{files.path(KNOWN)}: objects", f"there is no object {index}")
    name = objects[index].get("name", "")
    del objects[index]
    files.save(f"known object {name}", {KNOWN: tree})


def save_channel(files: HouseFiles, name: str, given: Mapping[str, Any], secret: tuple[str, str] | None) -> None:
    """Add a way to the owner, or replace the one of that name.

    Args:
        files: of the house.
        name: of the channel.
        given: its keys; empty ones are left out.
        secret: key that names the file of its secret, and the secret; None for none.

    Raises:
        ParamError, OSError: as for `HouseFiles.save`.
    """
    tree = files.tree(CHANNELS)
    entry = CommentedMap({key: value for key, value in given.items() if value not in ("", None, [])})
    undo: Callable[[], None] = lambda: None  # noqa: E731
    if secret is not None:
        key, value = secret
        if not name.replace("_", "").replace("-", "").isalnum():
            raise ParamError(f"{files.path(CHANNELS)}: channels/name", "expected a name of letters, digits, - and _")
        path = files.secrets / name
        before = path.read_bytes() if path.exists() else None
        _write_secret(path, value)
        entry[key] = str(path)

        def undo() -> None:
            path.unlink(missing_ok=True)
            if before is not None:
                _write_secret(path, before.decode("utf-8", "replace"))

    if not isinstance(tree.get("channels"), CommentedMap):
        tree["channels"] = CommentedMap()
    tree["channels"][name] = entry
    try:
        files.save(f"channel {name}", {CHANNELS: tree})
    except (ParamError, OSError):
        undo()
        raise


def remove_channel(files: HouseFiles, name: str) -> None:
    """Remove a way to the owner; its secret stays for the undo. Raises ParamError, OSError."""
    tree = files.tree(CHANNELS)
    if isinstance(tree.get("channels"), CommentedMap):
        tree["channels"].pop(name, None)
    files.save(f"channel {name}", {CHANNELS: tree})


def channel_types(files: HouseFiles) -> dict[str, str]:
    """Type of each channel of the file, by name. Raises ParamError."""
    if not files.path(CHANNELS).exists():
        return {}
    channels = files.tree(CHANNELS).get("channels") or {}
    return {str(name): str(entry.get("type", "")) for name, entry in channels.items() if isinstance(entry, Mapping)}


def _write_secret(path: Any, value: str) -> None:
    path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    path.touch(mode=0o600)
    path.chmod(0o600)
    path.write_text(f"{value.strip()}\n", "utf-8")


def _listed(tree: CommentedMap, key: str) -> CommentedSeq:
    if not isinstance(tree.get(key), CommentedSeq):
        tree[key] = CommentedSeq(tree.get(key) or [])
    if not tree[key]:
        tree[key] = CommentedSeq()  # a list that was written as [] goes on in lines
    found: CommentedSeq = tree[key]
    return found


def _set(entry: CommentedMap, key: str, value: Any) -> None:
    if value in ("", None):
        entry.pop(key, None)
    else:
        entry[key] = value


def _in_a_line(values: Mapping[str, Any]) -> CommentedMap:
    entry = CommentedMap({k: _sequence(v) if isinstance(v, (list, tuple)) else v for k, v in values.items()})
    entry.fa.set_flow_style()
    return entry


def _sequence(values: Iterable[Any]) -> CommentedSeq:
    made = CommentedSeq(_sequence(v) if isinstance(v, (list, tuple)) else v for v in values)
    made.fa.set_flow_style()
    return made
