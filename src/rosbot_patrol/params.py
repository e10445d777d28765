"""Declaration of parameters as dataclass fields, checked once at the edge.

One frozen, keyword-only dataclass per node or plug-in declares names (upstream's), defaults, units and bounds:

    @dataclass(frozen=True, kw_only=True)
    class DriveParams:
        max_vel_x: float = param(0.5, unit="m/s", lo=0.0, doc="top forward speed")

Differs from dynamic parameter look-ups: every name, type and bound is checked before a node does anything. An unknown
name causes a warning with the nearest known one.

Differs from dynamic parameter look-ups: every name, type and bound is checked before a node does anything, and a
name that no declaration knows is warned of, with the nearest known one.
"""

from __future__ import annotations

import dataclasses
import difflib
import logging
import math
import re
import types
import typing
from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING, Any, Literal, TypeVar

from rosbot_patrol.counts import count_of
from rosbot_patrol.errors import ParamError

log = logging.getLogger(__name__)

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

T = TypeVar("T", bound="DataclassInstance")

_META = "rosbot_patrol.param"

Clamps = Literal["", "both", "above"]


@dataclasses.dataclass(frozen=True, kw_only=True)
class ParamInfo:
    """Metadata of a declaration besides type and default."""

    unit: str = ""
    lo: float | None = None
    hi: float | None = None
    choices: tuple[Any, ...] = ()
    doc: str = ""
    name: str = ""
    check: Callable[[Any], str | None] | None = None
    clamps: Clamps = ""
    ignores_nan: bool = False
    reads_text: bool = False


def param(
    default: Any = dataclasses.MISSING,
    *,
    unit: str = "",
    lo: float | None = None,
    hi: float | None = None,
    choices: Iterable[Any] = (),
    doc: str = "",
    name: str = "",
    check: Callable[[Any], str | None] | None = None,
    clamps: Clamps = "",
    ignores_nan: bool = False,
    reads_text: bool = False,
) -> Any:
    """Declare one parameter as a dataclass field.

    Args:
        default: default value; without it the parameter is required. Lists and dicts are copied.
        unit: SI unit, for the table and the message.
        lo: smallest value allowed; for a sequence, of each element.
        hi: largest value allowed, likewise.
        choices: values allowed.
        doc: its meaning and effect in one line, for docs/parameters.md.
        name: upstream's name, if it is no Python name or differs from the field's.
        check: function that returns what is wrong with a value, or None.
        clamps: bounds to which a value is clamped, with a warning, as upstream's dynamic_reconfigure does at
            start; for the parameters of its .cfg files. "above": less than `lo` is an error, as nothing works there.
        ignores_nan: NaN becomes the default, with a warning.
        reads_text: accept a text with a whole number, as Python's int() does.
    """
    info = ParamInfo(
        unit=unit, lo=lo, hi=hi, choices=tuple(choices), doc=doc, name=name, check=check,
        clamps=clamps, ignores_nan=ignores_nan, reads_text=reads_text,
    )  # fmt: skip
    metadata = {_META: info}
    if isinstance(default, (list, dict)):
        frozen = default
        return dataclasses.field(default_factory=lambda: type(frozen)(frozen), metadata=metadata)
    return dataclasses.field(default=default, metadata=metadata)


def load(cls: type[T], tree: Mapping[str, Any], *, name: str = "~", ignore: Iterable[str] = ()) -> T:
    """Build `cls` from a tree of plain values, and check each value.

    Args:
        cls: a dataclass whose fields are declared by `param`, or are such dataclasses themselves.
        tree: nested dicts, such as `rospy.get_param("~", {})` or a yaml file.
        name: prefix of the names in messages: "~", "/move_base/", "FILE: ".
        ignore: names of other users that cause no warning.

    Raises:
        ParamError: a value is missing, of the wrong type or out of bounds; names the parameter and what was expected.
    """
    if not isinstance(tree, Mapping):
        raise ParamError(name, f"expected a group of parameters, got {tree!r}")
    hints = typing.get_type_hints(cls)
    values: dict[str, Any] = {}
    known: set[str] = set(ignore)
    for field in dataclasses.fields(cls):
        info: ParamInfo = field.metadata.get(_META, ParamInfo())
        key = info.name or field.name
        known.add(key)
        if key in tree and info.ignores_nan and _is_nan(tree[key]):
            log.warning("%s is NaN, its default %s is taken", name + key, field.default)
        elif key in tree:
            values[field.name] = _convert(hints[field.name], tree[key], info, name + key)
        elif _is_required(field):
            raise ParamError(name + key, f"is missing, expected {_describe(hints[field.name], info)}")
        elif dataclasses.is_dataclass(hints[field.name]) and field.default_factory is hints[field.name]:
            values[field.name] = load(hints[field.name], {}, name=name + key + "/")
    for key in tree:
        if key not in known:
            near = difflib.get_close_matches(str(key), [str(k) for k in known], n=1)
            hint = f", did you mean '{near[0]}'?" if near else ""
            log.warning("%s%s is not a parameter known here%s", name, key, hint)
    return cls(**values)


