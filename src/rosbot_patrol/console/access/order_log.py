"""Every order that people gave by the console: who, from where, what, and what came of it; one line of JSON each."""

from __future__ import annotations

import json
import logging
import threading
from collections import deque
from dataclasses import asdict, dataclass
from pathlib import Path

from rosbot_patrol.files import append_line

log = logging.getLogger(__name__)

_LARGEST = 1 << 20  # [bytes] of the file, before it is moved aside; the one before that goes
_SHOWN = 200


@dataclass(frozen=True, kw_only=True)
class Order:
    """One order.

    Attributes:
        wall: when, seconds since 1970.
        who, peer: name and address of the person.
        what: the order.
        accepted: whether it was carried out; answer: in one sentence.
    """

    wall: float
    who: str
    peer: str
    what: str
    accepted: bool
    answer: str


class OrderLog:
    """The orders of one file; thread-safe. A disk that takes nothing is logged, and refuses no order."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._lock = threading.Lock()
        self._newest: deque[Order] = deque(_read(path), maxlen=_SHOWN)

    @property
    def newest(self) -> tuple[Order, ...]:
        """The last orders, the newest first."""
        return tuple(reversed(self._newest))

    def add(self, order: Order) -> None:
        """Write an order down."""
        with self._lock:
            self._newest.append(order)
            try:
                self._path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
                if self._path.exists() and self._path.stat().st_size > _LARGEST:
                    self._path.replace(self._path.with_suffix(".old.jsonl"))
                append_line(self._path, json.dumps(asdict(order), ensure_ascii=False).encode() + b"\n")
            except OSError as err:
                log.error("an order of %s cannot be written down: %s", order.who, err)


def _read(path: Path) -> list[Order]:
    if not path.exists():
        return []
    found = []
    for line in path.read_text("utf-8", "replace").splitlines()[-_SHOWN:]:
        try:
            found.append(Order(**json.loads(line)))
        except (ValueError, TypeError):  # cut by a crash
            log.warning("%s has a line that makes no sense: it is left out", path)
    return found
