"""Depth of an Astra, a PrimeSense or an Xtion by OpenNI2, where the user has its library and the package openni.

Debian's libopenni2-0 knows PrimeSense and Xtion. An Astra needs Orbbec's libOpenNI2.so with OpenNI2/Drivers beside it,
which Orbbec's ros_astra_camera contains.
"""

from __future__ import annotations

import importlib
import logging
import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.errors import DeviceError

log = logging.getLogger(__name__)

_MILLIMETRES = 100  # ONI_PIXEL_FORMAT_DEPTH_1_MM
_MOST = 10000  # [mm] more is no measurement
_USUAL_FOV = 1.022  # [rad] of an Astra, where the driver tells none
SILENCE = 3.0  # [s]


@dataclass(frozen=True)
class DepthCapture:
    """One picture of depth.

    Attributes:
        millimetres: shape (height, width), 0 where nothing was measured.
        at: steady time of its arrival [s].
    """

    millimetres: NDArray[np.uint16]
    at: float

    @property
    def metres(self) -> NDArray[np.float32]:
        """The same in metres, NaN where nothing was measured."""
        found = self.millimetres.astype(np.float32) / 1000.0
        found[self.millimetres == 0] = np.nan
        return found


class OpenniDepth:
    """An open depth camera.

    Args:
        folder: of libOpenNI2.so.
        device: name as OpenNI lists it; "" is the first one.
        size: columns and rows that are wanted.
        rate: pictures a second.
        clock: steady time [s].

    Attributes:
        horizontal_fov: [rad].

    Raises:
        DeviceError: library, package or camera is missing; the sentence says which.
    """

    def __init__(
        self,
        folder: Path,
        device: str = "",
        size: tuple[int, int] = (640, 480),
        rate: int = 30,
        *,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._openni: Any = _library(folder)
        self._errors = (self._openni.OpenNIError, OSError, ValueError)
        self._clock = clock
        self._where = device or "the depth camera"
        try:
            self._device = self._openni.Device(device.encode()) if device else self._openni.Device.open_any()
            self._stream = self._device.create_depth_stream()
            self._choose(size, rate)
            self._stream.start()
        except self._errors as err:
            problem = f"cannot be opened by OpenNI2: {_in_a_line(err)}: is it plugged in?"
            raise DeviceError(self._where, problem) from err
        self.horizontal_fov = self._fov()

    def read(self) -> DepthCapture:
        """The next picture. Raises DeviceError if the camera is lost or silent."""
        try:
            ready = self._openni.wait_for_any_stream([self._stream], SILENCE)
            if ready is None:
                raise DeviceError(self._where, f"silent for {SILENCE:g} s: unplug it and plug it in again")
            frame = self._stream.read_frame()
            raw = np.frombuffer(frame.get_buffer_as_uint16(), np.uint16).reshape(frame.height, frame.width)
        except self._errors as err:
            raise DeviceError(self._where, f"is lost: {_in_a_line(err)}") from err
        return DepthCapture(np.where(raw <= _MOST, raw, 0).astype(np.uint16), self._clock())

    def close(self) -> None:
        """Close the camera and the library."""
        self._stream.stop()
        self._device.close()
        self._openni.unload()

    def _choose(self, size: tuple[int, int], rate: int) -> None:
        """Choose the mode nearest to what is wanted, of those in millimetres."""
        modes = [m for m in self._stream.get_sensor_info().videoModes if int(m.pixelFormat) == _MILLIMETRES]
        try:
            if modes:
                self._stream.set_video_mode(min(modes, key=lambda m: _distance(m, size, rate)))
        except self._openni.OpenNIError as err:
            log.warning("%s keeps its own size and rate: %s", self._where, _in_a_line(err))

    def _fov(self) -> float:
        try:
            fov = float(self._stream.get_horizontal_fov())
        except self._openni.OpenNIError as err:
            log.warning("%s tells no field of view, %.3f rad is taken: %s", self._where, _USUAL_FOV, _in_a_line(err))
            return _USUAL_FOV
        return fov if math.isfinite(fov) and 0.0 < fov < math.pi else _USUAL_FOV


def _library(folder: Path) -> Any:
    try:
        openni = importlib.import_module("openni.openni2")
    except ImportError as err:
        raise DeviceError("OpenNI2", "the package openni is missing: .ws/venv/bin/pip install openni==2.3.0") from err
    if not (folder / "libOpenNI2.so").exists():
        problem = "holds no libOpenNI2.so: give the folder of Orbbec's library (openni2:=FOLDER), or leave depth out"
        raise DeviceError(str(folder), problem)
    try:
        openni.initialize(str(folder))
    except (openni.OpenNIError, openni.InitializationError, OSError) as err:
        raise DeviceError(str(folder), f"OpenNI2 does not start: {_in_a_line(err)}") from err
    return openni


def _distance(mode: Any, size: tuple[int, int], rate: int) -> tuple[int, int]:
    """How far a mode is from what is wanted: in size first, then in rate."""
    return abs(mode.resolutionX - size[0]) + abs(mode.resolutionY - size[1]), abs(mode.fps - rate)


def _in_a_line(err: Exception) -> str:
    return " ".join(str(err).split())[:200] or type(err).__name__
