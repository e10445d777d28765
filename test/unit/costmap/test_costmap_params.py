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
