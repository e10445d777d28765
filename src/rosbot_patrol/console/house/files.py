"""The files of the owner's house: read, changed with their comments kept, checked by the guard's own code, undone.

A change may concern several files. All of them are checked together before any of them is written, so that a number of
a room that one file names is in the other. The contents before the last change are kept for one undo.
"""

from __future__ import annotations

import io
import json
import os
import tempfile
import threading
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.comments import CommentedMap
from ruamel.yaml.error import YAMLError

from rosbot_patrol.alerts.channels.config import Surroundings, load_channels
from rosbot_patrol.errors import AccessError, ParamError
from rosbot_patrol.files import write_atomic
from rosbot_patrol.maps.zones import ZONES, Zone, read_zones
from rosbot_patrol.patrol.guard.arming import ArmingRules, load_rules
from rosbot_patrol.patrol.guard.schedule import Round, load_schedule
from rosbot_patrol.patrol.house.own_files import (
    ARMING,
    CHANNELS,
    HOUSE,
    ROOMS,
    SCHEDULE,
    SENSORS,
    own_file,
    place_to_write,
)
from rosbot_patrol.patrol.house.rooms import Rooms, load_rooms
from rosbot_patrol.patrol.intruder.known_objects import FOUND_FALSE, KnownObject, load_known
from rosbot_patrol.sensors.sensor_file import SensorList, load_sensors

KNOWN, SHAPES = FOUND_FALSE, ZONES
"""Names of two more files."""

_UNDO = "undo.json"
_NEW = {
    ROOMS: "# Where the robot looks from in each room, and the base (room 0) that it comes home to.\n"
    "# Frame: map, metres.\nrooms_num: 0\nangle_unit: deg\nrooms: {}\n",
    SENSORS: "# Which motion sensor hangs in which room (docs/sensors.md).\nsensors: []\n",
    ARMING: "# What each mode guards, and the times to leave and to come in (docs/patrol.md, Modes).\n"
    "armed_away: {rooms: all, exit_delay: 0.0, entry_delay: 0.0}\n"
    "armed_home: {rooms: all, exit_delay: 0.0, entry_delay: 0.0}\n"
    "night: {rooms: all, exit_delay: 0.0, entry_delay: 0.0}\n",
    SCHEDULE: "# Rounds that the guard makes by itself (docs/patrol.md, Rounds).\nrounds: []\n",
    CHANNELS: "# Ways to the owner, in addition to the launch file's own (docs/alerts.md).\nchannels: {}\n",
    KNOWN: "# Things that look like somebody. A line may be changed or removed; the next mission obeys.\nobjects: []\n",
    SHAPES: "# Where the robot must not go, as corners [x, y] in the frame map [m].\nzones: []\n",
}
_MAY_BE_EMPTY = {SENSORS: "sensors", CHANNELS: "channels"}  # keys without which there had better be no file


@dataclass(frozen=True, kw_only=True)
class Given:
    """Paths of the files that the guard was started with, "" for none."""

    rooms: str = ""
    sensors: str = ""
    arming: str = ""
    schedule: str = ""
    channels: str = ""


