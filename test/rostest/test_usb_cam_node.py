"""usb_cam_node: an emulated USB camera and a network camera, from their bytes to topics, services and /diagnostics."""

import json
import subprocess
import sys
import threading
import time
import zlib
from pathlib import Path

import pytest

pytest.importorskip("rospy", reason="needs ROS: source the workspace first")

from ros_processes import Process, wait_for
from v4l2_device import FakeV4l2, pictures

from rosbot_patrol.simulation.devices.network_camera import NetworkCamera

JPEGS = pictures()
LISTEN = """
import json, sys, threading, time, zlib
import rospy
from sensor_msgs.msg import CameraInfo, CompressedImage, Image
from diagnostic_msgs.msg import DiagnosticArray
rospy.init_node("listener", anonymous=True)
lock = threading.Lock()
def tell(**what):
    with lock:
        print(json.dumps(what), flush=True)
def compressed(m):
    tell(jpeg=zlib.crc32(m.data), format=m.format, stamp=m.header.stamp.to_sec(), frame=m.header.frame_id)
def image(m):
    tell(image=[m.width, m.height, m.encoding, m.step], stamp=m.header.stamp.to_sec())
def info(m):
    tell(info=[m.width, m.height, m.K[0], m.distortion_model], stamp=m.header.stamp.to_sec())
def health(m):
    for s in m.status:
        if "cam" in s.name:
            tell(health=s.message)
rospy.Subscriber("cam/image_raw/compressed", CompressedImage, compressed, queue_size=1)
rospy.Subscriber("cam/camera_info", CameraInfo, info, queue_size=1)
rospy.Subscriber("/diagnostics", DiagnosticArray, health)
tell(ready=True)
def obey():
    for line in sys.stdin:
        rospy.Subscriber("cam/image_raw", Image, image, queue_size=1)
threading.Thread(target=obey, daemon=True).start()
rospy.spin()
"""
CALIBRATE = """
import sys
import rospy
from sensor_msgs.msg import CameraInfo
from sensor_msgs.srv import SetCameraInfo
rospy.init_node("calibrator")
rospy.wait_for_service("cam/set_camera_info", 20.0)
info = CameraInfo(width=640, height=480, distortion_model="plumb_bob", D=[0.0] * 5)
info.K = [float(sys.argv[1]), 0.0, 320.0, 0.0, 500.0, 240.0, 0.0, 0.0, 1.0]
info.P = [500.0, 0.0, 320.0, 0.0, 0.0, 500.0, 240.0, 0.0, 0.0, 0.0, 1.0, 0.0]
answer = rospy.ServiceProxy("cam/set_camera_info", SetCameraInfo)(info)
print(answer.success, answer.status_message)
"""


class Listener:
    """What comes on the topics of a camera."""

    def __init__(self, ros):
        self.process = Process([sys.executable, "-c", LISTEN], ros.env, stdin=subprocess.PIPE)
        ros.processes.append(self.process)
        self.process.says("ready")

    def heard(self, key):
        told = [json.loads(line) for line in list(self.process.lines) if line.startswith("{")]
        return [each for each in told if key in each]

    def wait_for_more(self, key, count=3):
        before = len(self.heard(key))
        wait_for(lambda: len(self.heard(key)) >= before + count, what=f"{count} of {key}")
        return self.heard(key)[before:]

    def want_images(self):
        self.process.popen.stdin.write("image\n")
        self.process.popen.stdin.flush()


@pytest.fixture
def listener(ros):
    return Listener(ros)


@pytest.fixture
def start(ros, tmp_path):
    def node(*arguments, env=None):
        ros.forget("/cam")
        env = {**ros.env, "ROS_HOME": str(tmp_path / "home"), **(env or {})}
        for folder in ros.env["CMAKE_PREFIX_PATH"].split(":"):
            path = Path(folder, "lib", "usb_cam", "usb_cam_node")
            if path.exists():
                process = Process([sys.executable, str(path), "__name:=cam", *arguments], env)
                ros.processes.append(process)
                return process
        raise AssertionError("usb_cam_node is not built")

    return node


@pytest.fixture
def usb(tmp_path):
    return FakeV4l2(tmp_path, JPEGS)


def test_a_usb_cameras_jpegs_are_passed_on_and_decoded_only_for_who_listens(ros, listener, start, usb):
    node = start(f"_video_device:={usb.device}", "_camera_frame_id:=eye", env=usb.env)
    node.says(f"{usb.device}, Test Camera (usb:2bc5:0501:A17) sends 640 x 480, as JPEG")
    node.says("has no control for AUTO_WB")
    passed = listener.wait_for_more("jpeg", 10)
    assert {each["jpeg"] for each in passed} <= {zlib.crc32(jpeg) for jpeg in JPEGS}
    assert {(each["format"], each["frame"]) for each in passed} == {("rgb8; jpeg compressed bgr8", "eye")}
    offset = time.time() - time.monotonic()
    times = [at + offset for _, at in usb.log("frame")]
    assert all(min(abs(each["stamp"] - at) for at in times) < 0.005 for each in passed)
    assert not listener.heard("image")
    listener.want_images()
    assert listener.wait_for_more("image")[0]["image"] == [640, 480, "rgb8", 1920]
    assert listener.heard("info")[0]["info"] == [640, 480, 0.0, ""]
    listener.process.says("pictures a second")


