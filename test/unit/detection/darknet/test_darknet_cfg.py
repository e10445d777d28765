from pathlib import Path

import pytest

from rosbot_patrol.detection.darknet.cfg import parse_cfg, read_cfg
from rosbot_patrol.detection.darknet.layers import Convolutional, Maxpool, Region, Yolo
from rosbot_patrol.errors import DetectorError

CFG = Path(__file__).parents[4] / "drop_in/darknet_ros/yolo_network_config/cfg"

NET = "[net]\nwidth=64\nheight=32\nchannels=3\n"
CONV = "[convolutional]\nfilters=14\nsize=1\nactivation=linear\n"
REGION = "[region]\nanchors=1,2, 3,4\nclasses=2\nnum=2\nsoftmax=1\n"


def shapes(text):
    return [layer.out_shape for layer in parse_cfg(NET + text + CONV + REGION).layers[:-2]]


def test_yolov2_tiny_ends_in_a_grid_of_13():
    spec = read_cfg(str(CFG / "yolov2-tiny.cfg"))
    assert spec.heads[0].out_shape == (425, 13, 13)
    assert isinstance(spec.heads[0], Region)
    assert spec.classes == 80


def test_mask_chooses_the_anchors_of_a_head():
    spec = read_cfg(str(CFG / "yolov3-tiny.cfg"))
    first, second = spec.heads
    assert isinstance(first, Yolo)
    assert first.anchors[0] == (81.0, 82.0)
    assert second.anchors[0] == (10.0, 14.0)


@pytest.mark.parametrize(
    ("layer", "shape"),
    [
        ("[convolutional]\nfilters=8\nsize=3\npad=1\nstride=2\n", (8, 16, 32)),
        ("[convolutional]\nfilters=8\nsize=3\n", (8, 30, 62)),
        ("[convolutional]\nfilters=6\nsize=3\npad=1\ngroups=3\n", (6, 32, 64)),
        ("[maxpool]\nsize=2\nstride=2\n", (3, 16, 32)),
        ("[maxpool]\nsize=2\nstride=1\n", (3, 32, 64)),
        ("[maxpool]\nsize=5\nstride=1\n", (3, 32, 64)),
        ("[upsample]\nstride=2\n", (3, 64, 128)),
        ("[dropout]\nprobability=.5\n", (3, 32, 64)),
    ],
)
def test_shape_of_a_layer(layer, shape):
    assert shapes(layer)[0] == shape


def test_route_joins_and_reorg_folds():
    conv = "[convolutional]\nfilters=4\nsize=3\npad=1\n"
    half = "[convolutional]\nfilters=8\nsize=3\npad=1\nstride=2\n"
    reorg = "[route]\nlayers=-2\n[reorg]\nstride=2\n[route]\nlayers=-1,-3\n"
    assert shapes(conv + half + reorg)[-2:] == [(16, 16, 32), (24, 16, 32)]


def test_route_takes_one_of_two_groups():
    text = "[convolutional]\nfilters=8\n[route]\nlayers=-1\ngroups=2\ngroup_id=1\n"
    assert shapes(text)[-1] == (4, 32, 64)


def test_spaces_comments_and_case_of_a_hand_written_file():
    spec = parse_cfg("# mine\n" + NET.replace("=", " = ") + "; a note\n" + CONV + "\n" + REGION)
    assert isinstance(spec.layers[0], Convolutional)
    assert (spec.width, spec.height) == (64, 32)


def test_maxpool_pads_size_less_one():
    layer = parse_cfg(NET + "[maxpool]\nsize=2\nstride=2\n" + CONV + REGION).layers[0]
    assert isinstance(layer, Maxpool)
    assert layer.padding == 1


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "has no sections"),
        ("width=3", "line 1.*before the first"),
        ("[net", "line 1.*no section"),
        (NET, "has no layers"),
        (NET + "nonsense\n", "line 5: 'nonsense' is neither"),
        (CONV, r"line 1: \[convolutional\] comes first, expected \[net\]"),
        (NET + "[gru]\n" + CONV, r"line 5: \[gru\] is a layer that is not known"),
        (NET + CONV, "finds no boxes"),
        (NET + CONV + REGION + "[softmax]\n", r"line 14: \[softmax\] is a layer that is not known"),
        (NET + CONV + REGION + "tree=9k.tree\n", r"line 14: \[region\] tree= \(YOLO9000\) is not supported here"),
        (NET + CONV.replace("linear", "gelu") + REGION, "line 8.*activation=gelu is not known"),
        (NET + CONV.replace("14", "many") + REGION, "line 6.*filters=many is not a whole number"),
        (NET + CONV.replace("14", "0") + REGION, "line 6.*filters=0, expected at least 1"),
        (
            NET + CONV.replace("14", "15") + REGION,
            r"line 9: \[region\] needs 2 boxes x 7 values = 14 channels.* has 15",
        ),
        (NET + CONV + REGION.replace("1,2, 3,4", "1,2,3"), "line 10.*3 anchor values, expected 2 x 2"),
        (NET + "[route]\nlayers=-1\n" + CONV + REGION, "line 6.*layers=-1 is no earlier layer"),
        (NET + "[shortcut]\nfrom=9\n" + CONV + REGION, "line 6.*from=9 is no earlier layer"),
        (NET + "[reorg]\nstride=7\n" + CONV + REGION, "line 6.*stride=7 does not divide 64x32x3"),
        (NET + "[convolutional]\nsize=99\n" + CONV + REGION, r"line 5.*nothing is left"),
        (NET.replace("64", "0") + CONV + REGION, "line 2.*width=0"),
    ],
)
def test_what_is_wrong_is_said_with_its_line(text, message):
    with pytest.raises(DetectorError, match=message):
        parse_cfg(text, "house.cfg")


def test_file_that_is_not_there():
    with pytest.raises(DetectorError, match=r"nowhere\.cfg cannot be read"):
        read_cfg("nowhere.cfg")
