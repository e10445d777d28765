"""Files of things in the house that look like somebody: a statue, a coat stand, a poster without depth.

    objects:
      - {name: statue in the hall, x: 2.1, y: 0.4, radius: 0.5, label: person}

`label` may be left out: then no class of object alarms there.

The owner writes one such file. The console adds to another, FOUND_FALSE in the state folder, when somebody calls an
incident a false alarm.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rosbot_patrol import params
from rosbot_patrol.errors import ParamError
from rosbot_patrol.patrol.records.inputs import Measured
from rosbot_patrol.yaml_files import read_mapping

FOUND_FALSE = "known_objects.yaml"


@dataclass(frozen=True, kw_only=True)
class KnownObject:
    """Something that stands in the house and looks like somebody: place in map [m], reach [m], what it is."""

    x: float
    y: float
    radius: float = 0.5
    name: str = "a known object"
    label: str = ""

    def is_at(self, measured: Measured) -> bool:
        """Whether a place may be its own."""
        return math.hypot(measured.x - self.x, measured.y - self.y) <= self.radius + min(measured.error, 0.5)


def _not_finite(value: float) -> str | None:
    return None if math.isfinite(value) else f"is {value}, expected a finite number"


def _bad_name(value: str) -> str | None:
    return None if value.strip() and value.isprintable() else f"is {value!r}, expected one line of text"


@dataclass(frozen=True, kw_only=True)
class _Entry:
    name: str = params.param(doc="name in messages", check=_bad_name)
    x: float = params.param(unit="m", check=_not_finite)
    y: float = params.param(unit="m", check=_not_finite)
    radius: float = params.param(0.5, unit="m", lo=0.05, hi=5.0, doc="radius within which nothing raises an alarm")
    label: str = params.param("", doc="object class that is ignored there; empty: all")


@dataclass(frozen=True, kw_only=True)
class _File:
    objects: list[Any] = params.param(doc="list of the known objects")


def load_known(path: str | Path) -> tuple[KnownObject, ...]:
    """Read the file; nothing where the path is empty.

    Raises:
        ParamError: it cannot be read or is wrong; names the file and the key.
    """
    if not str(path):
        return ()
    path = Path(path).expanduser()
    file = params.load(_File, read_mapping(path, keys="objects"), name=f"{path}: ")
    return tuple(_known(entry, f"{path}: objects/{i}/") for i, entry in enumerate(file.objects))


def _known(tree: Any, name: str) -> KnownObject:
    if not isinstance(tree, dict):
        raise ParamError(name, f"is {tree!r}, expected name, x, y, and maybe radius and label")
    entry = params.load(_Entry, tree, name=name)
    return KnownObject(x=entry.x, y=entry.y, radius=entry.radius, name=entry.name.strip(), label=entry.label)


class KnownObjects:
    """The objects of the owner's file, and of the console's, which is read again whenever it has changed.

    Args:
        path: of the owner's file, "" for none.
        found_false: of the console's file.
        say: takes the problem of the console's file, "" for none; its last good state stays in use.

    Raises:
        ParamError: the owner's file cannot be used.
    """

    def __init__(self, path: str, found_false: Path, say: Callable[[str], None]) -> None:
        self._own, self._path, self._say = load_known(path), found_false, say
        self._found: tuple[KnownObject, ...] = ()
        self._read: tuple[int, int] | None = None

    def __call__(self) -> tuple[KnownObject, ...]:
        """All objects now."""
        try:
            state = self._path.stat()
        except OSError:
            self._found, self._read = (), None
            return self._own
        if (state.st_mtime_ns, state.st_size) != self._read:
            self._read = (state.st_mtime_ns, state.st_size)
            try:
                self._found = load_known(self._path)
                self._say("")
            except ParamError as err:
                self._say(str(err))
        return self._own + self._found
