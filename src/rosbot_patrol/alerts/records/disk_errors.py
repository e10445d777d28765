"""Errors of the disk and of SQLite, as one kind."""

from __future__ import annotations

import errno
import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from rosbot_patrol.errors import StoreError
from rosbot_patrol.files import DISK_FULL


@contextmanager
def errors_of(path: Path) -> Iterator[None]:
    """Turn what SQLite and the disk report about a file into a StoreError."""
    try:
        yield
    except sqlite3.Error as err:
        name = getattr(err, "sqlite_errorname", "") or ""
        is_corrupt = name.startswith(("SQLITE_CORRUPT", "SQLITE_NOTADB")) or (
            type(err) is sqlite3.DatabaseError and not name
        )
        raise StoreError(path, str(err), is_full=name.startswith("SQLITE_FULL"), is_corrupt=is_corrupt) from err
    except OSError as err:
        is_full = err.errno in DISK_FULL or err.errno == errno.EFBIG  # the file may not grow: less in it helps, too
        raise StoreError(path, f"{err.strerror or err}", is_full=is_full) from err
