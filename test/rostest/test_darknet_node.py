"""darknet_ros and republish before a real master: what darknet_ros promises, and what ours promises beyond."""

import functools
import http.server
import json
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("rospy", reason="needs ROS: source the workspace first")

from ros_processes import Process, Ros, wait_for

from rosbot_patrol.detection.catalogue import REAL_CAMERA
from rosbot_patrol.detection.darknet.cfg import parse_cfg
from rosbot_patrol.detection.darknet.weights import ConvWeights, format_weights
from rosbot_patrol.ros.detector.download_weights import run

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
    (folder / "odd.cfg").write_text(CFG.replace("[convolutional]", "[lstm]"))
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


def play(ros, scenario, *arguments):
    """Everything that a scenario of camera_client.py says, in one dict; lists of lines under their keys."""
    client = Process(
        [sys.executable, str(HERE / "camera_client.py"), scenario, *arguments], ros.env, stdin=subprocess.DEVNULL
    )
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


def test_it_stands_in_for_another_detector_that_has_gone(ros, models):
    node = start(ros, models, standby_after=0.6)
    there, alone, health, back, again = play(ros, "standby")
    assert there == {"with_other": True, "looked_at": 0}
    assert alone["looked_at"] > 5
    assert health["health"][0] == 1
    assert "has gone: looks at pictures in its place" in health["health"][1]
    assert back["looked_at"] <= 2  # those that were on their way
    assert again["looked_at"] == 0
    wait_for(lambda: "standing by" in node.output, 5.0, "that it says so")


def test_publish_empty(ros, models):
    start(ros, models, publish_empty="true")
    assert play(ros, "empty") == [{"messages": [[]]}]


def test_encodings(ros, models):
    node = start(ros, models)
    said = play(ros, "encodings")
    node.says("pictures a second; seen: fire hydrant 99%")  # enable_console_output
    assert len(said) == 23
    for line in said:
        grey = line["encoding"] in ("mono8", "mono16", "8UC1")
        assert line["boxes"] == ([] if grey else [[HYDRANT]]), line
        assert line["counts"] == [0 if grey else 1], line


@pytest.mark.long
def test_pictures_that_make_no_sense(ros, models):
    node = start(ros, models)
    *said, alive = play(ros, "nonsense")
    sentences = [
        "the encoding 'nv21' is not known here, expected one of mono8",
        "a picture of 64x64 rgb8 with rows of 192 bytes needs 12288 bytes, it has 100",
        "a picture of 64x64 rgb8 with rows of 7 bytes needs 12288 bytes, it has 12288",
        "a picture of 0x64 pixels is empty",
        "a picture of encoding 32FC1 has no colours",
        None,  # 1 x 1 is a picture; nothing is seen in it
        "a picture of 64x4294967295 rgb8 with rows of 192 bytes needs",
        "the encoding '' is not known here",
    ]
    for line, sentence in zip(said, sentences, strict=True):
        if sentence is None:
            assert line["counts"] != []
            continue
        assert (line["counts"], line["boxes"], line["health"][0]) == ([], 0, 2)
        assert sentence in line["health"][1]
        node.says(sentence)
    assert alive == {"alive": [[HYDRANT]]}
    assert "Traceback" not in node.output


def test_types_and_sums(ros, models):
    start(ros, models)
    topics, services = play(ros, "contract")
    boxes, count = "004f6f4f48a741582d10735997905846", "123675bf4420958597b5a78cb3800a1f"
    assert topics["topics"]["/darknet_ros/bounding_boxes"] == ["darknet_ros_msgs/BoundingBoxes", boxes]
    assert topics["topics"]["/darknet_ros/found_object"] == ["darknet_ros_msgs/ObjectCount", count]
    assert topics["topics"]["/darknet_ros/detection_image"][0] == "sensor_msgs/Image"
    action = {name.rpartition("/")[2]: kind[0] for name, kind in topics["topics"].items() if "check_for" in name}
    assert action == {
        "status": "actionlib_msgs/GoalStatusArray",
        "result": "darknet_ros_msgs/CheckForObjectsActionResult",
        "feedback": "darknet_ros_msgs/CheckForObjectsActionFeedback",
    }
    assert "/darknet_ros/enable" in services["services"]


