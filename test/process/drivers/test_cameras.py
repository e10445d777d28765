"""Cameras as they are read: Video4Linux by OpenCV with an emulated device, HTTP and RTSP from servers on loopback."""

from __future__ import annotations

import json
import os
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from v4l2_device import FakeV4l2, pictures

from rosbot_patrol.drivers.cameras.capture import Camera, Capture
from rosbot_patrol.drivers.cameras.http_camera import HttpCamera
from rosbot_patrol.drivers.cameras.rtsp_camera import RtspCamera
from rosbot_patrol.errors import DeviceError, ImageError
from rosbot_patrol.simulation.devices.network_camera import NetworkCamera

JPEGS = pictures()
READ = """
import json, sys, time
from pathlib import Path
from rosbot_patrol.drivers.cameras.v4l2_camera import V4l2Camera
from rosbot_patrol.errors import DeviceError
try:
    camera = V4l2Camera(Path(sys.argv[1]), (640, 480), 30.0, sys.argv[2], {"BRIGHTNESS": 90, "AUTO_WB": 1})
    for count in range(int(sys.argv[3])):
        one = camera.read()
        size = len(one.jpeg) if one.jpeg else one.pixels.shape
        print(json.dumps([one.at, time.monotonic(), one.width, one.height, size, one.jpeg[-40:].hex()]), flush=True)
    print(json.dumps(camera.refused))
    camera.close()
except DeviceError as err:
    print(json.dumps(str(err)))
"""


@pytest.fixture
def usb(tmp_path: Path) -> FakeV4l2:
    return FakeV4l2(tmp_path, JPEGS)


def read(usb: FakeV4l2, kind: str = "mjpeg", count: int = 8) -> subprocess.Popen[str]:
    command = [sys.executable, "-c", READ, str(usb.device), kind, str(count)]
    return subprocess.Popen(command, env=usb.full_env(), stdout=subprocess.PIPE, text=True)


def lines(process: subprocess.Popen[str]) -> list[object]:
    out, _ = process.communicate(timeout=30)
    return [json.loads(line) for line in out.splitlines()]


def test_jpegs_of_a_usb_camera_come_as_they_are_with_their_buffers_times(usb: FakeV4l2) -> None:
    *found, refused = lines(read(usb))
    times = [at for _, at in usb.log("frame")]
    ends = {jpeg[-40:].hex(): len(jpeg) for jpeg in JPEGS}
    for at, now, width, height, size, end in found:
        assert min(abs(at - each) for each in times) < 0.002
        assert 0.0 <= now - at < 0.5
        assert (width, height, size) == (640, 480, ends[end])
    assert refused == ["AUTO_WB"]  # this camera has none
    assert (0x900, 90.0) in usb.log("control")  # V4L2_CID_BRIGHTNESS


def test_other_pixels_are_converted(usb: FakeV4l2) -> None:
    found = lines(read(usb, "yuyv", 2))
    assert [row[4] for row in found[:2]] == [[480, 640, 3]] * 2


def test_a_usb_camera_that_is_unplugged(usb: FakeV4l2) -> None:
    process = read(usb, count=1000)
    assert process.stdout is not None
    process.stdout.readline()
    usb.unplug()
    begun = time.monotonic()
    assert lines(process)[-1] == f"{usb.device}: it was unplugged"
    assert time.monotonic() - begun < 10.0


def test_a_usb_camera_that_falls_silent(usb: FakeV4l2) -> None:
    process = read(usb, count=1000)
    assert process.stdout is not None
    process.stdout.readline()
    usb.set("silent", on=True)
    told = lines(process)[-1]
    assert str(told).startswith(f"{usb.device}: silent for 3")


def test_a_usb_camera_that_another_program_has(usb: FakeV4l2) -> None:
    usb.set("busy", on=True)
    (told,) = lines(read(usb))
    assert told == f"{usb.device}: another program uses it: end that first (fuser tells which)"


@pytest.mark.skipif(os.geteuid() == 0, reason="root may open every device")
def test_a_usb_camera_of_somebody_else(usb: FakeV4l2) -> None:
    usb.device.chmod(0)
    (told,) = lines(read(usb))
    assert "may not be opened by this user: sudo adduser" in str(told)


# -- HTTP


class Shown:
    """A network camera that shows a picture every 20 ms."""

    def __init__(self, **options: object) -> None:
        self.camera = NetworkCamera(**options)  # type: ignore[arg-type]
        self._is_on = True
        threading.Thread(target=self._run, daemon=True).start()

    def url(self, page: str = "stream", login: str = "") -> str:
        return f"http://{login}127.0.0.1:{self.camera.port}/{page}"

    def close(self) -> None:
        self._is_on = False
        self.camera.close()

    def _run(self) -> None:
        number = 0
        while self._is_on:
            self.camera.show(JPEGS[number % len(JPEGS)])
            number += 1
            time.sleep(0.02)


@pytest.fixture(params=[True, False], ids=["with lengths", "without lengths"])
def shown(request: pytest.FixtureRequest) -> Iterator[Shown]:
    shown = Shown(names_lengths=request.param)
    yield shown
    shown.close()


def some(camera: HttpCamera, count: int = 5) -> list[Capture]:
    try:
        return [camera.read() for _ in range(count)]
    finally:
        camera.close()


