import dataclasses
import hashlib
import logging
import shutil
import sys
from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from rosbot_patrol.detection import choice
from rosbot_patrol.detection.catalogue import REAL_CAMERA, NetworkFile, PublishedNetwork
from rosbot_patrol.detection.choice import NetworkFolders, choose_detector, network_settings
from rosbot_patrol.detection.darknet.cfg import parse_cfg
from rosbot_patrol.detection.darknet.random_weights import random_weights
from rosbot_patrol.detection.darknet.weights import format_weights
from rosbot_patrol.detection.params import DarknetParams, Threshold, YoloModel
from rosbot_patrol.detection.second_opinion import SecondOpinion
from rosbot_patrol.detection.ssd.model_file import GRAPH_SHA256
from rosbot_patrol.errors import DetectorError, ParamError

ROOT = Path(__file__).parents[3]
CFG = "[net]\nwidth=32\nheight=32\n[convolutional]\nfilters=85\n[region]\nanchors=1,1\nclasses=80\nnum=1\n"
SSDLITE = "rosbot_patrol.detection.ssdlite"


@pytest.fixture
def folders(tmp_path):
    """Our own network, and a package darknet_ros without a network's files."""
    shutil.copytree(ROOT / "drop_in" / "darknet_ros" / "config", tmp_path / "darknet_ros" / "config")
    for name in ("cfg", "weights"):
        (tmp_path / "darknet_ros" / "yolo_network_config" / name).mkdir(parents=True)
    return NetworkFolders(own=ROOT / "models", darknet=tmp_path / "darknet_ros")


@pytest.fixture
def files(folders, monkeypatch):
    """A small network under the name of the one for a real camera, whole; its cfg and its weights."""
    shared = folders.darknet / "yolo_network_config"
    cfg, weights = shared / "cfg" / f"{REAL_CAMERA}.cfg", shared / "weights" / f"{REAL_CAMERA}.weights"
    spec = parse_cfg(CFG)
    cfg.write_text(CFG)
    weights.write_bytes(format_weights(spec, random_weights(spec, np.random.default_rng(0))))
    published = tuple(
        NetworkFile(
            file=path.name,
            size=path.stat().st_size,
            urls=("https://nowhere",),
            sha256=hashlib.sha256(path.read_bytes()).hexdigest(),
        )
        for path in (cfg, weights)
    )
    monkeypatch.setitem(choice.CATALOGUE, REAL_CAMERA, PublishedNetwork(name=REAL_CAMERA, files=published))
    return cfg, weights


class Stub:
    names, runtime = ("person",), "a stub"


@pytest.fixture
def ssdlite(monkeypatch):
    """SSDLite as it is where it was set up; what it was asked for."""
    asked = []

    def load_ssdlite(*, threshold, threads):
        asked.append((threshold, threads))
        return Stub()

    monkeypatch.setitem(sys.modules, SSDLITE, SimpleNamespace(load_ssdlite=load_ssdlite))
    return asked


@pytest.fixture
def no_ssdlite(monkeypatch):
    def load_ssdlite(*, threshold, threads):
        raise DetectorError("its graph was not made")

    monkeypatch.setitem(sys.modules, SSDLITE, SimpleNamespace(load_ssdlite=load_ssdlite))


AUTO = DarknetParams(network="auto", threads=2)


def test_auto_takes_what_was_downloaded(folders, files, ssdlite, caplog):
    with caplog.at_level(logging.INFO):
        found = choose_detector(AUTO, folders)
    assert (found.network, found.passed_over, len(found.detector.names)) == (REAL_CAMERA, (), 80)
    assert ssdlite == []
    said = "finds 73 % of the large persons on photographs (COCO val2017), no alarm on 55 pictures without people"
    assert found.describe() == f"{REAL_CAMERA} {said}"
    assert f"the network {REAL_CAMERA} {said}, by onnxruntime" in caplog.text


def test_auto_takes_ssdlite_where_nothing_was_downloaded(folders, ssdlite, caplog):
    found = choose_detector(AUTO, folders)
    assert (found.network, found.detector.runtime, ssdlite) == ("ssdlite", "a stub", [(0.5, 2)])
    assert "finds 61 %" in found.describe()
    assert "1 alarm on 55" in found.describe()
    cfg = folders.darknet / "yolo_network_config" / "cfg" / f"{REAL_CAMERA}.cfg"
    assert found.passed_over == (f"{REAL_CAMERA} is not ready: {cfg} is not there",)
    assert f"to get it: rosrun rosbot_patrol download_weights {REAL_CAMERA}" in caplog.text


def test_auto_keeps_the_threshold_that_the_launch_file_sets(folders, files, ssdlite):
    """rosbot_patrol.launch sets 0.1, because the patrol weighs weak boxes, too; without it the network's own counts."""
    low = dataclasses.replace(AUTO, yolo_model=YoloModel(threshold=Threshold(value=0.1)))
    assert (choose_detector(low, folders).threshold, choose_detector(AUTO, folders).threshold) == (0.1, 0.4)
    files[1].unlink()
    assert (choose_detector(low, folders).threshold, choose_detector(AUTO, folders).threshold) == (0.1, 0.5)
    assert ssdlite == [(0.1, 2), (0.5, 2)]


def test_the_network_of_a_package_is_named_by_the_sum_of_its_graph(folders, ssdlite):
    found = choose_detector(network_settings("ssdlite", DarknetParams(), folders), folders)
    assert (found.network, found.sha256) == ("ssdlite", GRAPH_SHA256)


