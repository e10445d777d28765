"""A network camera that sends H.264 or the like over RTSP, decoded by OpenCV's FFmpeg."""

from __future__ import annotations

import time
from collections.abc import Callable

from rosbot_patrol.drivers.cameras.capture import Capture, pixel_capture
from rosbot_patrol.drivers.cameras.http_camera import split_url
from rosbot_patrol.drivers.cameras.opencv import SILENCE, load
from rosbot_patrol.errors import DeviceError


class RtspCamera:
    """One camera behind an address. Pictures are stamped on arrival, because OpenCV passes on no other time.

    Args:
        url: rtsp://, with user and password if it wants them.
        timeout: longest silence [s].
        clock: steady time [s].

    Raises:
        DeviceError: it cannot be reached, refuses or stays silent.
    """

    def __init__(self, url: str, *, timeout: float = SILENCE, clock: Callable[[], float] = time.monotonic) -> None:
        cv2 = load()
        self._url = split_url(url)[0]
        self._timeout, self._clock = timeout, clock
        limit = round(timeout * 1e3)
        begun = clock()
        limits = [cv2.CAP_PROP_OPEN_TIMEOUT_MSEC, limit, cv2.CAP_PROP_READ_TIMEOUT_MSEC, limit]
        self._video = cv2.VideoCapture(url, cv2.CAP_FFMPEG, limits)
        if not self._video.isOpened():
            waited = clock() - begun
            why = f"no answer within {timeout:g} s" if waited > 0.9 * timeout else "refuses, or is not there"
            raise DeviceError(self._url, f"{why}: look at its address, user, password and network")

    def read(self) -> Capture:
        """The next picture; see `Camera`."""
        begun = self._clock()
        done, pixels = self._video.read()
        if not done:
            waited = self._clock() - begun
            silent = waited > 0.9 * self._timeout
            raise DeviceError(self._url, f"silent for {waited:.1f} s" if silent else "the camera has ended its stream")
        return pixel_capture(pixels, self._clock())

    def close(self) -> None:
        """End the connection."""
        self._video.release()
