"""The detector over the pictures of a bag."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from made_bag import Maker, write_bag

from rosbot_patrol.detection import detector as darknet
from rosbot_patrol.detection.choice import NetworkFolders, choose_detector
from rosbot_patrol.detection.detector import Detection
from rosbot_patrol.detection.params import DarknetParams
from rosbot_patrol.images.encodings import Picture
from rosbot_patrol.params import load
from rosbot_patrol.replay.bags.bag import Bag
from rosbot_patrol.replay.nodes.detector import FIELDS, DetectorReplay
from rosbot_patrol.replay.nodes.setup import Setup, build_replay
from rosbot_patrol.replay.results.comparison import compare
from rosbot_patrol.replay.results.tables import Result
from rosbot_patrol.replay.runner import Replay, run_replay
from rosbot_patrol.yaml_files import read_mapping

ROOT = Path(__file__).resolve().parents[4]
MODELS = ROOT / "models"
PICTURE = ROOT / "docs" / "images" / "detection.jpg"
IMAGE, COMPRESSED = "sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage"


class Brightest:
    """Sees one thing in each picture: its brightest pixel."""

    names, runtime = ("light",), "numpy"

    def detect(self, picture: Picture) -> list[Detection]:
        grey = picture.to("mono8").pixels[:, :, 0]
        row, column = (int(i) for i in np.unravel_index(grey.argmax(), grey.shape))
        return [Detection(0, "light", float(grey.max()) / 255.0, column, row, column, row)]


def raw(maker: Maker, stamp: float, pixels: np.ndarray, encoding: str = "rgb8") -> object:
    height, width, channels = pixels.shape
    header = maker.header(stamp, "camera")
    return maker.new(IMAGE, header, height, width, encoding, 0, width * channels, pixels.ravel())


def replayed(path: Path, replay: Replay) -> Result:
    with Bag(path) as bag:
        return run_replay(bag, replay)


def test_each_picture_is_looked_at_with_its_own_stamp(tmp_path: Path) -> None:
    maker, messages = Maker(), []
    for i in range(4):
        pixels = np.zeros((6, 8, 3), dtype=np.uint8)
        pixels[i, i + 2] = 200
        messages.append((10.0 + i, "/camera/rgb/image_raw", raw(maker, 9.5 + i, pixels)))
    broken = raw(maker, 20.0, np.zeros((6, 8, 3), dtype=np.uint8), encoding="plaid")
    messages.append((15.0, "/camera/rgb/image_raw", broken))
    path = write_bag(tmp_path / "a.bag", messages)
    result = replayed(path, DetectorReplay(Brightest()))
    assert result.counts == {"pictures": 4, "refused": 1, "boxes": 4}
    boxes = result.tables["boxes"]
    assert boxes["stamp"].tolist() == [9.5, 10.5, 11.5, 12.5]
    assert boxes["xmin"].tolist() == [2, 3, 4, 5]
    assert boxes["ymin"].tolist() == [0, 1, 2, 3]
    assert boxes["label"].tolist() == ["light"] * 4


def test_our_network_on_a_compressed_picture_and_a_planted_fault(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    maker = Maker()
    data = np.frombuffer(PICTURE.read_bytes(), dtype=np.uint8)
    message = maker.new(COMPRESSED, maker.header(3.0, "camera"), "rgb8; jpeg compressed bgr8", data)
    path = write_bag(tmp_path / "a.bag", [(3.1, "/camera/rgb/image_raw", message)])
    stored = replayed(path, build_replay(Setup(node="darknet_ros")))
    given = load(DarknetParams, read_mapping(MODELS / "house.yaml", keys=""))
    network = choose_detector(given, NetworkFolders(own=MODELS, darknet=ROOT / "drop_in" / "darknet_ros")).detector
    assert "person" in stored.tables["boxes"]["label"].tolist()
    again = replayed(path, DetectorReplay(network))
    assert again.digest == stored.digest
    assert compare(stored, again, FIELDS) == []
    monkeypatch.setattr(darknet, "SMALLEST_SHARE", 0.9)  # what is smaller than the picture is dropped
    differences = compare(stored, replayed(path, DetectorReplay(network)), FIELDS)
    assert any(each.name == "boxes.rows" and "stored rows are missing" in each.text for each in differences)
