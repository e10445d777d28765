"""What of the patrol outlives the program: one JSON file, valid for one run of the launch only.

A node that respawns goes on where it stopped; a house launched anew (another run id) starts with an empty queue, as
nobody waits for yesterday's trigger.
"""

from __future__ import annotations

import json
import logging
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rosbot_patrol.files import write_atomic

log = logging.getLogger(__name__)

VERSION = 2


class PatrolStore:
    """Keeps the manager's memory and the latched triggers that were handled.

    Args:
        path: of the file.
        run_id: of the launch.
    """

    def __init__(self, path: Path, run_id: str) -> None:
        self.path = path
        self._run_id = run_id
        self._latched: dict[str, int] = {}
        self._memory: dict[str, Any] = {}
        self._read()

    @property
    def memory(self) -> Mapping[str, Any]:
        """What the manager kept in this run of the launch, empty if nothing."""
        return self._memory

    def is_handled(self, sender: str, room_id: int) -> bool:
        """Whether a latched trigger of this sender was taken before the program ended."""
        return self._latched.get(sender) == room_id

    def note_latched(self, sender: str, room_id: int) -> None:
        """Remember a latched trigger, the last 100 senders; `save` writes it."""
        self._latched.pop(sender, None)
        self._latched[sender] = room_id
        while len(self._latched) > 100:
            self._latched.pop(next(iter(self._latched)))

    def save(self, memory: Mapping[str, Any]) -> None:
        """Write memory and latched triggers. Raises OSError."""
        tree = {"version": VERSION, "run_id": self._run_id, "latched": dict(self._latched), "memory": dict(memory)}
        write_atomic(self.path, json.dumps(tree, indent=1).encode())

    def _read(self) -> None:
        try:
            tree = json.loads(self.path.read_text(encoding="utf-8"))
            if tree["version"] != VERSION:
                raise ValueError(f"version {tree['version']}, expected {VERSION}")
            if tree["run_id"] != self._run_id:
                return
            self._latched = {str(k): int(v) for k, v in tree["latched"].items()}
            self._memory = dict(tree["memory"])
        except FileNotFoundError:
            return
        except (OSError, ValueError, KeyError, TypeError, AttributeError) as err:
            log.warning("%s cannot be used (%s), starting afresh", self.path, err)
            self._latched, self._memory = {}, {}