@pytest.mark.parametrize("which", [0, 1])
def test_auto_passes_a_damaged_download_over(folders, files, ssdlite, which):
    whole = files[which].read_bytes()
    for data, problem in ((whole[:-7], "has "), (whole[:-1] + b"!", "has the sha256 ")):
        files[which].write_bytes(data)
        found = choose_detector(AUTO, folders)
        assert found.network == "ssdlite"
        assert found.passed_over[0].startswith(f"{REAL_CAMERA} is not ready: {files[which]} is damaged: it {problem}")


def test_auto_without_any_network_names_both_commands(folders, no_ssdlite):
    with pytest.raises(DetectorError) as caught:
        choose_detector(AUTO, folders)
    said = str(caught.value)
    assert "ssdlite is not ready: its graph was not made" in said
    assert f"`rosrun rosbot_patrol download_weights {REAL_CAMERA}`" in said
    assert "`scripts/bootstrap --robot`" in said


def test_auto_looks_where_the_parameters_say(folders, files, ssdlite, tmp_path):
    for path in files:
        path.rename(tmp_path / path.name)
    params = DarknetParams(network="auto", config_path=str(tmp_path), weights_path=str(tmp_path))
    assert choose_detector(params, folders).network == REAL_CAMERA


def test_by_name(folders, ssdlite):
    house = choose_detector(network_settings("house", DarknetParams(), folders), folders)
    assert (house.network, house.detector.names) == ("house", ("person", "fire hydrant"))
    assert house.describe().endswith("8 alarms on 55 pictures without people; it was trained for the simulated houses")
    found = choose_detector(network_settings("ssdlite", DarknetParams(), folders), folders)
    assert (found.network, ssdlite) == ("ssdlite", [(0.5, 1)])
    with pytest.raises(ParamError, match=r"config: 'ssdlit' is not known here, did you mean 'ssdlite'\?"):
        network_settings("ssdlit", DarknetParams(), folders)
    tiny = network_settings("yolov2-tiny", DarknetParams(config_path="/x"), folders)
    assert Path(tiny.network_files("")[0]) == folders.darknet / "yolo_network_config" / "cfg" / "yolov2-tiny.cfg"


def test_hog_by_name_only_while_opencv_has_it(folders, monkeypatch):
    assert choose_detector(DarknetParams(network="hog"), folders).network == "hog"
    monkeypatch.delattr(cv2, "HOGDescriptor")
    monkeypatch.setattr(cv2, "__version__", "5.0.0")
    with pytest.raises(DetectorError, match=r"OpenCV 5\.0\.0 has no HOGDescriptor, so hog is gone: use network:=auto"):
        choose_detector(DarknetParams(network="hog"), folders)


def test_another_network_was_not_measured(folders, tmp_path):
    spec = parse_cfg(CFG)
    (tmp_path / "mine.cfg").write_text(CFG)
    (tmp_path / "mine.weights").write_bytes(format_weights(spec, random_weights(spec, np.random.default_rng(0))))
    mine = DarknetParams(config_path=str(tmp_path), weights_path=str(tmp_path))
    model = network_settings("yolov2-tiny", mine, folders).yolo_model
    model = dataclasses.replace(
        model,
        config_file=dataclasses.replace(model.config_file, name="mine.cfg"),
        weight_file=dataclasses.replace(model.weight_file, name="mine.weights"),
    )
    found = choose_detector(dataclasses.replace(mine, yolo_model=model), folders)
    assert found.describe() == "mine was not measured on photographs"


def test_a_detector_without_its_module_is_a_sentence(folders, monkeypatch):
    monkeypatch.setitem(sys.modules, "rosbot_patrol.detection.hog", None)
    with pytest.raises(DetectorError, match=r"hog needs the module \S+\.hog, which is not installed"):
        choose_detector(DarknetParams(network="hog"), folders)


def test_a_second_opinion(folders, files, ssdlite, caplog):
    params = dataclasses.replace(AUTO, second_opinion="ssdlite")
    found = choose_detector(params, folders)
    assert (found.network, found.second, found.passed_over) == (REAL_CAMERA, "ssdlite", ())
    assert ssdlite == [(0.1, 2)]
    assert isinstance(found.detector, SecondOpinion)
    assert "finds 73 %" in found.describe()
    assert "; second opinion by ssdlite, which finds 61 %" in found.describe()


def test_without_the_second_network_the_first_goes_on(folders, files, no_ssdlite):
    found = choose_detector(dataclasses.replace(AUTO, second_opinion="ssdlite"), folders)
    assert (found.network, found.second) == (REAL_CAMERA, "")
    assert found.passed_over == ("no second opinion by ssdlite: its graph was not made",)
    tiny = choose_detector(dataclasses.replace(AUTO, second_opinion="yolov2-tiny"), folders)
    assert tiny.passed_over[0].startswith("no second opinion by yolov2-tiny: the network file ")


def test_a_second_opinion_of_the_same_network_is_none(folders, ssdlite):
    found = choose_detector(dataclasses.replace(AUTO, second_opinion="ssdlite"), folders)
    assert (found.network, found.second) == ("ssdlite", "")
    assert found.passed_over[1] == "no second opinion by ssdlite: it is the first network already"
    with pytest.raises(ParamError, match="second_opinion: is auto, expected the name of a network"):
        choose_detector(dataclasses.replace(AUTO, second_opinion="auto"), folders)