def unknown_name(name: str, known: Iterable[str]) -> str:
    """Message for an unknown name, with the nearest known one."""
    names = list(known)
    near = difflib.get_close_matches(name, names, n=1, cutoff=0.5)
    hint = f"did you mean '{near[0]}'?" if near else f"expected one of {', '.join(names)}"
    return f"'{name}' is not known here, {hint}"


def load_strict(cls: type[T], tree: Mapping[str, Any], *, name: str) -> T:
    """Like `load`, but an undeclared name is an error.

    Raises:
        ParamError: as in `load`, and for an unknown name, with the nearest known one.
    """
    if isinstance(tree, Mapping):
        known = [key for key, *_ in declared(cls)]
        for key in tree:
            if key not in known:
                raise ParamError(f"{name}{key}", unknown_name(str(key), known))
    return load(cls, tree, name=name)


def declared(cls: type[DataclassInstance], group: object = None) -> list[tuple[str, str, Any, ParamInfo]]:
    """The parameters of `cls` as (name, type, default, info), for tables; required ones have default MISSING.

    Args:
        cls: the declaration.
        group: an instance of it with other defaults, as a node declares them for a group of its parameters.
    """
    hints = typing.get_type_hints(cls)
    rows = []
    for field in dataclasses.fields(cls):
        info: ParamInfo = field.metadata.get(_META, ParamInfo())
        default = field.default
        if default is dataclasses.MISSING and field.default_factory is not dataclasses.MISSING:
            default = field.default_factory()
        if group is not None:
            default = getattr(group, field.name)
        rows.append((info.name or field.name, _type_name(hints[field.name]), default, info))
    return rows


def table(cls: type[DataclassInstance], group: object = None) -> str:
    """A Markdown table of the parameters of `cls`; arguments as of `declared`."""
    lines = ["| parameter | default | unit | meaning |", "|---|---|---|---|"]
    for key, _, default, info in declared(cls, group):
        if dataclasses.is_dataclass(default):
            continue
        shown = "(required)" if default is dataclasses.MISSING else f"`{default if default != '' else repr('')}`"
        lines.append(f"| `{key}` | {shown} | {info.unit} | {info.doc} |")
    return "\n".join(lines)


def _is_required(field: dataclasses.Field[Any]) -> bool:
    return field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING


def _convert(hint: Any, value: Any, info: ParamInfo, name: str) -> Any:
    if isinstance(hint, type) and dataclasses.is_dataclass(hint):
        return load(hint, value, name=name + "/")
    value = _typed(hint, value, name, info)
    if info.clamps:
        value = _clamped(value, info, name)
    _check_bounds(value, info, name)
    return value


def _is_nan(value: Any) -> bool:
    return isinstance(value, float) and math.isnan(value)