def read_until_lost(camera: Camera) -> None:
    for _ in range(1000):
        camera.read()


def test_a_stream_over_http(shown: Shown) -> None:
    assert {capture.jpeg for capture in some(HttpCamera(shown.url()))} <= set(JPEGS)


def test_single_pictures_over_http(shown: Shown) -> None:
    begun = time.monotonic()
    found = some(HttpCamera(shown.url("capture"), rate=20.0))
    assert time.monotonic() - begun > 0.15  # no more requests than wanted
    assert {capture.jpeg for capture in found} <= set(JPEGS)


def test_a_server_that_is_killed(shown: Shown) -> None:
    camera = HttpCamera(shown.url(), timeout=1.0)
    camera.read()
    shown.close()
    with pytest.raises(DeviceError, match=r"(has ended its stream|silent for 1 s|reset)"):
        read_until_lost(camera)
    camera.close()


def test_a_server_that_falls_silent(shown: Shown) -> None:
    camera = HttpCamera(shown.url(), timeout=0.5)
    camera.read()
    shown.camera.is_silent = True
    with pytest.raises(DeviceError, match=r"silent for 0.5 s"):
        read_until_lost(camera)
    camera.close()


def test_wrong_pages_and_no_server(shown: Shown) -> None:
    with pytest.raises(DeviceError, match=r"has no such page \(404\)"):
        HttpCamera(shown.url("video"))
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
        with pytest.raises(DeviceError, match=r"no answer within 0.3 s"):
            HttpCamera(f"http://127.0.0.1:{port}/stream", timeout=0.3)
    with pytest.raises(DeviceError, match="cannot be reached"):
        HttpCamera(f"http://127.0.0.1:{port}/stream")


def test_user_and_password() -> None:
    shown = Shown(user="me", password="s@cret")
    try:
        some(HttpCamera(shown.url(login="me:s%40cret@")))
        with pytest.raises(DeviceError, match=r"refuses user and password \(401\)") as caught:
            HttpCamera(shown.url(login="me:wrong@"))
        assert "wrong" not in str(caught.value)
    finally:
        shown.close()


def test_a_spoilt_picture_is_dropped_and_the_next_one_comes() -> None:
    server = NetworkCamera()
    camera: HttpCamera | None = None
    try:
        threading.Timer(0.2, server.show, [JPEGS[0][:500]]).start()
        threading.Timer(0.6, server.show, [JPEGS[1]]).start()
        camera = HttpCamera(f"http://127.0.0.1:{server.port}/stream")
        with pytest.raises(ImageError, match="has no end"):
            camera.read()
        assert camera.read().jpeg == JPEGS[1]
    finally:
        if camera is not None:
            camera.close()
        server.close()


# -- RTSP, from GStreamer's server where it is installed

SERVE = """
import sys, gi
gi.require_version("Gst", "1.0"); gi.require_version("GstRtspServer", "1.0")
from gi.repository import GLib, Gst, GstRtspServer
Gst.init(None)
server = GstRtspServer.RTSPServer()
server.set_service("0")
server.set_address("127.0.0.1")
factory = GstRtspServer.RTSPMediaFactory()
factory.set_launch("( videotestsrc is-live=true ! video/x-raw,width=640,height=480,framerate=30/1 "
                   "! x264enc tune=zerolatency speed-preset=ultrafast ! rtph264pay name=pay0 )")
server.get_mount_points().add_factory("/cam", factory)
server.attach(None)
print(server.get_bound_port(), flush=True)
GLib.MainLoop().run()
"""


@pytest.fixture
def rtsp() -> Iterator[tuple[subprocess.Popen[str], int]]:
    process = subprocess.Popen(
        ["/usr/bin/python3", "-c", SERVE], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    )
    assert process.stdout is not None
    port = process.stdout.readline()
    if not port:
        process.wait()
        pytest.skip("no RTSP server: apt install gir1.2-gst-rtsp-server-1.0 gstreamer1.0-plugins-{good,ugly}")
    yield process, int(port)
    process.kill()
    process.wait()


def test_a_stream_over_rtsp_and_a_server_that_is_killed(rtsp: tuple[subprocess.Popen[str], int]) -> None:
    process, port = rtsp
    camera = RtspCamera(f"rtsp://127.0.0.1:{port}/cam")
    found = [camera.read() for _ in range(10)]
    assert {(one.width, one.height, one.picture.encoding) for one in found} == {(640, 480, "bgr8")}
    process.kill()
    begun = time.monotonic()
    with pytest.raises(DeviceError, match=r"ended its stream|silent"):
        read_until_lost(camera)
    assert time.monotonic() - begun < 6.0
    camera.close()


def test_rtsp_pages_that_are_not_there_and_servers_that_are_silent(rtsp: tuple[subprocess.Popen[str], int]) -> None:
    with pytest.raises(DeviceError, match="refuses, or is not there") as caught:
        RtspCamera(f"rtsp://me:secret@127.0.0.1:{rtsp[1]}/other")
    assert "secret" not in str(caught.value)


def test_a_silent_rtsp_server_is_given_up_in_time() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        begun = time.monotonic()
        with pytest.raises(DeviceError, match="no answer within 1 s"):
            RtspCamera(f"rtsp://127.0.0.1:{server.getsockname()[1]}/cam", timeout=1.0)
        assert time.monotonic() - begun < 5.0
