"""Bring the records of the pure modules (`logging.getLogger("rosbot_patrol...")`) to the console and /rosout."""

from __future__ import annotations

import logging


class _ToRosout(logging.Handler):
    def __init__(self) -> None:
        super().__init__()
        self._rosout = logging.getLogger("rosout")

    def emit(self, record: logging.LogRecord) -> None:
        self._rosout.handle(record)


def install() -> None:
    """Hand every record of this package to the logger `rosout`; call once, after `init_node`."""
    package = logging.getLogger("rosbot_patrol")
    if not any(isinstance(h, _ToRosout) for h in package.handlers):
        package.addHandler(_ToRosout())
        package.setLevel(logging.INFO)
        package.propagate = False
