"""Emergency stop: held by everybody who pressed it until they release it, also over restarts.

It has two holders: the service (a person or a program that means this robot) and the topic (a button on the robot, or
whatever else feeds the base's lock). A button that says "not pressed" ten times a second releases only its own hold.
The service releases both, because its caller means that; a button that is still pressed says so again.

The state on the disk counts as held unless it says plainly that nobody pressed: the file is absent, or it is
`{"held_by": []}` and nothing else. No small damage turns a held state into that, because a held one has at least seven
bytes more.
"""

from __future__ import annotations

import json
import logging
from pathlib import Path

from rosbot_patrol.errors import StateError
from rosbot_patrol.files import read_json, write_atomic

log = logging.getLogger(__name__)

SERVICE, TOPIC = "service", "topic"
_FILE = "file"
_WORDS = {
    SERVICE: "the emergency stop was pressed (service /patrol/emergency_stop)",
    TOPIC: "the emergency stop was pressed (topic /e_stop)",
    _FILE: "the emergency stop holds, as what was kept of it cannot be read",
}


class EmergencyStop:
    """Whether the robot must stand still; any thread may ask while another presses or releases.

    Args:
        path: of its file; an unreadable file holds the robot.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._held = self._read()  # replaced as a whole: a reader sees the state before or after a press
        self._unsaved = False
        if self._held:
            log.warning("%s, before the program ended", self.why)

    @property
    def is_held(self) -> bool:
        """Whether anybody holds it."""
        return bool(self._held)

    @property
    def why(self) -> str:
        """Holders, "" if there are none."""
        held = self._held
        return _WORDS[min(held, key=list(_WORDS).index)] if held else ""

    def press(self, pressed: bool, source: str) -> bool:
        """Press (or release); returns whether `is_held` has changed. It acts at once; `save` stores it."""
        before = self._held
        if pressed:
            self._held = before | {source}
        else:
            self._held = frozenset() if source == SERVICE else before - {source}
        self._unsaved |= self._held != before
        return bool(self._held) != bool(before)

    def save(self) -> None:
        """Write it to the disk if it has changed. Raises OSError."""
        if self._unsaved:
            write_atomic(self._path, json.dumps({"held_by": sorted(self._held)}).encode())
            self._unsaved = False

    def _read(self) -> frozenset[str]:
        try:
            tree = read_json(self._path)
        except StateError as err:
            if isinstance(err.__cause__, NotADirectoryError):  # no such file, as there is no folder
                return frozenset()
            return self._doubt(err.problem)
        if tree in (None, {"held_by": []}):
            return frozenset()
        held = tree.get("held_by")
        known = frozenset(name for name in held if name in (SERVICE, TOPIC)) if isinstance(held, list) else frozenset()
        return known if tree == {"held_by": sorted(known)} else known | self._doubt("it is no list of who pressed")

    def _doubt(self, problem: str) -> frozenset[str]:
        log.error("%s cannot be read (%s): the robot stands still until the stop is released", self._path, problem)
        return frozenset({_FILE})
