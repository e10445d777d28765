"""usb_cam_node: the pictures of a USB or network camera.

Matches usb_cam (ROS 1): parameters, topics `~image_raw` and `~camera_info`, services `~start_capture`,
`~stop_capture` and `~set_camera_info`, and the calibration's file (camera_info_manager).

Differs:
- A camera's JPEGs are passed on to `~image_raw/compressed` undecoded, and decoded only while `~image_raw` has a
  subscriber.
- Stamps are the times of the camera's buffers.
- A camera that is unplugged, silent or not there yet is opened again, with growing pauses, whatever number it gets.
- `video_device` takes USB numbers, and `url` the address of a network camera (RTSP, HTTP).
- The pixel formats yuvmono10 and h264 are not supported.
"""

from __future__ import annotations

import logging
import math
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

import rospkg
import rospy
from sensor_msgs.msg import CameraInfo, CompressedImage, Image
from sensor_msgs.srv import SetCameraInfo, SetCameraInfoRequest, SetCameraInfoResponse
from std_msgs.msg import Header
from std_srvs.srv import Empty, EmptyRequest, EmptyResponse

from rosbot_patrol.drivers.cameras.calibration import CalibrationStore, path_of
from rosbot_patrol.drivers.cameras.capture import Camera, Capture
from rosbot_patrol.drivers.cameras.opening import CameraOpener, CameraParams
from rosbot_patrol.errors import DeviceError, ImageError
from rosbot_patrol.images.compressed import CompressedParams, compress
from rosbot_patrol.params import param
from rosbot_patrol.ros.messages.camera_info import calibration_from_msg, calibration_to_msg
from rosbot_patrol.ros.messages.images import picture_to_msg
from rosbot_patrol.ros.runtime import diagnostics
from rosbot_patrol.ros.runtime.node import Worker, load_params, ros_home, run_node

log = logging.getLogger(__name__)

_PAUSES = (0.5, 1.0, 2.0, 5.0)  # [s] before the next try to open it
_REPORT = 1.0  # [s]
_FORMAT = "rgb8; jpeg compressed bgr8"


@dataclass(frozen=True, kw_only=True)
class UsbCamParams(CameraParams):
    """Parameters of usb_cam_node."""

    camera_frame_id: str = param("head_camera", doc="frame of the pictures, an optical one")
    camera_name: str = param("head_camera", doc="name in the calibration's file")
    camera_info_url: str = param(
        "", doc="calibration, file:/// or package://; empty: ~/.ros/camera_info/CAMERA_NAME.yaml"
    )
    horizontal_fov: float = param(
        0.0, unit="rad", lo=0.0, hi=3.0, doc="field of view of a camera without calibration; 0: it has no intrinsics"
    )
    latency: float = param(0.0, unit="s", lo=0.0, hi=5.0, doc="delay of a network camera, taken off its stamps")