class HouseFiles:
    """The files of one house. Thread-safe.

    Args:
        state_dir: of the guard.
        given: what it was started with.
        around: for checking the channels.
        is_new: a new house: nothing counts of the files that come with the program.
    """

    def __init__(self, state_dir: Path, given: Given, around: Surroundings, *, is_new: bool = False) -> None:
        self._state_dir, self._around, self._is_new = state_dir, around, is_new
        self._given = {
            ROOMS: given.rooms,
            SENSORS: given.sensors,
            ARMING: given.arming,
            SCHEDULE: given.schedule,
            CHANNELS: given.channels,
        }
        self._lock = threading.Lock()

    @property
    def existing(self) -> list[Path]:
        """The files that there are."""
        return [path for path in map(self.path, _NEW) if path.exists()]

    @property
    def marks(self) -> tuple[tuple[str, int, int], ...]:
        """What tells whether any of the files has changed."""
        return tuple(_mark(self.path(name)) for name in _NEW)

    # -- reading

    def path(self, name: str) -> Path:
        """The file that counts, or where it would be."""
        if name == KNOWN:
            return self._state_dir / FOUND_FALSE
        if self._is_new:
            return place_to_write(self._given.get(name, ""), self._state_dir, name)
        found = own_file(self._given.get(name, ""), self._state_dir, name)
        return Path(found).expanduser() if found else self._state_dir / HOUSE / name

    @property
    def secrets(self) -> Path:
        """Folder for keys of channels."""
        return self._state_dir / HOUSE / "secrets"

    @property
    def rooms(self) -> Rooms | None:
        """The rooms, None where there are none yet. Raises ParamError."""
        return load_rooms(self.path(ROOMS)) if self.path(ROOMS).exists() else None

    @property
    def sensors(self) -> SensorList:
        """The sensors. Raises ParamError."""
        return _sensors(self.path(SENSORS), self.rooms)

    @property
    def rules(self) -> ArmingRules:
        """The modes. Raises ParamError."""
        rooms, path = self.rooms, self.path(ARMING)
        return load_rules(str(path) if path.exists() else "", rooms) if rooms else ArmingRules()

    @property
    def rounds(self) -> tuple[Round, ...]:
        """The rounds. Raises ParamError."""
        rooms, path = self.rooms, self.path(SCHEDULE)
        return load_schedule(str(path) if path.exists() else "", rooms)[0] if rooms else ()

    @property
    def zones(self) -> tuple[Zone, ...]:
        """The keep-out zones. Raises ParamError."""
        return read_zones(self.path(SHAPES))

    @property
    def known(self) -> tuple[KnownObject, ...]:
        """The known objects that the pages may change. Raises ParamError."""
        return load_known(self.path(KNOWN)) if self.path(KNOWN).exists() else ()

    def tree(self, name: str) -> CommentedMap:
        """A file's keys and values, to be changed; of a new file if there is none. Raises ParamError."""
        path = self.path(name)
        try:
            text = path.read_text("utf-8") if path.exists() else _NEW[name]
            found = _editor().load(text)
        except (OSError, UnicodeDecodeError, YAMLError) as err:
            raise ParamError(str(path), f"cannot be changed: {err}") from err
        if not isinstance(found, CommentedMap):
            raise ParamError(str(path), "cannot be changed: it has no keys")
        return found

    # -- changing

    def save(self, what: str, trees: Mapping[str, CommentedMap]) -> None:
        """Check and write changed files.

        Args:
            what: changed, in some words, for the undo.
            trees: changed keys and values by file; those of a list that became empty remove their file.

        Raises:
            ParamError: a value is wrong; nothing is written. Its name ends with the key, after a slash.
            OSError: the disk does not take it.
        """
        with self._lock:
            texts = {name: "" if _is_empty(name, tree) else _dumped(tree) for name, tree in trees.items()}
            self._check(texts)
            targets = {name: self._target(name) for name in texts}
            before = {
                str(targets[name]): targets[name].read_text("utf-8") if targets[name].exists() else None
                for name in texts
            }
            write_atomic(self._undo_path, json.dumps({"what": what, "before": before}).encode())
            self._write({targets[name]: text or None for name, text in texts.items()})

    @property
    def undoable(self) -> str:
        """What the last change was, in some words; "" if there is none to undo."""
        return str(self._read_undo().get("what", ""))

    def undo(self) -> str:
        """Take the last change back; returns what it was.

        Raises:
            AccessError: there is none.
            OSError: the disk does not take it.
        """
        with self._lock:
            kept = self._read_undo()
            if not kept:
                raise AccessError("the last change", "is not known any more")
            self._write({Path(path): text for path, text in kept["before"].items()})
            self._undo_path.unlink(missing_ok=True)
            return str(kept["what"])

    @property
    def _undo_path(self) -> Path:
        return self._state_dir / "console" / _UNDO

    def _read_undo(self) -> dict[str, Any]:
        try:
            found = json.loads(self._undo_path.read_text("utf-8"))
        except (OSError, ValueError):
            return {}
        return found if isinstance(found, dict) and {"what", "before"} <= found.keys() else {}

    def _target(self, name: str) -> Path:
        return self.path(KNOWN) if name == KNOWN else place_to_write(self._given.get(name, ""), self._state_dir, name)

    def _write(self, texts: Mapping[Path, str | None]) -> None:
        for path, text in texts.items():
            if text is None:
                path.unlink(missing_ok=True)
            else:
                write_atomic(path, text.encode())
                path.chmod(0o600)

    def _check(self, texts: Mapping[str, str]) -> None:
        """Load all files of the house as they would be; raises ParamError with the names of the real ones."""
        with tempfile.TemporaryDirectory(prefix="house-") as folder:
            paths = {}
            for name in _NEW:
                paths[name] = self.path(name)
                if name in texts:
                    paths[name] = Path(folder) / name
                    if texts[name]:
                        paths[name].write_text(texts[name], "utf-8")
                        os.chmod(paths[name], 0o600)
            try:
                self._load(paths, changed=set(texts))
            except ParamError as err:
                raise ParamError(_renamed(err.name, paths, self), _renamed(err.problem, paths, self)) from err

    def _load(self, paths: Mapping[str, Path], changed: set[str]) -> None:
        read_zones(paths[SHAPES])
        if paths[KNOWN].exists():
            load_known(paths[KNOWN])
        if paths[CHANNELS].exists():
            load_channels(paths[CHANNELS], self._around)
        if not paths[ROOMS].exists():
            return
        rooms = load_rooms(paths[ROOMS])
        if not self._is_new or SENSORS in changed:  # in a new house their rooms are marked one by one
            _sensors(paths[SENSORS], rooms)
        load_rules(str(paths[ARMING]) if paths[ARMING].exists() else "", rooms)
        load_schedule(str(paths[SCHEDULE]) if paths[SCHEDULE].exists() else "", rooms)


def _mark(path: Path) -> tuple[str, int, int]:
    try:
        state = path.stat()
    except OSError:
        return str(path), 0, 0
    return str(path), state.st_mtime_ns, state.st_size


def _sensors(path: Path, rooms: Rooms | None) -> SensorList:
    names = {room.id: room.name for room in rooms or ()}
    return load_sensors(str(path) if path.exists() else "", names, rooms_source=rooms.source if rooms else "")


def _renamed(text: str, paths: Mapping[str, Path], files: HouseFiles) -> str:
    for name, path in paths.items():
        text = text.replace(str(path), str(files.path(name)))
    return text


def _editor() -> YAML:
    editor = YAML()
    editor.width = 200
    editor.preserve_quotes = True
    editor.indent(mapping=2, sequence=4, offset=2)
    return editor


def _dumped(tree: CommentedMap) -> str:
    written = io.StringIO()
    _editor().dump(tree, written)
    return written.getvalue()


def _is_empty(name: str, tree: CommentedMap) -> bool:
    key = _MAY_BE_EMPTY.get(name)
    return key is not None and not tree.get(key)
