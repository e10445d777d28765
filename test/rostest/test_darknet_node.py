"""darknet_ros and republish before a real master: what darknet_ros promises, and what ours promises beyond."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("rospy", reason="needs ROS: source the workspace first")

from ros_processes import Process, Ros, wait_for

from rosbot_patrol.detection.darknet_cfg import parse_cfg
from rosbot_patrol.detection.darknet_weights import ConvWeights, format_weights

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]

# Sees a person in a cell of 8 x 8 pixels that is red, and a fire hydrant in one that is blue.
CFG = (
    "[net]\nwidth=64\nheight=64\nchannels=3\n[convolutional]\nfilters=7\nsize=1\nstride=8\nactivation=linear\n"
    "[region]\nanchors=1,1\nclasses=2\nnum=1\nsoftmax=1\n"
)
PERSON, HYDRANT = ["person", 0, 16, 24, 24, 32, 0.99], ["fire hydrant", 1, 16, 24, 24, 32, 0.99]


@pytest.fixture(scope="module")
def models(tmp_path_factory):
    folder = tmp_path_factory.mktemp("models")
    weights = np.zeros((7, 3, 1, 1), np.float32)
    weights[4, :, 0, 0] = 20.0, -20.0, 20.0
    weights[5, 0], weights[6, 2] = 20.0, 20.0
    biases = np.zeros(7, np.float32)
    biases[4] = -15.0
    (folder / "colours.cfg").write_text(CFG)
    (folder / "colours.weights").write_bytes(
        format_weights(parse_cfg(CFG), [ConvWeights(weights=weights, biases=biases)])
    )
    (folder / "colours.names").write_text("person\nfire hydrant\n")
    (folder / "short.weights").write_bytes((folder / "colours.weights").read_bytes()[:-8])
    return folder


@pytest.fixture(scope="module")
def master():
    ros = Ros()
    yield ros
    ros.stop()


@pytest.fixture
def ros(master):
    # of the test before; setting {} would not clear it
    subprocess.run(["rosparam", "delete", "/darknet_ros"], env=master.env, check=False, capture_output=True)
    path = ROOT / "config/darknet_config_simulation.yaml"
    subprocess.run(["rosparam", "load", str(path), "/darknet_ros"], env=master.env, check=True)
    yield master
    master.stop_nodes()


def start(ros, models, **params):
    params = {
        "config_path": models,
        "weights_path": models,
        "yolo_model/config_file/name": "colours.cfg",
        "yolo_model/weight_file/name": "colours.weights",
    } | params
    return ros.node("darknet_ros", "__name:=darknet_ros", *(f"_{name}:={value}" for name, value in params.items()))


def play(ros, scenario):
    """Everything that a scenario of camera_client.py says, in one dict; lists of lines under their keys."""
    client = Process([sys.executable, str(HERE / "camera_client.py"), scenario], ros.env, stdin=subprocess.DEVNULL)
    wait_for(lambda: client.popen.poll() is not None, 45.0, scenario)
    lines = [json.loads(line) for line in client.lines if line.startswith("{")]
    assert lines[-1:] == [{"done": True}], client.output
    return lines[:-1]


def test_boxes_belong_to_their_picture(ros, models):
    start(ros, models)
    first, drawn, again, nothing = play(ros, "boxes")
    assert first["boxes"] == [PERSON]
    assert (first["stamp"], first["frame"]) == (100, "detection")
    assert (first["image_stamp"], first["image_frame"]) == (100, "camera_optical")
    assert (first["counts"], first["count_stamp"]) == ([1], 100)
    assert drawn["drawn"] == ["bgr8", 100, 64]
    assert drawn["colour"][2] > 200 > drawn["colour"][0]
    assert again == {"again": 0}  # a picture is looked at once
    assert nothing == {"nothing": [0], "messages": 0}  # silent, but for the count


def test_publish_empty(ros, models):
    start(ros, models, publish_empty="true")
    assert play(ros, "empty") == [{"messages": [[]]}]


def test_encodings_and_pictures_that_make_no_sense(ros, models):
    node = start(ros, models)
    *said, health, alive = play(ros, "encodings")
    for line in said[:4]:
        assert line["boxes"] == [[HYDRANT]], line
    assert [line["counts"] for line in said[4:]] == [[0], [0]]  # grey is neither
    node.says("'yuv422' is not known here")
    node.says("needs 12288 bytes, it has 100")
    assert health["health"][0][0] == 2
    assert alive == {"alive": [[HYDRANT]]}


def test_compressed_input(ros, models):
    node = start(ros, models, image_transport="compressed")
    assert play(ros, "compressed") == [{"boxes": [[PERSON]]}]
    node.says("are no picture that can be read")


def test_action_answers_with_the_boxes_of_its_own_picture(ros, models):
    start(ros, models)
    first, second, broken = play(ros, "action")
    assert (first["status"], first["id"], first["stamp"], first["boxes"]) == (3, 7, 100, [HYDRANT])
    assert (second["status"], second["id"], second["stamp"], second["boxes"]) == (3, 8, 101, [PERSON])
    assert broken["status"] == 4
    assert "cannot be looked at" in broken["text"]


def test_action_is_preempted(ros, models):
    start(ros, models)
    ended, alive = play(ros, "preempt")
    assert ended["ended"]
    assert ended["status"][:2] == [3, 3]
    assert ended["status"][2] in (2, 8)  # preempted while active, or recalled before
    assert alive == {"alive": [[PERSON]]}


def test_enable(ros, models):
    start(ros, models)
    assert play(ros, "switch") == [{"off": True, "counts": 0}, {"counts": 1}]


def test_camera_frozen_stopped_and_back(ros, models):
    node = start(ros, models, camera_timeout=1.0, frozen_timeout=1.5)
    frozen, stopped, back = play(ros, "silent")
    assert frozen["frozen"][-1] is False
    assert stopped["health"][0] == [2, "pictures have stopped"]
    assert back == {"ok": True}
    node.says("the camera is frozen")
    node.says("the camera has been silent")


def test_newest_picture_only(ros, models):
    start(ros, models, max_rate=5.0)
    stamps = play(ros, "newest")[0]["stamps"]
    assert stamps[-1] == 129
    assert len(stamps) < 10


def test_says_what_it_waits_for(ros, models):
    node = start(ros, models)
    node.says("waiting for pictures on /camera/rgb/image_raw (sensor_msgs/Image): nobody publishes it")


@pytest.mark.parametrize(
    ("params", "message"),
    [
        ({"yolo_model/weight_file/name": "none.weights"}, "none.weights is not there: put the file of"),
        ({"yolo_model/weight_file/name": "short.weights"}, "is cut short: it has 124 bytes"),
        ({"yolo_model/config_file/name": "none.cfg"}, "none.cfg cannot be read"),
        ({"yolo_model/detection_classes/names": "[a, b, c]"}, "3 class names are given"),
        ({"yolo_model/threshold/value": "2.5"}, "/darknet_ros/yolo_model/threshold/value: is 2.5, expected at most 1"),
    ],
)
def test_bad_start_is_a_sentence(ros, models, params, message):
    node = start(ros, models, **params)
    node.says(message)
    wait_for(lambda: node.popen.poll() is not None, 10.0, "the end")
    assert node.popen.returncode == 1
    assert "Traceback" not in node.output


def test_republish_there_and_back(ros):
    ros.node("republish", "raw", "in:=/in", "compressed", "out:=/middle", "__name:=rgb_compress")
    ros.node("republish", "compressed", "in:=/middle", "raw", "out:=/out", "__name:=rgb_decompress")
    compressed, raw, pixel = play(ros, "republish")
    assert compressed == {
        "kind": "compressed",
        "text": "rgb8; jpeg compressed bgr8",
        "stamp": 100,
        "frame": "camera_optical",
    }
    assert raw == {"kind": "raw", "text": "rgb8", "stamp": 100, "frame": "camera_optical"}
    assert pixel["pixel"][0] > 200 > pixel["pixel"][2]
    assert pixel["start"].startswith("ffd8")


def test_republish_with_parameters_of_the_topic(ros):
    subprocess.run(["rosparam", "set", "/middle/compressed/format", "png"], env=ros.env, check=True)
    ros.node("republish", "raw", "in:=/in", "compressed", "out:=/middle")
    ros.node("republish", "compressed", "in:=/middle", "raw", "out:=/out")
    compressed, _, pixel = play(ros, "republish")
    assert compressed["text"] == "rgb8; png compressed bgr8"
    assert pixel["pixel"] == [255, 0, 0]
    subprocess.run(["rosparam", "delete", "/middle"], env=ros.env, check=True)


@pytest.mark.parametrize("arguments", [["theora", "in:=/in", "raw", "out:=/out"], []])
def test_republish_refuses(ros, arguments):
    node = ros.node("republish", *arguments)
    node.says("usage: republish IN_TRANSPORT in:=BASE")
    wait_for(lambda: node.popen.poll() is not None, 10.0, "the end")
    assert node.popen.returncode == 1
