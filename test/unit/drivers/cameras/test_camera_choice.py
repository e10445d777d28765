"""Which camera is opened: devices, USB numbers, addresses, and a camera that came back under another number."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import simplejpeg

from rosbot_patrol.drivers.cameras.capture import jpeg_capture, pixel_capture
from rosbot_patrol.drivers.cameras.http_camera import split_url
from rosbot_patrol.drivers.cameras.opening import CameraOpener, CameraParams
from rosbot_patrol.drivers.cameras.usb_devices import camera_at, find_usb, list_cameras
from rosbot_patrol.drivers.cameras.v4l2_camera import require_capture
from rosbot_patrol.errors import DeviceError, ImageError, ParamError

JPEG = simplejpeg.encode_jpeg(np.full((48, 64, 3), 90, np.uint8), 80, "RGB", "420")


def plug_in(sysfs: Path, number: int, product: str, *, index: int = 0, serial: str = "") -> None:
    usb = sysfs / "devices" / f"usb{product}"
    (usb / "1.0").mkdir(parents=True, exist_ok=True)
    (usb / "idVendor").write_text("2bc5\n")
    (usb / "idProduct").write_text(f"{product}\n")
    if serial:
        (usb / "serial").write_text(f"{serial}\n")
    entry = sysfs / "class" / "video4linux" / f"video{number}"
    entry.mkdir(parents=True)
    (entry / "index").write_text(f"{index}\n")
    (entry / "name").write_text(f"Camera {product}\n")
    (entry / "device").symlink_to(usb / "1.0")


def test_cameras_are_found_by_their_usb_numbers(tmp_path: Path) -> None:
    plug_in(tmp_path, 10, "0501", serial="A17")
    plug_in(tmp_path, 11, "0501", index=1, serial="A17")  # its metadata
    plug_in(tmp_path, 2, "050f")
    assert [str(each.path) for each in list_cameras(tmp_path)] == ["/dev/video2", "/dev/video10"]
    found = find_usb(["2bc5:0501"], tmp_path)
    assert found is not None
    assert (str(found.path), found.text) == ("/dev/video10", "Camera 0501 (usb:2bc5:0501:A17)")
    assert find_usb(["2bc5:0501:A17"], tmp_path) == found
    assert find_usb(["2bc5:0501:B00"], tmp_path) is None
    assert camera_at(Path("/dev/video2"), tmp_path) == list_cameras(tmp_path)[0]


def test_a_missing_camera_is_told_with_those_that_are_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SYSFS_PATH", str(tmp_path))
    with pytest.raises(DeviceError, match="no camera is plugged in"):
        CameraOpener(CameraParams(video_device=str(tmp_path / "video0"))).open()
    plug_in(tmp_path, 2, "050f")
    with pytest.raises(DeviceError, match=r"usb:2bc5:0501: is not there: .*there are: /dev/video2 is Camera 050f"):
        CameraOpener(CameraParams(video_device="usb:2bc5:0501")).open()


def test_a_device_that_is_no_camera_is_told(tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.write_text("")
    with pytest.raises(DeviceError, match="is no camera"):
        require_capture(path)
    with pytest.raises(DeviceError, match="is not there"):
        require_capture(tmp_path / "none")


def test_an_address_of_another_kind_is_refused_without_its_password() -> None:
    with pytest.raises(ParamError, match="is no address of a camera") as caught:
        CameraOpener(CameraParams(url="ftp://me:secret@host/x"))
    assert "secret" not in str(caught.value)


def test_user_and_password_of_an_address() -> None:
    assert split_url("http://me:s%40crt@host:81/stream?x=1") == ("http://host:81/stream?x=1", "me", "s@crt")
    assert split_url("rtsp://host/live") == ("rtsp://host/live", "", "")


def test_controls_are_named_as_opencv_names_them() -> None:
    assert CameraParams().controls == {"AUTO_EXPOSURE": 3, "AUTO_WB": 1}
    chosen = CameraParams(brightness=10, autoexposure=False, exposure=50, auto_white_balance=False, focus=3).controls
    assert chosen == {
        "BRIGHTNESS": 10,
        "AUTO_EXPOSURE": 1,
        "EXPOSURE": 50,
        "AUTO_WB": 0,
        "WB_TEMPERATURE": 4000,
        "AUTOFOCUS": 0,
        "FOCUS": 3,
    }


def test_a_jpeg_is_kept_as_it_is() -> None:
    capture = jpeg_capture(JPEG + bytes(20), 1.5)  # drivers pad
    assert (capture.width, capture.height, capture.at, capture.jpeg) == (64, 48, 1.5, JPEG + bytes(20))
    assert capture.picture.encoding == "rgb8"
    assert abs(int(capture.picture.pixels[10, 10, 0]) - 90) < 4


@pytest.mark.parametrize("data", [b"", b"\xff\xd9", JPEG[:-200], JPEG[: len(JPEG) // 2], b"text\xff\xd9"])
def test_a_spoilt_jpeg_is_refused(data: bytes) -> None:
    with pytest.raises(ImageError):
        jpeg_capture(data, 0.0)


def test_pixels_are_blue_first() -> None:
    assert pixel_capture(np.zeros((48, 64, 3), np.uint8), 0.0).picture.encoding == "bgr8"
