"""Window with the simulated house from above, following the robot; needs a display."""

from __future__ import annotations

import logging
import os
import time

import cv2

from rosbot_patrol.errors import WorldError
from rosbot_patrol.simulation.engine import Engine

log = logging.getLogger(__name__)

TITLE = "rosbot_patrol"
_PERIOD = 0.1  # of wall time [s]


class Window:
    """Draw with the camera's renderer, ten times a second of wall time; closing the window only ends the drawing."""

    def __init__(self, engine: Engine) -> None:
        self._engine = engine
        self._due = 0.0
        self._open = bool(os.environ.get("DISPLAY"))
        if not self._open:
            log.warning("gui: there is no display, the simulation runs without a window")

    def show(self) -> None:
        """Draw if it is due."""
        now = time.monotonic()
        if not self._open or now < self._due:
            return
        self._due = now + _PERIOD
        try:
            picture = self._engine.view_from_above()
            cv2.imshow(TITLE, cv2.cvtColor(picture, cv2.COLOR_RGB2BGR))
            cv2.waitKey(1)
            self._open = cv2.getWindowProperty(TITLE, cv2.WND_PROP_VISIBLE) >= 1
        except (cv2.error, WorldError) as err:
            log.warning("gui: the window cannot be drawn, the simulation goes on without: %s", err)
            self._open = False
            return
        if not self._open:
            log.info("the window was closed, the simulation goes on")
