from pathlib import Path

import pytest
import yaml

from rosbot_patrol.detection.catalogue import CATALOGUE, REAL_CAMERA
from rosbot_patrol.detection.darknet.cfg import parse_cfg
from rosbot_patrol.detection.darknet.families import FAMILIES, Family, cfg_text
from rosbot_patrol.detection.darknet.weights import weights_size

PACKAGE = Path(__file__).parents[4] / "drop_in/darknet_ros"


@pytest.mark.parametrize("name", FAMILIES)
def test_shipped_files_are_made_here(name):
    """If not: scripts/make_network_files."""
    assert (PACKAGE / f"yolo_network_config/cfg/{name}.cfg").read_text() == cfg_text(FAMILIES[name])


@pytest.mark.parametrize("name", FAMILIES)
def test_the_authors_weights_have_just_the_size_that_the_network_needs(name):
    needed = weights_size(parse_cfg(cfg_text(FAMILIES[name])))
    older = name in ("yolov2", "yolov2-voc", "yolov2-tiny-voc")  # before version 0.2: 4 bytes fewer
    assert CATALOGUE[name].size == needed - 4 * older


@pytest.mark.parametrize("name", FAMILIES)
def test_yaml_and_cfg_go_together(name):
    model = yaml.safe_load((PACKAGE / f"config/{name}.yaml").read_text())["yolo_model"]
    assert model["config_file"]["name"] == f"{name}.cfg"
    assert model["weight_file"]["name"] == CATALOGUE[name].files[-1].file
    names = model["detection_classes"]["names"]
    assert len(names) == len(set(names)) == FAMILIES[name].classes
    assert "person" in names


def test_every_network_has_its_weights_in_the_catalogue():
    assert set(CATALOGUE) == set(FAMILIES) | {REAL_CAMERA}  # which brings its own cfg


def test_a_thinner_and_smaller_one_has_the_same_layers():
    whole, thin = (parse_cfg(cfg_text(FAMILIES["yolov4"], **change)) for change in ({}, {"size": 96, "thinner": 8}))
    assert [type(layer) for layer in thin.layers] == [type(layer) for layer in whole.layers]
    assert [head.out_shape for head in thin.heads] == [(255, 12, 12), (255, 6, 6), (255, 3, 3)]


def test_a_word_that_is_none():
    with pytest.raises(ValueError, match="'64x' is no word"):
        cfg_text(Family(layers="64x", size=32, classes=1, anchors="1,1"))