class UsbCamNode:
    """One camera, from its bytes to its topics."""

    def __init__(self, params: UsbCamParams) -> None:
        self._params = params
        self._opener = CameraOpener(params)
        path = path_of(
            params.camera_info_url, params.camera_name, ros_home=ros_home(), package=_folder_of(rospkg.RosPack())
        )
        self._calibrations = CalibrationStore(path, params.camera_name, params.horizontal_fov)
        base = rospy.resolve_name("~image_raw")  # as in image_transport, remappings apply to the base name
        self._image = rospy.Publisher(base, Image, queue_size=1)
        self._compressed = rospy.Publisher(f"{base}/compressed", CompressedImage, queue_size=1)
        self._info = rospy.Publisher(f"{base.rpartition('/')[0]}/camera_info", CameraInfo, queue_size=1)
        self._health = diagnostics.Health(hardware_id="camera")
        self._fresh = threading.Condition()
        self._newest: Capture | None = None
        self._is_wanted = True
        self._why = ""
        self._spoilt = self._count = 0
        rospy.Service("~start_capture", Empty, lambda request: self._order(request, wanted=True))
        rospy.Service("~stop_capture", Empty, lambda request: self._order(request, wanted=False))
        rospy.Service("~set_camera_info", SetCameraInfo, self._set_camera_info)

    def run(self) -> None:
        """Serve until shutdown."""
        Worker(self._receive, name="camera").start()
        reported = time.monotonic()
        while not rospy.is_shutdown():
            with self._fresh:
                self._fresh.wait_for(lambda: self._newest is not None, timeout=0.1)
                capture, self._newest = self._newest, None
            if capture is not None:
                self._count += 1
                self._publish(capture)
            if (elapsed := time.monotonic() - reported) >= _REPORT:
                self._report(self._count / elapsed)
                self._count, reported = 0, time.monotonic()

    # -- receiving, on a thread of its own: a network camera that is not read at once falls behind

    def _receive(self) -> None:
        tries = 0
        while not rospy.is_shutdown():
            if not self._is_wanted:
                time.sleep(0.1)
                continue
            try:
                camera = self._opener.open()
            except DeviceError as err:
                self._lost(str(err))
                self._pause(_PAUSES[min(tries, len(_PAUSES) - 1)])
                tries += 1
                continue
            if self._opener.refused:
                log.warning("%s has no control for %s", self._opener.where, ", ".join(self._opener.refused))
            try:
                tries = self._read(camera)
            except DeviceError as err:
                self._lost(str(err))
                self._pause(_PAUSES[0])
            finally:
                camera.close()

    def _read(self, camera: Camera) -> int:
        is_first = True
        while self._is_wanted and not rospy.is_shutdown():
            try:
                capture = camera.read()
            except ImageError as err:
                self._spoilt += 1
                rospy.logwarn_throttle(10.0, f"{self._opener.where}: a picture is dropped: {err}")
                continue
            if is_first:
                kind = "JPEG" if capture.jpeg else "pixels"
                log.info("%s sends %d x %d, as %s", self._opener.where, capture.width, capture.height, kind)
                self._why = ""
                is_first = False
            with self._fresh:
                self._newest = capture
                self._fresh.notify()
        return 0

    def _pause(self, seconds: float) -> None:
        until = time.monotonic() + seconds
        while time.monotonic() < until and not rospy.is_shutdown():
            time.sleep(0.1)

    def _lost(self, why: str) -> None:
        if why != self._why:
            log.error("%s", why)
        self._why = why
        self._report(0.0)

    # -- sending

    def _publish(self, capture: Capture) -> None:
        age = time.monotonic() - capture.at + self._params.latency
        header = Header(stamp=rospy.Time.now() - rospy.Duration.from_sec(age), frame_id=self._params.camera_frame_id)
        if self._info.get_num_connections():
            self._info.publish(calibration_to_msg(self._calibrations.of(capture.width, capture.height), header))
        try:
            if self._compressed.get_num_connections():
                text, data = (_FORMAT, capture.jpeg) if capture.jpeg else compress(capture.picture, CompressedParams())
                self._compressed.publish(CompressedImage(header=header, format=text, data=data))
            if self._image.get_num_connections():
                self._image.publish(picture_to_msg(capture.picture, header))
        except ImageError as err:
            self._spoilt += 1
            rospy.logwarn_throttle(10.0, f"{self._opener.where}: a picture is dropped: {err}")

    def _report(self, rate: float) -> None:
        values = {"camera": self._opener.where, "pictures a second": f"{rate:.1f}", "spoilt pictures": self._spoilt}
        if not self._is_wanted:
            self._health.set("", diagnostics.OK, "stopped by stop_capture", values)
        elif self._why:
            self._health.set("", diagnostics.ERROR, self._why, values)
        elif rate:
            self._health.set("", diagnostics.OK, f"{rate:.1f} pictures a second", values)
        else:
            self._health.set("", diagnostics.WARN, "no picture in the last second", values)

    # -- services

    def _order(self, _: EmptyRequest, *, wanted: bool) -> EmptyResponse:
        self._is_wanted = wanted
        return EmptyResponse()

    def _set_camera_info(self, request: SetCameraInfoRequest) -> SetCameraInfoResponse:
        message = request.camera_info
        if not (message.width and message.height) or not all(map(math.isfinite, (*message.K, *message.D, *message.P))):
            problem = "the calibration has no width and height, or numbers that are not finite"
            return SetCameraInfoResponse(success=False, status_message=problem)
        problem = self._calibrations.set(calibration_from_msg(message, self._params.camera_name))
        return SetCameraInfoResponse(success=not problem, status_message=problem)


def _folder_of(packages: rospkg.RosPack) -> Callable[[str], str]:
    def folder(name: str) -> str:
        try:
            return str(packages.get_path(name))
        except rospkg.ResourceNotFound as err:
            raise LookupError(str(err)) from err

    return folder


def _body() -> None:
    UsbCamNode(load_params(UsbCamParams)).run()


def main() -> None:
    """Run the node."""
    run_node("usb_cam", _body)