def _clamped(value: Any, info: ParamInfo, name: str) -> Any:
    """The value, or the bound that it exceeds, with a warning."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return value
    used = value
    if info.clamps == "both" and info.lo is not None and value < info.lo:
        used = type(value)(info.lo)
    if info.hi is not None and value > info.hi:
        used = type(value)(info.hi)
    if used != value:
        log.warning("%s is %s, which is out of bounds: %s is taken", name, value, used)
    return used


def _typed(hint: Any, value: Any, name: str, info: ParamInfo) -> Any:
    """A value as its type wants it; raises ParamError if it does not fit."""
    origin = typing.get_origin(hint)
    if origin in (typing.Union, types.UnionType):
        if value is None and type(None) in typing.get_args(hint):
            return None
        inner = [a for a in typing.get_args(hint) if a is not type(None)]
        return _typed(inner[0], value, name, info)
    if origin in (list, tuple):
        return _sequence(hint, value, name, info)
    if hint is Any:
        return value
    found = _scalar(hint, value, info)
    if found is None:
        raise ParamError(name, f"expected {_describe(hint, info)}, got {value!r}")
    return found


def _scalar(hint: Any, value: Any, info: ParamInfo) -> Any:
    """A number, text, truth value or group; None if it does not fit."""
    if typing.get_origin(hint) is dict:
        return dict(value) if isinstance(value, Mapping) else None
    if hint is float:
        return _float(value)
    if hint is int:
        return _int(value, reads_text=info.reads_text)
    return value if isinstance(value, hint) else None


def _float(value: Any) -> float | None:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or math.isnan(value):
        return None
    return float(value)


def _int(value: Any, *, reads_text: bool) -> int | None:
    if isinstance(value, bool):
        return None
    if isinstance(value, float):
        return int(value) if value.is_integer() else None
    if reads_text and isinstance(value, str) and re.fullmatch(r"\s*[-+]?\d+\s*", value):
        return int(value)
    return value if isinstance(value, int) else None


def _sequence(hint: Any, value: Any, name: str, info: ParamInfo) -> Any:
    if not isinstance(value, (list, tuple)):
        raise ParamError(name, f"expected {_describe(hint, info)}, got {value!r}")
    args = typing.get_args(hint)
    kind = typing.get_origin(hint)
    if kind is list or (len(args) == 2 and args[1] is Ellipsis):
        inner = [args[0]] * len(value)
    else:
        inner = list(args)
        if len(inner) != len(value):
            raise ParamError(name, f"expected {count_of(len(inner), 'value')}, got {len(value)}: {value!r}")
    items = [_element(h, v, f"{name}[{i}]", info) for i, (h, v) in enumerate(zip(inner, value, strict=True))]
    return kind(items)


def _element(hint: Any, value: Any, name: str, info: ParamInfo) -> Any:
    if isinstance(hint, type) and dataclasses.is_dataclass(hint):
        return load(hint, value, name=name + "/")
    return _typed(hint, value, name, info)


def _check_bounds(value: Any, info: ParamInfo, name: str) -> None:
    for item in value if isinstance(value, (list, tuple)) else [value]:
        if isinstance(item, (int, float)) and not isinstance(item, bool):
            if info.lo is not None and item < info.lo:
                raise ParamError(name, f"is {item}, expected at least {info.lo} {info.unit}".rstrip())
            if info.hi is not None and item > info.hi:
                raise ParamError(name, f"is {item}, expected at most {info.hi} {info.unit}".rstrip())
        if info.choices and item not in info.choices:
            raise ParamError(name, f"is {item!r}, expected one of {', '.join(map(str, info.choices))}")
    if info.check is not None:
        problem = info.check(value)
        if problem:
            raise ParamError(name, problem)


def _type_name(hint: Any) -> str:
    return getattr(hint, "__name__", str(hint)) if typing.get_origin(hint) is None else str(hint)


def _describe(hint: Any, info: ParamInfo) -> str:
    text = _kind(hint)
    if info.choices:
        text += f" of {', '.join(map(str, info.choices))}"
    return f"{text} [{info.unit}]" if info.unit else text


def _kind(hint: Any) -> str:
    """Name of a value's type, for people."""
    args = [a for a in typing.get_args(hint) if a not in (type(None), Ellipsis)]
    origin = typing.get_origin(hint)
    if origin in (typing.Union, types.UnionType):
        return _kind(args[0])
    if origin in (list, tuple):
        return "a list" if not args or len(set(args)) > 1 else f"a list, each {_kind(args[0])}"
    if origin is dict or dataclasses.is_dataclass(hint):
        return "a group of parameters"
    names = {"float": "a number", "int": "a whole number", "bool": "true or false", "str": "a text"}
    return names.get(_type_name(hint), _type_name(hint))