def test_a_usb_camera_comes_back_under_another_number(ros, listener, start, usb):
    node = start(f"_video_device:={usb.device}", env=usb.env)
    listener.wait_for_more("jpeg")
    first = usb.device
    usb.unplug()
    node.says(f"{first}: it was unplugged")
    listener.process.says("is not there: plug the camera in, or set video_device; no camera is plugged in")
    usb.plug_in(3)
    listener.wait_for_more("jpeg")
    node.says(f"{usb.device}, Test Camera")
    assert node.popen.poll() is None


def test_a_camera_that_another_program_has_is_taken_once_it_is_free(ros, listener, start, usb):
    usb.set("busy", on=True)
    node = start("_video_device:=usb:2bc5:0501", env=usb.env)
    node.says(f"{usb.device}: another program uses it: end that first")
    usb.set("busy", on=False)
    listener.wait_for_more("jpeg")


def test_capture_stops_and_starts(ros, listener, start, usb):
    start(f"_video_device:={usb.device}", env=usb.env)
    listener.wait_for_more("jpeg")
    subprocess.run(["rosservice", "call", "/cam/stop_capture"], env=ros.env, check=True, timeout=30)
    listener.process.says("stopped by stop_capture")
    before = len(usb.log("frame"))
    time.sleep(0.5)
    assert len(usb.log("frame")) == before
    subprocess.run(["rosservice", "call", "/cam/start_capture"], env=ros.env, check=True, timeout=30)
    listener.wait_for_more("jpeg")


def test_a_calibration_is_stored_used_and_found_again(ros, listener, start, usb, tmp_path):
    first = start(f"_video_device:={usb.device}", "_camera_name:=astra", env=usb.env)
    stored = tmp_path / "home" / "camera_info" / "astra.yaml"
    first.says(f"Camera calibration file {stored} not found.")
    set_it = subprocess.run(
        [sys.executable, "-c", CALIBRATE, "500"], env=ros.env, capture_output=True, text=True, timeout=40, check=True
    )
    assert set_it.stdout.split() == ["True"]
    wait_for(lambda: listener.heard("info")[-1]["info"] == [640, 480, 500.0, "plumb_bob"], what="the calibration")
    refused = subprocess.run(
        [sys.executable, "-c", CALIBRATE, "nan"], env=ros.env, capture_output=True, text=True, timeout=40, check=True
    )
    assert refused.stdout.startswith("False the calibration has no width and height, or numbers that are not finite")
    first.stop()
    start(f"_video_device:={usb.device}", "_camera_name:=astra", env=usb.env)
    assert listener.wait_for_more("info")[-1]["info"][2] == 500.0


def test_a_network_camera_that_goes_and_comes(ros, listener, start):
    camera, is_on = NetworkCamera(user="me", password="secret"), threading.Event()
    port = camera.port

    def run():
        while not is_on.wait(0.03):
            camera.show(JPEGS[0])

    threading.Thread(target=run, daemon=True).start()
    try:
        node = start(f"_url:=http://me:secret@127.0.0.1:{port}/stream", "_latency:=0.2", "_horizontal_fov:=1.0")
        node.says(f"http://127.0.0.1:{port}/stream sends 640 x 480, as JPEG")
        late = listener.wait_for_more("jpeg")[-1]
        assert 0.19 < time.time() - late["stamp"] < 2.0
        assert listener.heard("info")[-1]["info"][2] == pytest.approx(585.8, abs=0.2)
        camera.close()
        node.says(f"http://127.0.0.1:{port}/stream: cannot be reached")
        camera = NetworkCamera(port, user="me", password="secret")
        listener.wait_for_more("jpeg")
    finally:
        is_on.set()
        camera.close()
    assert "secret" not in node.output


def test_an_address_and_a_calibration_of_the_wrong_kind_end_it_with_a_sentence(start):
    node = start("_url:=ftp://127.0.0.1/x")
    node.says("url: 'ftp://127.0.0.1/x' is no address of a camera: use rtsp:// or http://")
    assert node.popen.wait(10) == 1
    node = start("_camera_info_url:=cam.yaml")
    node.says("Invalid camera calibration URL: cam.yaml")
    assert node.popen.wait(10) == 1
