import numpy as np
import pytest

from rosbot_patrol.detection import draw
from rosbot_patrol.detection.darknet.cfg import parse_cfg
from rosbot_patrol.detection.darknet.decode import Candidates
from rosbot_patrol.detection.darknet.random_weights import random_weights
from rosbot_patrol.detection.darknet.weights import format_weights
from rosbot_patrol.detection.detector import DarknetDetector, Detection, load_detector, to_detections
from rosbot_patrol.detection.draw import COLOURS, draw_boxes
from rosbot_patrol.detection.network import load_network
from rosbot_patrol.detection.params import DarknetParams
from rosbot_patrol.errors import DetectorError, ImageError
from rosbot_patrol.images.encodings import Picture
from rosbot_patrol.params import load

CFG = (
    "[net]\nwidth=64\nheight=64\nchannels=3\n[convolutional]\nbatch_normalize=1\nfilters=8\nsize=3\nstride=4\npad=1\n"
    "activation=leaky\n[maxpool]\nsize=2\nstride=2\n[convolutional]\nfilters=14\nactivation=linear\n"
    "[region]\nanchors=1,1,2,3\nclasses=2\nnum=2\nsoftmax=1\n"
)
NAMES = ["person", "fire hydrant"]


def make_picture(encoding="rgb8", *, width=80, height=60):
    small = np.random.default_rng(0).integers(0, 255, (height, width, 3), dtype=np.uint8)
    return Picture(small, "rgb8").to(encoding)


def make_detector(threshold=0.3):
    spec = parse_cfg(CFG, "case.cfg")
    network = load_network(spec, random_weights(spec, np.random.default_rng(1)))
    return DarknetDetector(spec, network, NAMES, threshold=threshold)


def make_candidates(boxes, probabilities):
    boxes = np.array(boxes, dtype=np.float32)
    return Candidates(boxes, np.ones(len(boxes)), np.array(probabilities, dtype=np.float32))


def test_boxes_are_cut_to_the_picture_and_truncated():
    found = to_detections(make_candidates([[0.05, 0.5, 0.2, 0.3001]], [[0.9, 0.0]]), NAMES, 100, 100)
    assert [(d.xmin, d.ymin, d.xmax, d.ymax) for d in found] == [(0, 34, 15, 65)]
    assert (found[0].name, found[0].class_id) == ("person", 0)


def test_tiny_boxes_and_such_of_no_number_are_left_out():
    boxes = [[0.5, 0.5, 0.009, 0.5], [0.5, 0.5, 0.5, 0.009], [np.nan, 0.5, 0.5, 0.5], [2.0, 0.5, 0.1, 0.1]]
    assert to_detections(make_candidates(boxes, [[0.9, 0.0]] * 4), NAMES, 100, 100) == []


def test_order_is_by_class_then_as_they_came():
    found = to_detections(
        make_candidates([[0.5, 0.5, 0.5, 0.5]] * 3, [[0.0, 0.9], [0.4, 0.5], [0.8, 0.0]]), NAMES, 10, 10
    )
    assert [(d.class_id, round(d.probability, 1)) for d in found] == [(0, 0.4), (0, 0.8), (1, 0.9), (1, 0.5)]


def test_the_hundred_most_probable_count():
    probabilities = [[p / 200, 0.0] for p in range(1, 151)]
    found = to_detections(make_candidates([[0.5, 0.5, 0.5, 0.5]] * 150, probabilities), NAMES, 10, 10)
    assert len(found) == 100
    assert min(d.probability for d in found) == pytest.approx(51 / 200)


def test_colours_come_out_the_same_in_every_encoding():
    detector = make_detector()
    expected = detector.detect(make_picture())
    assert expected
    assert detector.detect(make_picture("bgr8")) == expected
    rgb = make_picture().pixels
    alpha = np.full((*rgb.shape[:2], 1), 7, dtype=np.uint8)
    assert detector.detect(Picture(np.concatenate([rgb, alpha], axis=2), "rgba8")) == expected
    assert detector.detect(Picture(np.concatenate([rgb[:, :, ::-1], alpha], axis=2), "bgra8")) == expected


def test_grey_pictures_of_8_and_16_bits():
    detector = make_detector()
    grey = make_picture().to("mono8")
    assert detector.detect(Picture(grey.pixels.astype(np.uint16) * 257, "mono16")) == detector.detect(grey)
    assert detector.detect(Picture(np.repeat(grey.pixels, 3, axis=2), "rgb8")) == detector.detect(grey)


