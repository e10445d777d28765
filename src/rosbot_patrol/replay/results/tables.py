"""Results of a replay as tables of named columns over time, and their file format."""

from __future__ import annotations

import hashlib
import io
import json
import zipfile
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.counts import count_of
from rosbot_patrol.errors import ResultError
from rosbot_patrol.files import write_atomic
from rosbot_patrol.grid import Grid, GridInfo

FORMAT = "rosbot_patrol replay 1"
STAMP = "stamp"  # the column [s] that identifies a table's rows

Table = Mapping[str, NDArray[Any]]


@dataclass(frozen=True)
class Result:
    """The result of one replay.

    Attributes:
        node: name of the node.
        facts: its origin: bag, parameters; shown, not compared.
        counts: numbers by name.
        tables: columns of equal length by name; one of them is `stamp` [s].
        grids: maps, int8 cells (-1 unknown, 0 free to 100 occupied).
    """

    node: str
    facts: Mapping[str, str] = field(default_factory=dict)
    counts: Mapping[str, int] = field(default_factory=dict)
    tables: Mapping[str, Table] = field(default_factory=dict)
    grids: Mapping[str, Grid] = field(default_factory=dict)

    @property
    def digest(self) -> str:
        """Digest of the result without its facts: equal for results that are equal bit for bit."""
        found = hashlib.sha256(json.dumps([self.node, dict(self.counts)], sort_keys=True).encode())
        for name, values in sorted(self.arrays().items()):
            found.update(f"{name} {values.dtype} {values.shape}\n".encode())
            found.update(np.ascontiguousarray(values).tobytes())
        for name, grid in sorted(self.grids.items()):
            found.update(f"{name} {asdict(grid.info)}\n".encode())
        return found.hexdigest()[:16]

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Columns of all tables, and cells of all grids, by name."""
        columns = {f"{table}.{name}": values for table, rows in self.tables.items() for name, values in rows.items()}
        return columns | {name: grid.cells for name, grid in self.grids.items()}


class Rows:
    """A table under construction, row by row.

    Args:
        names: names of its columns, the first of them `stamp`.
    """

    def __init__(self, *names: str) -> None:
        self._names = names
        self._rows: list[tuple[Any, ...]] = []

    def __len__(self) -> int:
        return len(self._rows)

    def add(self, *values: Any) -> None:
        """Add a row: floats, ints, bools or texts, in the order of the names."""
        if len(values) != len(self._names):
            raise ValueError(f"{count_of(len(values), 'value')} for {count_of(len(self._names), 'column')}")
        self._rows.append(values)

    def table(self) -> Table:
        """The columns."""
        if not self._rows:
            return {name: np.empty(0) for name in self._names}
        columns = zip(*self._rows, strict=True)
        return {name: np.array(values) for name, values in zip(self._names, columns, strict=True)}


def save_result(path: Path | str, result: Result) -> None:
    """Write a result as one file, an npz (`numpy.load`) with a JSON text in `header`; the bytes are the same each time.

    Raises:
        ResultError: it cannot be written.
    """
    header = {
        "format": FORMAT,
        "node": result.node,
        "facts": dict(result.facts),
        "counts": dict(result.counts),
        "tables": {name: list(table) for name, table in result.tables.items()},
        "grids": {name: asdict(grid.info) for name, grid in result.grids.items()},
    }
    held = io.BytesIO()
    np.savez_compressed(held, header=np.array(json.dumps(header, indent=1, sort_keys=True)), **result.arrays())
    try:
        write_atomic(Path(path), held.getvalue())
    except OSError as err:
        raise ResultError(path, f"cannot be written: {err.strerror}") from err


def load_result(path: Path | str) -> Result:
    """Read a stored result.

    Raises:
        ResultError: it does not exist, is no stored result, or has another version.
    """
    try:
        with np.load(Path(path), allow_pickle=False) as held:
            header = json.loads(str(held["header"]))
            if header.get("format") != FORMAT:
                raise ResultError(path, f"is of format '{header.get('format')}', expected '{FORMAT}': record it anew")
            return _result_of(header, held)
    except OSError as err:
        raise ResultError(path, f"the stored result cannot be read: {err.strerror or err}") from err
    except (ValueError, KeyError, TypeError, EOFError, zipfile.BadZipFile) as err:
        raise ResultError(path, f"is no stored result of a replay ({err}): record one with --record") from err


def _result_of(header: Mapping[str, Any], held: Mapping[str, NDArray[Any]]) -> Result:
    tables = {
        table: {name: np.array(held[f"{table}.{name}"]) for name in names} for table, names in header["tables"].items()
    }
    grids = {name: Grid(GridInfo(**info), np.array(held[name])) for name, info in header["grids"].items()}
    return Result(header["node"], header["facts"], header["counts"], tables, grids)
