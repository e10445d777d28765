"""A camera of Video4Linux, read by OpenCV: its JPEGs as they are, or pixels.

Pictures have the time stamps of the driver's buffers, on the steady clock (uvcvideo).
"""

from __future__ import annotations

import errno
import fcntl
import os
import struct
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from rosbot_patrol.drivers.cameras.capture import Capture, jpeg_capture, pixel_capture
from rosbot_patrol.drivers.cameras.opencv import SILENCE, load
from rosbot_patrol.errors import DeviceError

FOURCC = {"mjpeg": "MJPG", "yuyv": "YUYV", "uyvy": "UYVY", "rgb24": "RGB3", "grey": "GREY", "yu12": "YU12"}

# <linux/videodev2.h>
_QUERYCAP, _REQBUFS = 0x80685600, 0xC0145608
_CAPTURE, _HAS_DEVICE_CAPS = 0x00000001, 0x80000000
_STAMP_ERROR = 1.0  # [s] between a buffer's time and now


class V4l2Camera:
    """One open video device.

    Args:
        path: of the device.
        size: columns and rows that are wanted; the camera chooses what comes nearest.
        rate: pictures a second.
        pixel_format: a name in `FOURCC`.
        controls: values of OpenCV's properties by name, such as BRIGHTNESS.
        clock: steady time [s].

    Attributes:
        refused: names of controls that the camera does not have.
        fourcc: pixel format that the camera sends.

    Raises:
        DeviceError: it cannot be opened; the sentence says why.
    """

    def __init__(
        self,
        path: Path,
        size: tuple[int, int] = (640, 480),
        rate: float = 30.0,
        pixel_format: str = "mjpeg",
        controls: Mapping[str, float] | None = None,
        *,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        require_capture(path)
        self._path, self._clock = path, clock
        self._cv2 = cv2 = load()
        wanted = FOURCC[pixel_format]
        is_jpeg = wanted == "MJPG"
        settings = [
            *(cv2.CAP_PROP_FOURCC, cv2.VideoWriter_fourcc(*wanted)),
            *(cv2.CAP_PROP_FRAME_WIDTH, size[0]),
            *(cv2.CAP_PROP_FRAME_HEIGHT, size[1]),
            *(cv2.CAP_PROP_FPS, round(rate)),
            *(cv2.CAP_PROP_CONVERT_RGB, 0 if is_jpeg else 1),
        ]
        self._video = cv2.VideoCapture(str(path), cv2.CAP_V4L2, settings)
        if not self._video.isOpened():
            self._video = cv2.VideoCapture(str(path), cv2.CAP_V4L2)
        if not self._video.isOpened():
            raise DeviceError(str(path), why_no_pictures(path))
        code = int(self._video.get(cv2.CAP_PROP_FOURCC))
        self.fourcc = struct.pack("<I", code & 0xFFFFFFFF).decode("ascii", "replace")
        self._is_jpeg = self.fourcc in ("MJPG", "JPEG")
        if not self._is_jpeg:
            self._video.set(cv2.CAP_PROP_CONVERT_RGB, 1)
        values = dict(controls or {})
        self.refused = [name for name, value in values.items() if not self._set(name, value)]

    def read(self) -> Capture:
        """The next picture; see `Camera`."""
        begun = self._clock()
        try:
            done, data = self._video.read()
        except self._cv2.error as err:
            raise DeviceError(str(self._path), f"OpenCV cannot read it: {err}") from err
        if not done or data is None:
            raise DeviceError(str(self._path), self._why_lost(self._clock() - begun))
        if self._is_jpeg:
            return jpeg_capture(np.asarray(data).tobytes(), self._stamp())
        return pixel_capture(data, self._stamp())

    def close(self) -> None:
        """Close the device."""
        self._video.release()

    def _set(self, name: str, value: float) -> bool:
        return bool(self._video.set(getattr(self._cv2, f"CAP_PROP_{name}"), value))

    def _stamp(self) -> float:
        now = self._clock()
        at = float(self._video.get(self._cv2.CAP_PROP_POS_MSEC)) * 1e-3
        return at if abs(now - at) < _STAMP_ERROR else now

    def _why_lost(self, waited: float) -> str:
        if not self._path.exists():
            return "it was unplugged"
        if waited > 0.9 * SILENCE:
            return f"silent for {waited:.1f} s: unplug it and plug it in again"
        return why_no_pictures(self._path)


def require_capture(path: Path) -> None:
    """Raise DeviceError, with what to do, unless a path is a camera that this user may open."""
    try:
        device = os.open(path, os.O_RDWR | os.O_NONBLOCK)
    except OSError as err:
        raise DeviceError(str(path), _why_closed(err)) from err
    try:
        answer: Any = fcntl.ioctl(device, _QUERYCAP, bytes(104))
    except OSError as err:
        if err.errno == errno.ENODEV:
            raise DeviceError(str(path), "it was unplugged") from err
        raise DeviceError(str(path), "is no camera: ls /dev/v4l/by-id lists those that are plugged in") from err
    finally:
        os.close(device)
    capabilities, of_device = struct.unpack_from("<II", answer, 84)
    if not (of_device if capabilities & _HAS_DEVICE_CAPS else capabilities) & _CAPTURE:
        raise DeviceError(str(path), "takes no pictures: a camera has several devices, try the one before it")


def why_no_pictures(path: Path) -> str:
    """Why a camera that opens gives no pictures, and what to do."""
    try:
        device = os.open(path, os.O_RDWR | os.O_NONBLOCK)
        try:
            fcntl.ioctl(device, _REQBUFS, struct.pack("<5I", 1, 1, 1, 0, 0))
            fcntl.ioctl(device, _REQBUFS, struct.pack("<5I", 0, 1, 1, 0, 0))
        finally:
            os.close(device)
    except OSError as err:
        return _why_closed(err)
    return "it opens and gives no pictures: try another pixel_format or size (v4l2-ctl --list-formats-ext)"


def _why_closed(err: OSError) -> str:
    if err.errno in (errno.EACCES, errno.EPERM):
        return f"may not be opened by this user: sudo adduser {os.environ.get('USER', 'USER')} video, then log in again"
    if err.errno in (errno.ENOENT, errno.ENXIO, errno.ENODEV):
        return "is not there: plug the camera in, or set video_device (ls /dev/v4l/by-id)"
    if err.errno == errno.EBUSY:
        return "another program uses it: end that first (fuser tells which)"
    return str(err)