@pytest.mark.parametrize("size", [(1, 1), (1, 50), (50, 1), (2000, 3)])
def test_pictures_of_odd_sizes(size):
    make_detector(0.01).detect(make_picture(width=size[0], height=size[1]))


def test_depth_is_refused():
    with pytest.raises(ImageError, match="32FC1 has no colours"):
        make_detector().detect(Picture(np.zeros((5, 5, 1), np.float32), "32FC1"))


def test_drawing_leaves_the_picture_alone():
    picture = make_picture("bgr8", width=320, height=240)
    before = picture.pixels.copy()
    drawn = draw_boxes(picture, make_detector().detect(picture))
    assert drawn.pixels.shape == (240, 320, 3)
    assert (drawn.pixels != before).any()
    np.testing.assert_array_equal(picture.pixels, before)


def test_boxes_are_drawn_at_their_places_and_labels_inside():
    grey = Picture(np.full((480, 640, 3), 128, np.uint8), "bgr8")
    inside = Detection(0, "person", 0.93, 100, 80, 220, 400)
    drawn = draw_boxes(grey, [inside]).pixels
    rows, columns = np.nonzero((drawn != 128).any(axis=2))
    assert (columns.min(), columns.max(), rows.max()) == (100, 220, 400)
    assert 55 <= rows.min() <= 65  # the label above it
    assert tuple(drawn[240, 100]) == tuple(drawn[400, 160]) == COLOURS[0]
    assert (drawn[82:398, 102:218] == 128).all()
    corner = Detection(1, "fire hydrant", 0.5, 600, -20, 700, 60)
    drawn = draw_boxes(grey, [corner]).pixels  # its label would stand beyond the picture's right and upper edge
    label = (drawn == COLOURS[1]).all(axis=2)
    assert label[:15, 540:].sum() > 600
    assert not label[:, :500].any()
    draw_boxes(grey, [Detection(0, "Wächter 中", 1.0, 50, 70, 50, 70), Detection(0, "a", 1.0, 60, 70, 50, 60)])


def test_labels_without_the_font_are_small_and_it_is_said(monkeypatch, caplog):
    def missing(*_):
        raise OSError("cannot open resource")

    monkeypatch.setattr(draw.ImageFont, "truetype", missing)
    draw._font.cache_clear()
    grey = Picture(np.full((480, 640, 3), 128, np.uint8), "bgr8")
    drawn = draw_boxes(grey, [Detection(0, "person", 0.93, 100, 80, 220, 400)])
    draw_boxes(grey, [Detection(0, "人", 0.93, 100, 80, 220, 400)])
    draw._font.cache_clear()
    assert (drawn.pixels != 128).any()
    assert "DejaVuSans.ttf: cannot open resource (package fonts-dejavu-core)" in caplog.text


def write_files(folder, *, names=None):
    (folder / "case.cfg").write_text(CFG)
    spec = parse_cfg(CFG)
    (folder / "case.weights").write_bytes(format_weights(spec, random_weights(spec, np.random.default_rng(1))))
    if names is not None:
        (folder / "case.names").write_text("\n".join(names))
    return str(folder / "case.cfg"), str(folder / "case.weights")


def test_names_may_stand_beside_the_cfg(tmp_path):
    cfg, weights = write_files(tmp_path, names=NAMES)
    assert load_detector(cfg, weights, []).names == tuple(NAMES)


def test_names_that_do_not_match_are_refused(tmp_path):
    cfg, weights = write_files(tmp_path)
    with pytest.raises(DetectorError, match=r"3 class names are given, .*case.cfg tells 2 classes apart"):
        load_detector(cfg, weights, ["a", "b", "c"])
    with pytest.raises(DetectorError, match=r"no names are given and .*case.names cannot be read"):
        load_detector(cfg, weights, [])


def test_files_that_parameters_name():
    assert DarknetParams().network_files("/m") == ("/m/house.cfg", "/m/house.weights")
    tree = {"config_path": "/c", "weights_path": "/w", "yolo_model": {"config_file": {"name": "a.cfg"}}}
    assert load(DarknetParams, tree).network_files("/m") == ("/c/a.cfg", "/w/yolov2-tiny.weights")
