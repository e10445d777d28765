"""Parameters that can change at run time: their description for a dynamic_reconfigure server."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeVar

from rosbot_patrol.errors import ParamError
from rosbot_patrol.params import declared, load, unknown_name

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

P = TypeVar("P", bound="DataclassInstance")


@dataclass(frozen=True, kw_only=True)
class Tunable:
    """One such parameter: name, type ("float", "int", "bool" or "str"), default, bounds (None: none), unit, meaning."""

    name: str
    type: str
    default: Any
    lo: float | None
    hi: float | None
    unit: str
    doc: str


def tunable(cls: type[DataclassInstance], names: Iterable[str]) -> tuple[Tunable, ...]:
    """Descriptions of the named parameters of a class, in that order."""
    rows = {key: (kind, default, info) for key, kind, default, info in declared(cls)}
    found = []
    for name in names:
        kind, default, info = rows[name]
        kind = "str" if kind == "Any" else kind
        found.append(
            Tunable(name=name, type=kind, default=default, lo=info.lo, hi=info.hi, unit=info.unit, doc=info.doc)
        )
    return tuple(found)


def changed(params: P, changes: Mapping[str, Any], names: Iterable[str], *, name: str = "") -> P:
    """Copy of the parameters with some changes, checked as at start.

    Raises:
        ParamError: a change is not among `names`, of the wrong type or out of bounds.
    """
    known = list(names)
    for key in changes:
        if key not in known:
            raise ParamError(f"{name}{key}", unknown_name(key, known))
    own = {field.name: getattr(params, field.name) for field in dataclasses.fields(params)}
    plain = {key: value for key, value in own.items() if not dataclasses.is_dataclass(value)}
    loaded = load(type(params), {**plain, **changes}, name=name)
    return dataclasses.replace(params, **{key: getattr(loaded, key) for key in changes})
