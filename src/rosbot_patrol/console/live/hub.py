"""The newest values for all pages, and who looks at what: nothing is fetched that nobody looks at. Thread-safe."""

from __future__ import annotations

import asyncio
import dataclasses
import threading
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from rosbot_patrol.console.live.house_state import HouseState, RoomMark, Scene
from rosbot_patrol.console.live.map_picture import MapPicture
from rosbot_patrol.grid import Grid

CAMERA, MAP = "camera", "map"


class Hub:
    """What the pages read.

    Attributes:
        version: counts up with each change of the state.
        map, grid: the newest map as a picture and as cells, None before one was heard.
        on_viewers: called with a subject and the number of its viewers when that changes.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._state, self._scene = HouseState(), Scene()
        self.version = self.scene_version = 0
        self.map: MapPicture | None = None
        self.grid: Grid | None = None
        self._picture, self._picture_number = b"", 0
        self._waiting: set[tuple[asyncio.AbstractEventLoop, asyncio.Event]] = set()
        self._viewers: Counter[str] = Counter()
        self.on_viewers: Callable[[str, int], None] = lambda _subject, _count: None

    @property
    def state(self) -> HouseState:
        """What changes seldom."""
        return self._state

    @property
    def rooms(self) -> tuple[RoomMark, ...]:
        """The rooms now."""
        return self._state.rooms

    @property
    def scene(self) -> Scene:
        """What moves."""
        return self._scene

    def change(self, **fields: Any) -> None:
        """Change fields of the state."""
        with self._lock:
            state = dataclasses.replace(self._state, **fields)
            if state != self._state:
                self._state = state
                self.version += 1

    def move(self, **fields: Any) -> None:
        """Change fields of the scene."""
        with self._lock:
            scene = dataclasses.replace(self._scene, **fields)
            if scene != self._scene:
                self._scene = scene
                self.scene_version += 1

    def count_incident(self) -> None:
        """Note that the incidents on record have changed."""
        self.change(incidents=self._state.incidents + 1)

    # -- camera

    def show(self, jpeg: bytes) -> None:
        """Take a picture of the camera, for all viewers."""
        with self._lock:
            self._picture, self._picture_number = jpeg, self._picture_number + 1
            waiting = list(self._waiting)
        for loop, event in waiting:
            loop.call_soon_threadsafe(event.set)

    async def picture_after(self, number: int) -> tuple[bytes, int]:
        """The newest picture with its number; waits for one newer than `number`."""
        event = asyncio.Event()
        entry = (asyncio.get_running_loop(), event)
        with self._lock:
            self._waiting.add(entry)
        try:
            while True:
                with self._lock:
                    if self._picture_number > number:
                        return self._picture, self._picture_number
                await event.wait()
                event.clear()
        finally:
            with self._lock:
                self._waiting.discard(entry)

    @property
    def picture_number(self) -> int:
        """Number of the newest picture."""
        return self._picture_number

    # -- viewers

    @contextmanager
    def viewer(self, subject: str) -> Iterator[None]:
        """Count a viewer of the camera or the map."""
        self.look(subject, 1)
        try:
            yield
        finally:
            self.look(subject, -1)

    def look(self, subject: str, change: int) -> None:
        """Count viewers that come or go."""
        with self._lock:
            self._viewers[subject] = count = max(self._viewers[subject] + change, 0)
        self.on_viewers(subject, count)