def test_only_the_drawn_picture_is_latched(ros, models):
    start(ros, models)
    late, ok = play(ros, "latching")
    assert late["late"] == {"boxes": [], "count": [], "drawn": [100]}
    assert ok == {"ok": [True]}


def test_latching_by_parameter(ros, models):
    latch = {f"publishers/{name}/latch": "true" for name in ("bounding_boxes", "object_detector")}
    start(ros, models, **latch, **{"publishers/detection_image/latch": "false"})
    assert play(ros, "latching")[0]["late"] == {"boxes": [100], "count": [100], "drawn": []}


def test_nothing_is_drawn_for_nobody(ros, models):
    start(ros, models)
    assert play(ros, "undrawn") == [{"late": 0}]


def test_people_without_weights(ros, models):
    start(ros, models, network="hog", **{"yolo_model/weight_file/name": "none.weights"})
    seen, nobody = play(ros, "hog")
    assert seen["counts"] == [1]
    name, number, xmin, ymin, xmax, ymax, _ = seen["boxes"][0][0]
    assert (name, number) == ("person", 0)
    assert xmin < 400 < xmax
    assert ymin < 200
    assert ymax > 330
    assert nobody == {"counts": [0], "boxes": []}


PEOPLE = ROOT.parent / "shared" / "people"


@pytest.fixture
def downloaded(tmp_path):
    """Folder with yolo-fastest-1.1-xl as download_weights puts it there, from a server on this machine."""
    handler = functools.partial(http.server.SimpleHTTPRequestHandler, directory=str(PEOPLE / "networks"))
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, args=(0.02,), daemon=True).start()
        url = f"http://127.0.0.1:{server.server_address[1]}/"
        assert run([REAL_CAMERA, "--folder", str(tmp_path), "--url", url]) == 0
        server.shutdown()
    return tmp_path


AUTO = ("__name:=darknet_ros", "_network:=auto")
needs_people = pytest.mark.skipif(not PEOPLE.is_dir(), reason=f"{PEOPLE} is not here")


def largest_person():
    """The photograph with the largest single person."""
    known = json.loads((PEOPLE / "coco.json").read_text())
    alone = {name: one for name, one in known.items() if len(one["persons"]) == 1}
    height = {name: (one["persons"][0][3] - one["persons"][0][1]) / one["size"][1] for name, one in alone.items()}
    return str(PEOPLE / "coco" / max(height, key=height.get))


@needs_people
def test_auto_takes_the_downloaded_network_and_says_how_good_it_is(ros, downloaded):
    node = ros.node("darknet_ros", *AUTO, f"_config_path:={downloaded}", f"_weights_path:={downloaded}")
    (seen,) = play(ros, "photograph", largest_person())
    assert "person" in seen["classes"]
    node.says(f"the network {REAL_CAMERA} finds 73 % of the large persons on photographs")
    assert seen["network"] == [0, REAL_CAMERA]


@needs_people
def test_a_second_opinion(ros, downloaded):
    files = (f"_config_path:={downloaded}", f"_weights_path:={downloaded}")
    node = ros.node("darknet_ros", *AUTO, *files, "_second_opinion:=hog")
    (seen,) = play(ros, "photograph", largest_person())
    assert "person" in seen["classes"]
    node.says("; second opinion by hog, which finds 5 % of the large persons")


@needs_people
def test_auto_passes_a_damaged_download_over(ros, downloaded):
    cfg = downloaded / f"{REAL_CAMERA}.cfg"
    cfg.write_bytes(cfg.read_bytes()[:5000])
    node = ros.node("darknet_ros", *AUTO, f"_config_path:={downloaded}", f"_weights_path:={downloaded}")
    node.says(f"{REAL_CAMERA} is not ready: {cfg} is damaged: it has 5,000 bytes, expected 9,696")
    wait_for(lambda: node.popen.poll() is not None or "the network ssdlite" in node.output, 15.0, "what comes instead")
    if node.popen.poll() is None:
        (seen,) = play(ros, "photograph", largest_person())
        assert "person" in seen["classes"]
        assert seen["network"] == [1, "ssdlite"]
    else:
        assert "let `scripts/bootstrap --robot` set up both" in node.output
    assert "Traceback" not in node.output


