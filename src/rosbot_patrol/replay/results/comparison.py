"""Comparison of a result with a stored one, field by field, each with its tolerance."""

from __future__ import annotations

import fnmatch
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.counts import count_of
from rosbot_patrol.geometry import wrap_angles
from rosbot_patrol.grid import Grid
from rosbot_patrol.replay.results.tables import STAMP, Result, Table

SAME_TIME_S = 1e-6  # rows with closer stamps count as simultaneous
SHOWN = 3  # number of missing rows listed by time

Indices = NDArray[np.int64]


@dataclass(frozen=True, kw_only=True)
class Field:
    """The comparison of one value of a result.

    Attributes:
        tolerance: largest absolute difference; for a map the share of known cells, 0 to 1.
        unit: unit for the report.
        is_angle: differences are wrapped.
        is_by_order: for TABLE.rows: rows are matched by index, not by time.
    """

    tolerance: float = 0.0
    unit: str = ""
    is_angle: bool = False
    is_by_order: bool = False


@dataclass(frozen=True)
class Difference:
    """One field that differs by more than its tolerance.

    Attributes:
        name: name of the field: table.column, counts.name, or a map's name.
        text: the difference, as a sentence.
    """

    name: str
    text: str

    def __str__(self) -> str:
        return f"{self.name}: {self.text}"


@dataclass(frozen=True)
class Pairing:
    """Matching rows of two tables, and the unmatched ones."""

    stored: Indices
    found: Indices
    missing: Indices
    extra: Indices


def compare(stored: Result, found: Result, fields: Mapping[str, Field]) -> list[Difference]:
    """Find all fields that differ by more than their tolerance; empty if the results are equal.

    Args:
        stored: the expected result.
        found: the new result.
        fields: tolerances by name; a name may contain wildcards (poses.*), `TABLE.rows` is for unmatched rows. Fields
            without a tolerance must be equal.
    """
    differences: list[Difference] = []
    if stored.node != found.node:
        return [Difference("node", f"the stored result is of {stored.node}, not of {found.node}")]
    begin = _first_stamp(stored)
    for name in _names(stored.counts, found.counts):
        differences += _compare_counts(name, stored.counts.get(name), found.counts.get(name), fields)
    for name in _names(stored.tables, found.tables):
        differences += _compare_tables(name, stored.tables.get(name, {}), found.tables.get(name, {}), fields, begin)
    for name in _names(stored.grids, found.grids):
        differences += _compare_maps(name, stored.grids.get(name), found.grids.get(name), fields)
    return differences


def field_of(name: str, fields: Mapping[str, Field]) -> Field:
    """Comparison of a field: by its own name, else by the last matching wildcard, else exact."""
    if name in fields:
        return fields[name]
    fitting = [field for pattern, field in fields.items() if fnmatch.fnmatchcase(name, pattern)]
    return fitting[-1] if fitting else Field()


def field_names(result: Result) -> list[str]:
    """All names that can have a tolerance."""
    columns = [f"{table}.{name}" for table, rows in result.tables.items() for name in (*rows, "rows")]
    return [*(f"counts.{name}" for name in result.counts), *columns, *result.grids]


def paired(stored: Table, found: Table, *, is_by_order: bool) -> Pairing:
    """Match the rows of two tables, by time or by index."""
    return (pair_by_order if is_by_order else pair_rows)(stored[STAMP], found[STAMP])


def pair_rows(stored: NDArray[Any], found: NDArray[Any]) -> Pairing:
    """Match rows of one time, by their stamps [s]; simultaneous rows are matched in their order."""
    left, right = _keys(stored), _keys(found)
    places = {key: i for i, key in enumerate(right)}
    pairs = [(i, places[key]) for i, key in enumerate(left) if key in places]
    paired = np.array(pairs, dtype=np.int64).reshape(-1, 2)
    missing = np.setdiff1d(np.arange(len(left)), paired[:, 0])
    extra = np.setdiff1d(np.arange(len(right)), paired[:, 1])
    return Pairing(paired[:, 0], paired[:, 1], missing, extra)


def pair_by_order(stored: NDArray[Any], found: NDArray[Any]) -> Pairing:
    """Match rows by index; surplus rows stay unmatched."""
    both = np.arange(min(len(stored), len(found)))
    return Pairing(both, both, np.arange(len(both), len(stored)), np.arange(len(both), len(found)))


def column_errors(stored: NDArray[Any], found: NDArray[Any], field: Field) -> NDArray[np.float64]:
    """Differences of two columns of equal length, row by row; inf for texts, and for numbers if one is nan."""
    if stored.dtype.kind in "US" or found.dtype.kind in "US":
        return np.where(stored.astype(str) == found.astype(str), 0.0, np.inf)
    a, b = stored.astype(np.float64), found.astype(np.float64)
    with np.errstate(invalid="ignore"):
        errors = np.abs(wrap_angles(b - a)) if field.is_angle else np.abs(b - a)
    errors[a == b] = 0.0  # equal infinities
    errors[np.isnan(a) & np.isnan(b)] = 0.0
    errors[np.isnan(errors)] = np.inf
    return np.asarray(errors)


