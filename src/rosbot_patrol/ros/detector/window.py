"""A window with the newest picture, if there is a display."""

from __future__ import annotations

import threading

import cv2
import numpy as np
import rospy
from numpy.typing import NDArray

POLL_MS = 30


class Window:
    """Window for pictures; `run` belongs on the main thread, `show` may be called from any."""

    def __init__(self, title: str) -> None:
        self._title = title
        self._lock = threading.Lock()
        self._newest: NDArray[np.uint8] | None = None

    def show(self, pixels: NDArray[np.uint8]) -> None:
        """Show this picture (bgr8) next."""
        with self._lock:
            self._newest = pixels

    def run(self) -> None:
        """Serve the window until shutdown."""
        cv2.namedWindow(self._title, cv2.WINDOW_NORMAL | cv2.WINDOW_KEEPRATIO)
        sized = False
        while not rospy.is_shutdown():
            with self._lock:
                pixels, self._newest = self._newest, None
            if pixels is not None:
                if not sized:
                    cv2.resizeWindow(self._title, pixels.shape[1], pixels.shape[0])
                    sized = True
                cv2.imshow(self._title, pixels)
            cv2.waitKey(POLL_MS)
        cv2.destroyAllWindows()
