"""OpenCV's video input, with limits on how long it waits. It reads its settings once, when it is loaded."""

from __future__ import annotations

import importlib
import os
from typing import Any

SILENCE = 3.0  # [s] that a camera may be silent


def load() -> Any:
    """The module cv2."""
    os.environ.setdefault("OPENCV_VIDEOIO_V4L_SELECT_TIMEOUT", str(round(SILENCE)))
    os.environ.setdefault("OPENCV_FFMPEG_CAPTURE_OPTIONS", "rtsp_transport;tcp")
    os.environ.setdefault("OPENCV_LOG_LEVEL", "ERROR")
    return importlib.import_module("cv2")
