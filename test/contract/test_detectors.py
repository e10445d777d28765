"""What every detector promises, by whichever network: the interface of rosbot_patrol.detection.detector."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from rosbot_patrol.detection.choice import NetworkFolders, choose_detector, network_settings
from rosbot_patrol.detection.detector import Detection, Detector
from rosbot_patrol.detection.params import DarknetParams
from rosbot_patrol.errors import DetectorError, ImageError
from rosbot_patrol.images.encodings import Picture

ROOT = Path(__file__).parents[2]
PEOPLE = ROOT.parent / "shared" / "people"
FOLDERS = NetworkFolders(own=ROOT / "models", darknet=ROOT / "drop_in" / "darknet_ros")
# first network, second opinion
NETWORKS = [("house", ""), ("hog", ""), ("ssdlite", ""), ("yolo-fastest-1.1-xl", ""), ("yolo-fastest-1.1-xl", "hog")]


@pytest.fixture(scope="module", params=NETWORKS, ids=lambda pair: "+".join(filter(None, pair)))
def detector(request: pytest.FixtureRequest) -> Detector:
    name, second = request.param
    files = str(PEOPLE / "networks")
    params = network_settings(name, DarknetParams(second_opinion=second), FOLDERS)
    if name.startswith("yolo"):
        if not PEOPLE.is_dir():
            pytest.skip(f"{files} with {name} is not here")
        params = dataclasses.replace(params, config_path=files, weights_path=files)
    try:
        return choose_detector(params, FOLDERS).detector
    except DetectorError as err:
        if name == "ssdlite":
            pytest.skip(str(err))
        raise


def photographs() -> list[Picture]:
    names = sorted(json.loads((PEOPLE / "coco.json").read_text()))[:12] if PEOPLE.is_dir() else []
    pixels = [cv2.imread(str(PEOPLE / "coco" / name)) for name in names]
    pixels.append(cv2.imread(str(ROOT / "docs" / "images" / "detection.jpg")))
    return [Picture(one, "bgr8") for one in pixels]


def look(detector: Detector, picture: Picture) -> list[Detection]:
    """One picture, as the first of its kind also for a second opinion."""
    detector.detect(Picture(np.zeros_like(picture.pixels), picture.encoding))
    return detector.detect(picture)


def test_it_knows_people(detector: Detector) -> None:
    assert "person" in detector.names
    assert detector.runtime


def test_boxes_lie_in_the_picture_and_are_in_order(detector: Detector) -> None:
    seen = 0
    for picture in photographs():
        found = look(detector, picture)
        seen += len(found)
        assert [one.class_id for one in found] == sorted(one.class_id for one in found)
        for one in found:
            assert detector.names[one.class_id] == one.name
            assert 0.0 < one.probability <= 1.0
            assert 0 <= one.xmin < one.xmax <= picture.width
            assert 0 <= one.ymin < one.ymax <= picture.height
            assert all(type(value) is int for value in (one.class_id, one.xmin, one.ymin, one.xmax, one.ymax))
    assert seen > 0 or not PEOPLE.is_dir()  # our own picture is a rendering, which hog and ssdlite know nobody in


def test_the_same_picture_gives_the_same_boxes_in_either_order_of_colours(detector: Detector) -> None:
    picture = photographs()[-1]
    turned = Picture(np.ascontiguousarray(picture.pixels[:, :, ::-1]), "rgb8")
    assert look(detector, picture) == look(detector, picture) == look(detector, turned)


@pytest.mark.parametrize("level", [0, 128, 255])
def test_an_even_picture_shows_nobody(detector: Detector, level: int) -> None:
    assert detector.detect(Picture(np.full((480, 640, 3), level, np.uint8), "rgb8")) == []


@pytest.mark.parametrize("size", [(1, 1), (3, 500), (500, 3), (97, 61), (1920, 1080)])
def test_pictures_of_any_size(detector: Detector, size: tuple[int, int]) -> None:
    noise = np.random.default_rng(0).integers(0, 255, (size[1], size[0], 3), dtype=np.uint8)
    detector.detect(Picture(noise, "rgb8"))


def test_grey_pictures(detector: Detector) -> None:
    detector.detect(Picture(np.full((240, 320, 1), 90, np.uint8), "mono8"))


def test_depth_is_refused(detector: Detector) -> None:
    with pytest.raises(ImageError, match="has no colours"):
        detector.detect(Picture(np.zeros((300, 300, 1), np.float32), "32FC1"))
