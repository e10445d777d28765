"""dynamic_reconfigure servers made from our parameter declarations.

Matches dynamic_reconfigure 1.7's servers from outside (`set_parameters`, `parameter_descriptions`,
`parameter_updates`): `dynparam`, its Python client and rqt_reconfigure work with them.

Differs:
- The parameters' declarations say what can be changed; there are no .cfg files.
- A request with an unknown name or a value of another type is refused as a whole, with a sentence; upstream takes the
  valid part of it. A value out of bounds is clamped, as upstream, and reported.
- Only changed values are written to the parameter server, not all of them at the start.
"""

from __future__ import annotations

import logging
import math
import threading
from collections.abc import Callable, Iterable
from types import SimpleNamespace
from typing import Any

import rospy
from dynamic_reconfigure.encoding import encode_config, encode_description
from dynamic_reconfigure.msg import Config, ConfigDescription
from dynamic_reconfigure.srv import Reconfigure, ReconfigureRequest, ReconfigureResponse

from rosbot_patrol.errors import ParamError
from rosbot_patrol.params import unknown_name
from rosbot_patrol.tunable import Tunable, tunable

log = logging.getLogger(__name__)

RESTORE = "restore_defaults"
_KINDS: dict[str, tuple[str, type]] = {
    "float": ("double", float),
    "int": ("int", int),
    "bool": ("bool", bool),
    "str": ("str", str),
}
_MANY = 2**31 - 1
_ALL: dict[str, tuple[Any, Any]] = {
    "float": (-math.inf, math.inf),
    "int": (-_MANY - 1, _MANY),
    "bool": (False, True),
    "str": ("", ""),
}
_GROUP = {"name": "Default", "id": 0, "parent": 0, "type": "", "state": True, "groups": {}}


class ReconfigureServer:
    """The server for one namespace of parameters.

    Args:
        namespace: below the node's own, "" for the node itself; absolute if it begins with a slash.
        params: the current parameters, a dataclass.
        names: names of the parameters that can be changed.
        apply: takes the changed values, returns all parameters after the change; raises ParamError.
    """

    def __init__(
        self, namespace: str, params: Any, names: Iterable[str], apply: Callable[[dict[str, Any]], Any]
    ) -> None:
        self._space = rospy.resolve_name(namespace if namespace.startswith("/") else f"~{namespace}").rstrip("/")
        self._entries = {entry.name: entry for entry in tunable(type(params), [n for n in names if n != RESTORE])}
        self._apply = apply
        self._lock = threading.Lock()
        self._values = self._read(params)
        self._first = dict(self._values)
        self._descriptions = rospy.Publisher(
            f"{self._space}/parameter_descriptions", ConfigDescription, queue_size=10, latch=True
        )
        self._updates = rospy.Publisher(f"{self._space}/parameter_updates", Config, queue_size=10, latch=True)
        self._descriptions.publish(self._describe())
        self._updates.publish(self._config())
        rospy.Service(f"{self._space}/set_parameters", Reconfigure, self._on_set)

    def _read(self, params: Any) -> dict[str, Any]:
        return {name: _KINDS[e.type][1](_plain(getattr(params, name))) for name, e in self._entries.items()}

    def _config(self) -> Config:
        return encode_config({**self._values, RESTORE: False, "groups": _GROUP})

    def _describe(self) -> ConfigDescription:
        restore = Tunable(
            name=RESTORE, type="bool", default=False, lo=None, hi=None, unit="", doc="back to the values at start"
        )
        entries = [*self._entries.values(), restore]
        rows = [
            {
                "name": entry.name,
                "type": _KINDS[entry.type][0],
                "level": 0,
                "description": f"{entry.doc} [{entry.unit}]" if entry.unit else entry.doc,
                "edit_method": "",
            }
            for entry in entries
        ]
        bounds = {entry.name: _bounds(entry) for entry in entries}
        return encode_description(
            SimpleNamespace(
                min={name: low for name, (low, _) in bounds.items()},
                max={name: high for name, (_, high) in bounds.items()},
                defaults={e.name: _KINDS[e.type][1](_plain(e.default)) for e in entries},
                config_description={**_GROUP, "parameters": rows, "groups": []},
            )
        )

    def _on_set(self, request: ReconfigureRequest) -> ReconfigureResponse:
        with self._lock:
            try:
                wanted = self._wanted(request.config)
                changes = {name: value for name, value in wanted.items() if value != self._values[name]}
                if changes:
                    self._take(changes)
            except ParamError as err:
                log.error("not changed: %s", err)
                raise rospy.ServiceException(str(err)) from err
            config = self._config()
            self._updates.publish(config)
            return ReconfigureResponse(config)

    def _take(self, changes: dict[str, Any]) -> None:
        before = self._values
        self._values = self._read(self._apply(changes))
        for name, value in self._values.items():
            if value != before[name]:
                log.info("%s/%s: %s, was %s", self._space, name, value, before[name])
                rospy.set_param(f"{self._space}/{name}", value)

    def _wanted(self, config: Config) -> dict[str, Any]:
        """Values of a request, checked and clamped."""
        given = {item.name: item.value for item in (*config.bools, *config.ints, *config.strs, *config.doubles)}
        if given.pop(RESTORE, False):
            return dict(self._first)
        for name in given:
            if name not in self._entries:
                raise ParamError(f"{self._space}/{name}", unknown_name(name, [*self._entries, RESTORE]))
        return {name: self._checked(self._entries[name], value) for name, value in given.items()}

    def _checked(self, entry: Tunable, value: Any) -> Any:
        name, kind = f"{self._space}/{entry.name}", _KINDS[entry.type][1]
        is_number = kind in (int, float) and not isinstance(value, (bool, str)) and math.isfinite(value)
        if not (is_number and kind(value) == value) and type(value) is not kind:
            raise ParamError(name, f"expected {_KINDS[entry.type][0]}, got {value!r}")
        if kind in (bool, str):
            return value
        if math.isnan(value):
            raise ParamError(name, "expected a number, got nan")
        low, high = _bounds(entry)
        clamped = kind(min(max(value, low), high))
        if clamped != value:
            log.warning("%s: %s is out of bounds, %s is taken", name, value, clamped)
        if math.isinf(clamped):
            raise ParamError(name, f"expected a finite number, got {value!r}")
        return clamped


def _bounds(entry: Tunable) -> tuple[Any, Any]:
    low, high = _ALL[entry.type]
    kind = _KINDS[entry.type][1]
    return low if entry.lo is None else kind(entry.lo), high if entry.hi is None else kind(entry.hi)


def _plain(value: Any) -> Any:
    """Lists in upstream's text form: "[[x, y], ...]" for pairs, "a,b" for numbers."""
    if not isinstance(value, (list, tuple)):
        return value
    if value and isinstance(value[0], (list, tuple)):
        return str([list(v) for v in value])
    return ",".join(map(str, value))
