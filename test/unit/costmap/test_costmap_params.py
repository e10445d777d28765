"""Parameters of costmaps, in both forms, and the files that we ship."""

from __future__ import annotations

import logging
from pathlib import Path

import numpy as np
import pytest
import yaml

from rosbot_patrol.costmap.footprint import Footprint, read_footprint
from rosbot_patrol.costmap.layered import LayeredCostmap
from rosbot_patrol.costmap.params import read_costmap
from rosbot_patrol.costmap.sensor_params import DepthSourceParams, SourceParams
from rosbot_patrol.errors import ParamError

ROOT = Path(__file__).resolve().parents[3]
TUNED, TUTORIAL = ROOT / "config" / "tuned", ROOT / "drop_in" / "tutorial_pkg" / "config"


def load_pair(folder, which, override=None):
    def read(path):
        return yaml.safe_load(path.read_text())

    return {**read(folder / "costmap_common_params.yaml"), **read(override or folder / f"{which}_params.yaml")[which]}


def test_the_pre_hydro_form_becomes_layers():
    config = read_costmap({"static_map": True, "obstacle_range": 6.0, "inflation_radius": 2.5, "map_topic": "/m"})
    assert [layer.type for layer in config.layers] == ["StaticLayer", "ObstacleLayer", "InflationLayer"]
    assert config.layers[0].params.map_topic == "/m"
    assert config.layers[2].params.inflation_radius == 2.5


@pytest.mark.parametrize("which", ["global_costmap", "local_costmap"])
@pytest.mark.parametrize("folder", [TUNED, TUTORIAL])
def test_our_files_load_without_a_warning(folder, which, caplog):
    with caplog.at_level(logging.WARNING):
        costmap = LayeredCostmap(read_costmap(load_pair(folder, which)))
    assert not caplog.records
    assert len(costmap.obstacle_layers[0].buffers) == 1


def test_the_tutorials_simulation_has_twelve_million_cells():
    tree = load_pair(TUTORIAL, "global_costmap", ROOT / "config" / "global_costmap_params.yaml")
    config = read_costmap(tree)
    assert (config.params.width / config.params.resolution) ** 2 == pytest.approx(12.25e6)
    assert [layer.name for layer in config.layers] == ["obstacle_layer", "inflation_layer"]
    source = config.layers[0].sources["laser_scan_sensor"]
    assert (source.obstacle_range, source.raytrace_range) == (6.0, 8.5)


@pytest.mark.parametrize(
    ("tree", "part"),
    [
        ({"plugins": 3}, "plugins"),
        ({"plugins": [{"name": "a"}]}, "plugins"),
        ({"plugins": [{"name": "a", "type": "x::Lava"}]}, "Lava"),
        ({"resolution": "fine"}, "resolution"),
        ({"resolution": 0.0}, "resolution"),
        ({"plugins": [{"name": "i", "type": "InflationLayer"}], "i": 3}, "i"),
        (
            {"plugins": [{"name": "i", "type": "InflationLayer"}], "i": {"inflation_radius": "big"}},
            "i/inflation_radius",
        ),
    ],
)
def test_a_wrong_value_is_named(tree, part):
    with pytest.raises(ParamError, match=part):
        read_costmap(tree, name="~global_costmap/")


@pytest.mark.parametrize("value", ["[[0,0]", [[1, 2], [3]], "none", [[0, 0], [1, 1]], 7, [["a", 1], [2, 3], [3, 4]]])
def test_a_footprint_that_is_none_is_named(value):
    with pytest.raises(ParamError, match="footprint"):
        read_footprint(value)


def test_footprint_radii_include_the_padding():
    footprint = Footprint.of(
        "[[0.12, 0.14], [0.12, -0.14], [-0.12, -0.14], [-0.12, 0.14]]", robot_radius=1, padding=0.01
    )
    assert footprint.inscribed_radius == pytest.approx(0.13)
    assert footprint.circumscribed_radius == pytest.approx(np.hypot(0.13, 0.15))
    assert (np.hypot(*np.diff(footprint.outline(0.01), axis=0).T) <= 0.0101).all()


def test_without_a_footprint_the_robot_is_round():
    assert Footprint.of("[]", robot_radius=0.3, padding=0.0).circumscribed_radius == pytest.approx(0.3)


def low_layer(**values):
    tree = {"plugins": [{"name": "low", "type": "costmap_2d::ObstacleLayer"}], "low": values}
    (found,) = read_costmap(tree, name="/move_base/local_costmap/").layers
    return found


def test_depth_cameras_have_a_place_of_their_own(caplog):
    found = low_layer(
        depth_sources="a b", observation_sources="scan", a={"topic": "depth"}, scan={"data_type": "LaserScan"}
    )
    assert {name: type(source) for name, source in found.sources.items()} == {
        "scan": SourceParams,
        "a": DepthSourceParams,
        "b": DepthSourceParams,
    }
    assert (found.sources["a"].topic, found.sources["b"].topic, found.sources["a"].data_type) == (
        "depth",
        "b",
        "DepthImage",
    )
    assert not caplog.messages


def test_the_old_place_of_a_depth_camera_still_works_and_warns(caplog):
    found = low_layer(observation_sources="camera", camera={"data_type": "DepthImage", "floor_height": -0.04})
    assert found.sources["camera"] == DepthSourceParams(topic="camera", floor_height=-0.04)
    (said,) = caplog.messages
    assert (
        "/move_base/local_costmap/low/camera/data_type: move camera from observation_sources to depth_sources" in said
    )


def test_a_depth_camera_of_another_data_type_is_an_error():
    with pytest.raises(ParamError, match=r"low/camera/data_type: is 'LaserScan', expected one of DepthImage"):
        low_layer(depth_sources="camera", camera={"data_type": "LaserScan"})


def test_depth_cameras_of_a_file_without_plugins():
    tree = {"observation_sources": "scan", "scan": {"data_type": "LaserScan"}, "depth_sources": "camera", "camera": {}}
    layers = {layer.name: layer for layer in read_costmap(tree).layers}
    assert set(layers["obstacle_layer"].sources) == {"scan", "camera"}
