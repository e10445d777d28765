"""Our detector against Debian's own darknet: same cfg, weights and picture, same boxes."""

import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from rosbot_patrol.detection.darknet.cfg import parse_cfg, read_cfg
from rosbot_patrol.detection.darknet.decode import iou
from rosbot_patrol.detection.darknet.families import FAMILIES, cfg_text
from rosbot_patrol.detection.darknet.letterbox import Letterbox
from rosbot_patrol.detection.darknet.random_weights import random_weights
from rosbot_patrol.detection.darknet.weights import format_weights, read_weights
from rosbot_patrol.detection.detector import IOU_THRESHOLD, DarknetDetector
from rosbot_patrol.detection.network import CvNetwork, load_network
from rosbot_patrol.images.encodings import Picture

HERE = Path(__file__).parent
LIBRARY = Path("/usr/lib/darknet/libdarknet.so")
ROOT = HERE.parents[1]

# threads that wait for one another by turning round cost minutes on a busy machine
ALONE = dict(os.environ, OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1")

LARGE = ("yolov2-voc", "yolov3", "yolov3-voc")
needs_darknet = pytest.mark.skipif(not LIBRARY.exists(), reason="Debian's package darknet is not installed")

REGION = """
[net]
width=160
height=128
channels=3
[convolutional]
batch_normalize=1
filters=8
size=3
stride=1
pad=1
activation=leaky
[maxpool]
size=2
stride=2
[convolutional]
filters=16
size=3
stride=2
pad=1
activation=relu
[maxpool]
size=2
stride=1
[reorg]
stride=2
[convolutional]
batch_normalize=1
filters=16
size=3
pad=1
activation=leaky
[route]
layers=-1,-2
[maxpool]
size=3
stride=1
[convolutional]
filters=27
size=1
activation=linear
[region]
anchors=1.0,1.5, 2.5,2.0, 4.0,5.0
classes=4
num=3
softmax=1
thresh=.6
"""

YOLO = """
[net]
width=96
height=128
channels=3
[convolutional]
batch_normalize=1
filters=8
size=3
stride=2
pad=1
activation=leaky
[convolutional]
batch_normalize=1
filters=16
size=3
stride=2
pad=1
activation=leaky
[convolutional]
filters=16
size=3
stride=1
pad=1
activation=linear
[shortcut]
from=-2
activation=linear
[convolutional]
batch_normalize=1
filters=16
size=3
stride=2
pad=1
activation=leaky
[convolutional]
filters=18
size=1
activation=linear
[yolo]
mask=1,2
anchors=8,12, 20,30, 60,50
classes=4
num=3
[route]
layers=-3
[upsample]
stride=2
[route]
layers=-1,3
[convolutional]
filters=9
size=1
activation=linear
[yolo]
mask=0
anchors=8,12, 20,30, 60,50
classes=4
num=3
"""


def make_picture(width, height, seed=1):
    """Soft colours, so that neighbouring pixels are alike, as in a photo."""
    small = np.random.default_rng(seed).integers(0, 255, (max(height // 20, 5), max(width // 20, 5), 3), dtype=np.uint8)
    return cv2.resize(small, (width, height), interpolation=cv2.INTER_CUBIC)


def write_case(folder, text, pixels, *, seed=0):
    spec = parse_cfg(text, "case.cfg")
    deep = len(spec.layers) > 30
    weights = moderate_weights(spec, pixels) if deep else random_weights(spec, np.random.default_rng(seed))
    (folder / "case.cfg").write_text(text)
    (folder / "case.weights").write_bytes(format_weights(spec, weights))
    cv2.imwrite(str(folder / "case.png"), pixels[:, :, ::-1])
    return spec, weights


def moderate_weights(spec, pixels):
    """Random weights, the last convolutions scaled so that what a head gets is about 1: sums of a deep network grow."""
    weights = random_weights(spec, np.random.default_rng(0))
    place = Letterbox(pixels.shape[1], pixels.shape[0], spec.width, spec.height)
    values = load_network(spec, weights).run(Picture(pixels, "rgb8"), place)
    convolutions = [conv.index for conv in spec.convolutions]
    for head, value in zip(spec.heads, values, strict=True):
        at = convolutions.index(head.index - 1)
        weights[at] = replace(weights[at], weights=weights[at].weights / np.float32(value.std()))
    return weights


def ask_darknet(folder, spec, threshold):
    files = [str(folder / name) for name in ("case.cfg", "case.weights", "case.png")]
    command = [sys.executable, str(HERE / "darknet_reference.py"), *files]
    command += [str(spec.classes), str(threshold), str(IOU_THRESHOLD)]
    done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=120, env=ALONE)
    return json.loads(done.stdout.splitlines()[-1])["boxes"]


def assert_same(theirs, ours, *, within=0.01):
    """Each of darknet's boxes has its like in ours and the other way round: IoU 0.99, classes, probabilities."""
    assert theirs, "the case shows nothing: darknet sees no box"
    assert len(ours) == len(theirs)
    order = np.argsort([-box["objectness"] for box in theirs], kind="stable")
    left = set(range(len(ours)))
    for box in (theirs[i] for i in order):
        best = max(left, key=lambda k: iou(np.array(box["box"]), ours.boxes[k : k + 1])[0])
        assert iou(np.array(box["box"]), ours.boxes[best : best + 1])[0] > 0.99
        assert ours.objectness[best] == pytest.approx(box["objectness"], abs=within)
        np.testing.assert_allclose(ours.probabilities[best], box["probabilities"], atol=within)
        assert ((ours.probabilities[best] > 0) == (np.array(box["probabilities"]) > 0)).all()
        left.remove(best)


def seen(spec, network, pixels, threshold):
    names = [str(i) for i in range(spec.classes)]
    found = DarknetDetector(spec, network, names, threshold=threshold).candidates(Picture(pixels, "rgb8"))
    return found.only(found.probabilities.any(axis=1))


@needs_darknet
@pytest.mark.parametrize("text", [REGION, YOLO], ids=["region", "yolo"])
@pytest.mark.parametrize("size", [(640, 480), (97, 211), (160, 128), (33, 20)])
def test_small_network_as_darknet(tmp_path, text, size):
    pixels = make_picture(*size)
    spec, weights = write_case(tmp_path, text, pixels)
    assert_same(ask_darknet(tmp_path, spec, 0.3), seen(spec, load_network(spec, weights), pixels, 0.3))


@needs_darknet
@pytest.mark.parametrize("threshold", [0.05, 0.2])
def test_thresholds_as_darknet(tmp_path, threshold):
    pixels = make_picture(320, 240, seed=4)
    spec, weights = write_case(tmp_path, REGION, pixels, seed=2)
    assert_same(ask_darknet(tmp_path, spec, threshold), seen(spec, load_network(spec, weights), pixels, threshold))


@needs_darknet
@pytest.mark.parametrize(("name", "threshold"), [("yolov2-tiny", 0.05), ("yolov3-tiny", 0.3)])
def test_real_network_with_random_weights_as_darknet(tmp_path, name, threshold):
    pixels = make_picture(640, 480)
    spec, weights = write_case(tmp_path, cfg_text(FAMILIES[name]), pixels)
    assert_same(ask_darknet(tmp_path, spec, threshold), seen(spec, load_network(spec, weights), pixels, threshold))


@needs_darknet
@pytest.mark.parametrize(
    "name",
    ["yolov2-tiny-voc", "yolov2", *(pytest.param(name, marks=pytest.mark.long) for name in LARGE)],
)
def test_every_family_that_darknet_knows(tmp_path, name):
    """All layers of the network, with a sixteenth of their filters and a smaller input: seconds instead of minutes."""
    pixels = make_picture(320, 240)
    text = cfg_text(FAMILIES[name], size=160, thinner=16)
    spec, weights = write_case(tmp_path, text, pixels)
    theirs = ask_darknet(tmp_path, spec, 0.1)
    assert_same(theirs, seen(spec, load_network(spec, weights), pixels, 0.1))


@needs_darknet
def test_our_own_network_as_darknet(tmp_path):
    """On a picture of the simulator's camera with somebody in it."""
    pixels = cv2.imread(str(ROOT / "docs/images/detection.jpg"))[:, :, ::-1]
    spec = read_cfg(str(ROOT / "models/house.cfg"))
    weights = read_weights(str(ROOT / "models/house.weights"), spec)
    (tmp_path / "case.cfg").write_text(spec.text)
    (tmp_path / "case.weights").write_bytes((ROOT / "models/house.weights").read_bytes())
    cv2.imwrite(str(tmp_path / "case.png"), pixels[:, :, ::-1])
    for threshold in (0.01, 0.1):
        assert_same(ask_darknet(tmp_path, spec, threshold), seen(spec, load_network(spec, weights), pixels, threshold))


@pytest.mark.parametrize("name", ["yolov4-tiny", "yolov4"])
def test_yolov4_as_opencv(name):
    """Debian's darknet knows neither mish nor groups of a route; OpenCV's dnn has both from other hands."""
    pixels = make_picture(320, 240)
    spec = parse_cfg(cfg_text(FAMILIES[name], size=160, thinner=16), f"{name}.cfg")
    weights = moderate_weights(spec, pixels)
    theirs = seen(spec, CvNetwork(cv2, spec, format_weights(spec, weights)), pixels, 0.5)
    boxes = [
        {"box": box.tolist(), "objectness": objectness, "probabilities": probabilities}
        for box, objectness, probabilities in zip(theirs.boxes, theirs.objectness, theirs.probabilities, strict=True)
    ]
    assert_same(boxes, seen(spec, load_network(spec, weights), pixels, 0.5))


@pytest.mark.parametrize("text", [REGION, YOLO], ids=["region", "yolo"])
def test_opencv_as_second_opinion(text):
    pixels = make_picture(320, 240)
    spec = parse_cfg(text, "case.cfg")
    weights = random_weights(spec, np.random.default_rng(0))
    ours = seen(spec, load_network(spec, weights), pixels, 0.3)
    theirs = seen(spec, CvNetwork(cv2, spec, format_weights(spec, weights)), pixels, 0.3)
    assert len(ours) == len(theirs) > 0
    np.testing.assert_allclose(ours.boxes, theirs.boxes, atol=1e-3)
    np.testing.assert_allclose(ours.probabilities, theirs.probabilities, atol=1e-3)