def map_difference(stored: Grid, found: Grid) -> tuple[NDArray[np.int8], float]:
    """Difference of two maps on a grid that covers both, and the share of the known cells that differ.

    Returns:
        Cells 0 unknown in both, 1 equal, 2 different, and the share, 0 to 1; everything is different if the
        resolutions differ.
    """
    a, b = stored.info, found.info
    if abs(a.resolution - b.resolution) > 1e-9 or abs(a.yaw - b.yaw) > 1e-9:
        return np.full(b.shape, 2, dtype=np.int8), 1.0
    x = round((b.origin_x - a.origin_x) / a.resolution)
    y = round((b.origin_y - a.origin_y) / a.resolution)
    x0, y0 = min(x, 0), min(y, 0)
    shape = max(a.height, y + b.height) - y0, max(a.width, x + b.width) - x0
    left, right = np.full(shape, -1, dtype=np.int8), np.full(shape, -1, dtype=np.int8)
    left[-y0 : a.height - y0, -x0 : a.width - x0] = stored.cells
    right[y - y0 : y - y0 + b.height, x - x0 : x - x0 + b.width] = found.cells
    marks = ((left >= 0) | (right >= 0)).astype(np.int8) + (left != right).astype(np.int8)
    known = int(np.count_nonzero(marks))
    return marks, float(np.count_nonzero(marks == 2) / known) if known else 0.0


def _names(stored: Iterable[str], found: Iterable[str]) -> list[str]:
    return list(dict.fromkeys((*stored, *found)))


def _first_stamp(result: Result) -> float:
    stamps = [float(table[STAMP][0]) for table in result.tables.values() if len(table.get(STAMP, ()))]
    return min(stamps, default=0.0)


def _compare_counts(name: str, stored: int | None, found: int | None, fields: Mapping[str, Field]) -> list[Difference]:
    full = f"counts.{name}"
    tolerance = field_of(full, fields).tolerance
    if stored is not None and found is not None and abs(found - stored) <= tolerance:
        return []
    said = [("none" if value is None else str(value)) for value in (stored, found)]
    return [Difference(full, f"stored {said[0]}, now {said[1]}{_allowed(tolerance, '')}")]


def _compare_tables(
    name: str, stored: Table, found: Table, fields: Mapping[str, Field], begin: float
) -> list[Difference]:
    if STAMP not in stored or STAMP not in found:
        return [Difference(name, "is only in the stored result" if STAMP in stored else "is not in the stored result")]
    is_by_order = field_of(f"{name}.rows", fields).is_by_order
    pairing = paired(stored, found, is_by_order=is_by_order)
    differences = _compare_rows(name, stored, found, pairing, fields, begin=begin)
    times = stored[STAMP][pairing.stored] - begin
    for column in _names(stored, found):
        full = f"{name}.{column}"
        if column == STAMP and not is_by_order:
            continue
        if column not in stored or column not in found:
            where = "is only in the stored result" if column in stored else "is not in the stored result"
            differences.append(Difference(full, f"{where}: record it anew"))
        elif len(times):
            values = stored[column][pairing.stored], found[column][pairing.found]
            differences += _compare_column(full, *values, times, field_of(full, fields))
    return differences


def _compare_rows(
    name: str, stored: Table, found: Table, pairing: Pairing, fields: Mapping[str, Field], *, begin: float
) -> list[Difference]:
    tolerance = field_of(f"{name}.rows", fields).tolerance
    if len(pairing.missing) + len(pairing.extra) <= tolerance:
        return []
    parts = [
        f"{len(rows)} of {len(stamps)} {what} ({_times(stamps[rows] - begin)})"
        for rows, stamps, what in (
            (pairing.missing, stored[STAMP], "stored rows are missing"),
            (pairing.extra, found[STAMP], "rows are new"),
        )
        if len(rows)
    ]
    return [Difference(f"{name}.rows", "; ".join(parts) + _allowed(tolerance, ""))]


def _compare_column(
    name: str, stored: NDArray[Any], found: NDArray[Any], times: NDArray[Any], field: Field
) -> list[Difference]:
    errors = column_errors(stored, found, field)
    wrong = np.flatnonzero(errors > field.tolerance)
    if math.isinf(field.tolerance) or not len(wrong):
        return []
    first, worst = int(wrong[0]), int(np.argmax(errors))
    rows = count_of(len(errors), "row differs", "rows differ")
    text = f"{len(wrong)} of {rows}{_allowed(field.tolerance, field.unit)}; first at "
    text += f"{times[first]:.3f} s (stored {_shown(stored[first])}, now {_shown(found[first])})"
    if np.isfinite(errors[worst]):
        text += f", worst by {_shown(errors[worst])}{_unit(field.unit)} at {times[worst]:.3f} s"
    return [Difference(name, text)]


def _compare_maps(name: str, stored: Grid | None, found: Grid | None, fields: Mapping[str, Field]) -> list[Difference]:
    if stored is None or found is None:
        return [Difference(name, "is only in the stored result" if found is None else "is not in the stored result")]
    tolerance = field_of(name, fields).tolerance
    marks, share = map_difference(stored, found)
    if share <= tolerance:
        return []
    known = int(np.count_nonzero(marks))
    return [Difference(name, f"{share:.2%} of {known} known cells differ (allowed {tolerance:.2%})")]


def _keys(stamps: NDArray[Any]) -> list[tuple[int, int]]:
    """Each stamp in ticks, with the number of equal ones before it."""
    seen: dict[int, int] = {}
    keys = []
    for stamp in np.round(np.asarray(stamps, dtype=np.float64) / SAME_TIME_S).astype(np.int64).tolist():
        seen[stamp] = seen.get(stamp, -1) + 1
        keys.append((stamp, seen[stamp]))
    return keys


def _times(times: NDArray[Any]) -> str:
    shown = ", ".join(f"{time:.3f}" for time in times[:SHOWN])
    return f"at {shown}{', ...' if len(times) > SHOWN else ''} s"


def _allowed(tolerance: float, unit: str) -> str:
    return f" by more than {tolerance:g}{_unit(unit)}" if tolerance else ""


def _unit(unit: str) -> str:
    return f" {unit}" if unit else ""


def _shown(value: Any) -> str:
    return f"{float(value):.6g}" if np.asarray(value).dtype.kind in "fiu" else str(value)