def test_compressed_input(ros, models):
    node = start(ros, models, image_transport="compressed")
    assert play(ros, "compressed") == [{"boxes": [[PERSON]]}]
    node.says("9 bytes of the format 'rgb8; png compressed bgr8' are no picture that can be read")


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
    assert ended["status"] == [3] * 7 + [2]  # succeeded, preempted
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
    assert "there are pictures on" not in node.output


def test_says_where_there_are_pictures_instead_and_what_comes(ros, models):
    probe = ros.probe()
    probe.tell(advertise=["/usb_cam/image_raw", "sensor_msgs/Image"])
    probe.tell(advertise=["/typed", "sensor_msgs/CompressedImage"])
    node = start(ros, models)
    other = ros.node("republish", "raw", "in:=/typed", "compressed", "out:=/nowhere", "__name:=other")
    node.says("nobody publishes it; there are pictures on")
    assert "/usb_cam/image_raw (sensor_msgs/Image)" in node.output
    other.says("published by /probe")
    other.says("as sensor_msgs/CompressedImage, which is another type")
    probe.tell(advertise=["/camera/rgb/image_raw", "sensor_msgs/Image"])
    until = time.monotonic() + 10.0
    while "come in," not in node.output and time.monotonic() < until:
        probe.tell(publish=["/camera/rgb/image_raw", {"height": 1, "width": 1, "encoding": "mono8", "data": [7]}])
        time.sleep(0.2)
    node.says("/camera/rgb/image_raw: pictures of 1x1 mono8 come in, ")


@pytest.mark.parametrize(
    ("params", "message"),
    [
        ({"yolo_model/weight_file/name": "none.weights"}, "none.weights is not there: put the file of"),
        ({"yolo_model/weight_file/name": "short.weights"}, "is cut short: it has 124 bytes"),
        ({"yolo_model/config_file/name": "none.cfg"}, "none.cfg cannot be read"),
        ({"yolo_model/config_file/name": "odd.cfg"}, "odd.cfg, line 5: [lstm] is a layer that is not known here"),
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


def test_republish_depth_there_and_back(ros):
    subprocess.run(["rosparam", "set", "/deep/compressedDepth/format", "rvl"], env=ros.env, check=True)
    ros.node("republish", "raw", "in:=/in", "compressedDepth", "out:=/deep")
    ros.node("republish", "compressedDepth", "in:=/deep", "raw", "out:=/out")
    (said,) = play(ros, "depth")
    assert (said["text"], said["encoding"], said["unknown"]) == ("32FC1; compressedDepth rvl", "32FC1", 1)
    assert said["worst"] < 0.01
    subprocess.run(["rosparam", "delete", "/deep"], env=ros.env, check=True)


def test_republish_to_all_and_tuned_while_it_runs(ros):
    node = ros.node("republish", "raw", "in:=/in", "out:=/middle")
    fine, coarse = play(ros, "tuning")
    assert fine["bytes"] > 3 * coarse["bytes"]
    node.says("a picture of encoding rgb8 is no depth, expected 32FC1")
    assert node.output.count("is no depth") == 1
    subprocess.run(["rosparam", "delete", "/middle"], env=ros.env, check=True)


@pytest.mark.parametrize("arguments", [["theora", "in:=/in", "raw", "out:=/out"], []])
def test_republish_refuses(ros, arguments):
    node = ros.node("republish", *arguments)
    node.says("usage: republish IN_TRANSPORT in:=BASE")
    wait_for(lambda: node.popen.poll() is not None, 10.0, "the end")
    assert node.popen.returncode == 1
