"""astra_depth: the depth pictures of an Astra by OpenNI2, on `~image_raw` (16UC1, mm) and `~image` (32FC1, m).

Matches the depth topics of astra_camera. Without library, package or camera it says what is missing, and tries again.
"""

from __future__ import annotations

import logging
import time
from dataclasses import dataclass
from pathlib import Path

import rospy
from sensor_msgs.msg import CameraInfo, Image
from std_msgs.msg import Header

from rosbot_patrol.drivers.cameras.calibration import Calibration
from rosbot_patrol.drivers.cameras.openni_depth import DepthCapture, OpenniDepth
from rosbot_patrol.errors import DeviceError
from rosbot_patrol.images.encodings import Picture
from rosbot_patrol.params import param
from rosbot_patrol.ros.messages.camera_info import calibration_to_msg
from rosbot_patrol.ros.messages.images import picture_to_msg
from rosbot_patrol.ros.runtime import diagnostics
from rosbot_patrol.ros.runtime.node import load_params, run_node

log = logging.getLogger(__name__)

_PAUSE = 5.0  # [s] before the next try to open it


@dataclass(frozen=True, kw_only=True)
class AstraDepthParams:
    """Parameters of astra_depth."""

    openni2: str = param("", doc="folder of libOpenNI2.so")
    device: str = param("", doc="name of the camera as OpenNI2 lists it; empty: the first one")
    image_width: int = param(640, unit="px", lo=16, hi=4096, doc="columns; the camera chooses what comes nearest")
    image_height: int = param(480, unit="px", lo=16, hi=4096, doc="rows")
    framerate: int = param(30, unit="Hz", lo=1, hi=120, doc="pictures a second")
    depth_frame_id: str = param("camera_depth_optical_frame", doc="frame of the pictures")


class AstraDepth:
    """One depth camera; it runs while somebody listens."""

    def __init__(self, params: AstraDepthParams) -> None:
        self._params = params
        base = rospy.resolve_name("~image_raw")
        self._raw = rospy.Publisher(base, Image, queue_size=1)
        self._metres = rospy.Publisher("~image", Image, queue_size=1)
        self._info = rospy.Publisher(f"{base.rpartition('/')[0]}/camera_info", CameraInfo, queue_size=1)
        self._health = diagnostics.Health(hardware_id="depth camera")
        self._why = ""

    def run(self) -> None:
        """Serve until shutdown."""
        while not rospy.is_shutdown():
            if not self._is_heard():
                self._health.set("", diagnostics.OK, "nobody listens")
                time.sleep(0.1)
                continue
            try:
                self._serve()
            except DeviceError as err:
                if str(err) != self._why:
                    log.error("%s", err)
                self._why = str(err)
                self._health.set("", diagnostics.ERROR, self._why)
                self._pause()

    def _serve(self) -> None:
        p = self._params
        camera = OpenniDepth(Path(p.openni2), p.device, (p.image_width, p.image_height), p.framerate)
        try:
            count, since = 0, time.monotonic()
            while self._is_heard() and not rospy.is_shutdown():
                self._publish(camera.read(), camera.horizontal_fov)
                self._why = ""
                count += 1
                if (elapsed := time.monotonic() - since) >= 1.0:
                    self._health.set("", diagnostics.OK, f"{count / elapsed:.1f} pictures a second")
                    count, since = 0, time.monotonic()
        finally:
            camera.close()

    def _publish(self, capture: DepthCapture, fov: float) -> None:
        age = rospy.Duration.from_sec(time.monotonic() - capture.at)
        header = Header(stamp=rospy.Time.now() - age, frame_id=self._params.depth_frame_id)
        height, width = capture.millimetres.shape
        if self._info.get_num_connections():
            self._info.publish(calibration_to_msg(Calibration.of_pinhole(width, height, fov, "depth"), header))
        if self._raw.get_num_connections():
            self._raw.publish(picture_to_msg(Picture(capture.millimetres[..., None], "16UC1"), header))
        if self._metres.get_num_connections():
            self._metres.publish(picture_to_msg(Picture(capture.metres[..., None], "32FC1"), header))

    def _is_heard(self) -> bool:
        return any(topic.get_num_connections() for topic in (self._raw, self._metres, self._info))

    def _pause(self) -> None:
        until = time.monotonic() + _PAUSE
        while time.monotonic() < until and not rospy.is_shutdown():
            time.sleep(0.1)


def _body() -> None:
    AstraDepth(load_params(AstraDepthParams)).run()


def main() -> None:
    """Run the node."""
    run_node("astra_depth", _body)
