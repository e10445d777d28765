"""Open the camera that the parameters name, and find it again after it was unplugged."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from rosbot_patrol.drivers.cameras.capture import Camera
from rosbot_patrol.drivers.cameras.http_camera import HttpCamera, split_url
from rosbot_patrol.drivers.cameras.opencv import SILENCE
from rosbot_patrol.drivers.cameras.rtsp_camera import RtspCamera
from rosbot_patrol.drivers.cameras.usb_devices import UsbCamera, camera_at, find_usb, list_cameras
from rosbot_patrol.drivers.cameras.v4l2_camera import FOURCC, V4l2Camera
from rosbot_patrol.errors import DeviceError, ParamError
from rosbot_patrol.params import param

_USB = "usb:"
_AUTO, _MANUAL = 3, 1  # V4L2_EXPOSURE_APERTURE_PRIORITY, V4L2_EXPOSURE_MANUAL


@dataclass(frozen=True, kw_only=True)
class CameraParams:
    """Parameters of a camera; names and defaults as usb_cam's, and an address for a network camera."""

    video_device: str = param("/dev/video0", doc="device, or usb:VENDOR:PRODUCT[:SERIAL], or several with commas")
    url: str = param("", doc="address of a network camera, rtsp:// or http://, instead of video_device")
    image_width: int = param(640, unit="px", lo=16, hi=8192, doc="columns; the camera chooses what comes nearest")
    image_height: int = param(480, unit="px", lo=16, hi=8192, doc="rows")
    framerate: float = param(30.0, unit="Hz", lo=0.1, hi=240.0, doc="pictures a second")
    pixel_format: str = param("mjpeg", choices=tuple(FOURCC), doc="what the camera sends; only mjpeg costs no CPU")
    io_method: str = param("mmap", choices=("mmap", "read", "userptr"), doc="taken as mmap, whatever it says")
    brightness: int = param(-1, lo=-1, doc="-1: as the camera is set")
    contrast: int = param(-1, lo=-1, doc="-1: as the camera is set")
    saturation: int = param(-1, lo=-1, doc="-1: as the camera is set")
    sharpness: int = param(-1, lo=-1, doc="-1: as the camera is set")
    gain: int = param(-1, lo=-1, doc="-1: as the camera is set")
    autofocus: bool = param(False, doc="let the camera focus")
    focus: int = param(-1, lo=-1, doc="without autofocus; -1: as the camera is set")
    autoexposure: bool = param(True, doc="let the camera choose its exposure")
    exposure: int = param(100, lo=1, doc="without autoexposure, in steps of 0.1 ms")
    auto_white_balance: bool = param(True, doc="let the camera choose its white balance")
    white_balance: int = param(4000, unit="K", lo=1, doc="without auto_white_balance")

    @property
    def controls(self) -> dict[str, float]:
        """Values by the names of OpenCV's properties."""
        free = ("brightness", "contrast", "saturation", "sharpness", "gain")
        chosen: dict[str, float] = {name.upper(): getattr(self, name) for name in free if getattr(self, name) >= 0}
        chosen["AUTO_EXPOSURE"] = _AUTO if self.autoexposure else _MANUAL
        if not self.autoexposure:
            chosen["EXPOSURE"] = self.exposure
        chosen["AUTO_WB"] = int(self.auto_white_balance)
        if not self.auto_white_balance:
            chosen["WB_TEMPERATURE"] = self.white_balance
        if self.autofocus:
            chosen["AUTOFOCUS"] = 1
        elif self.focus >= 0:
            chosen |= {"AUTOFOCUS": 0, "FOCUS": self.focus}
        return chosen


class CameraOpener:
    """Opens one camera, again and again.

    Args:
        params: which one, and how.

    Attributes:
        where: name of the camera for messages, without a password.
        refused: names of controls that the camera does not have.

    Raises:
        ParamError: the parameters name no camera.
    """

    def __init__(self, params: CameraParams) -> None:
        self._params = params
        self._last: UsbCamera | None = None
        self.refused: list[str] = []
        self.where = split_url(params.url)[0] if params.url else params.video_device
        scheme = params.url.partition("://")[0]
        if params.url and scheme not in ("rtsp", "rtsps", "http", "https"):
            raise ParamError("url", f"'{self.where}' is no address of a camera: use rtsp:// or http://")

    def open(self) -> Camera:
        """Open it. Raises DeviceError that says what is wrong and what to do."""
        p = self._params
        if p.url.startswith("rtsp"):
            return RtspCamera(p.url)
        if p.url:
            return HttpCamera(p.url, timeout=SILENCE, rate=p.framerate)
        path = self._find()
        camera = V4l2Camera(path, (p.image_width, p.image_height), p.framerate, p.pixel_format, p.controls)
        self._last = camera_at(path) or self._last
        self.refused = camera.refused
        self.where = str(path) if self._last is None else f"{path}, {self._last.text}"
        return camera

    def _find(self) -> Path:
        wanted = [each.strip() for each in self._params.video_device.split(",") if each.strip()]
        for each in wanted:
            if each.startswith(_USB):
                found = find_usb([each.removeprefix(_USB).lower()])
                if found is not None:
                    return found.path
            elif Path(each).exists() and self._is_it(Path(each)):
                return Path(each)
        if self._last is not None:
            back = next((each for each in list_cameras() if each.is_like(self._last)), None)
            if back is not None:
                return back.path
        problem = f"is not there: plug the camera in, or set video_device; {_present()}"
        raise DeviceError(self._params.video_device, problem)

    def _is_it(self, path: Path) -> bool:
        """Whether a device is not known to be another camera than the one before."""
        now = camera_at(path)
        return self._last is None or now is None or now.is_like(self._last)


def _present() -> str:
    cameras = [f"{each.path} is {each.text}" for each in list_cameras()]
    return "there are: " + ", ".join(cameras) if cameras else "no camera is plugged in"
