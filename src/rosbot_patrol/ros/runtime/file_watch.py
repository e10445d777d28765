"""Files that people change while a node runs."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Iterable
from pathlib import Path

from rosbot_patrol.errors import ParamError
from rosbot_patrol.ros.runtime.diagnostics import OK, WARN, Health

log = logging.getLogger(__name__)

_PERIOD = 1.0  # [s] between two looks


class FileWatch:
    """Looks at files once a second.

    Args:
        paths: of the files, which may be missing.
        check: raises ParamError if their contents cannot be used.
        health: told of contents that cannot be used.
    """

    def __init__(self, paths: Iterable[Path], check: Callable[[], object], health: Health) -> None:
        self._paths, self._check, self._health = tuple(paths), check, health
        self._marks, self._looked, self._is_changed = self._look(), time.monotonic(), False

    def has_news(self) -> bool:
        """Whether the files have changed since the start, and can be used."""
        if time.monotonic() - self._looked < _PERIOD:
            return self._is_changed
        self._looked = time.monotonic()
        marks = self._look()
        if marks == self._marks:
            return self._is_changed
        changed = [
            str(path) for path, before, now in zip(self._paths, self._marks, marks, strict=True) if before != now
        ]
        self._marks = marks
        try:
            self._check()
        except ParamError as err:
            log.error("%s; what was read before stays in use", err)
            self._health.set("files", WARN, f"{err}; what was read before stays in use")
            self._is_changed = False
            return False
        log.info("%s changed", " and ".join(changed))
        self._health.set("files", OK, "the files are well")
        self._is_changed = True
        return True

    def _look(self) -> tuple[tuple[int, int], ...]:
        return tuple(map(_mark, self._paths))


def _mark(path: Path) -> tuple[int, int]:
    try:
        state = path.stat()
    except OSError:
        return 0, 0
    return state.st_mtime_ns, state.st_size
