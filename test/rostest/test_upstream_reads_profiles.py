"""Both profiles as upstream's C++ move_base would read them: plug-ins, sources, types and bounds of navigation 1.17.

link_workspace leaves our drop-in out where the real package is installed, and then it loads the same files.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("roslaunch", reason="ROS is not on the path: `. scripts/env` first")
from test_launch_files import parse

from rosbot_patrol.costmap.params import read_costmap

ROOT = Path(__file__).parents[2]
NUMBER, TEXT, FLAG, LIST = (int, float), (str,), (bool,), (list,)

# What ObstacleLayer::onInitialize asks of a source.
SOURCE: dict[str, tuple[type, ...]] = {
    "topic": TEXT,
    "sensor_frame": TEXT,
    "observation_persistence": NUMBER,
    "expected_update_rate": NUMBER,
    "data_type": TEXT,
    "min_obstacle_height": NUMBER,
    "max_obstacle_height": NUMBER,
    "inf_is_valid": FLAG,
    "clearing": FLAG,
    "marking": FLAG,
    "obstacle_range": NUMBER,
    "raytrace_range": NUMBER,
}
DATA_TYPES = ("PointCloud", "PointCloud2", "LaserScan")
OBSTACLES: dict[str, tuple[type, ...]] = {
    "enabled": FLAG,
    "observation_sources": TEXT,
    "track_unknown_space": FLAG,
    "transform_tolerance": NUMBER,
    "footprint_clearing_enabled": FLAG,
    "max_obstacle_height": NUMBER,
    "combination_method": NUMBER,
}
LAYERS: dict[str, dict[str, tuple[type, ...]]] = {
    "costmap_2d::StaticLayer": {
        "enabled": FLAG,
        "map_topic": TEXT,
        "first_map_only": FLAG,
        "subscribe_to_updates": FLAG,
        "track_unknown_space": FLAG,
        "use_maximum": FLAG,
        "lethal_cost_threshold": NUMBER,
        "unknown_cost_value": NUMBER,
        "trinary_costmap": FLAG,
    },
    "costmap_2d::ObstacleLayer": OBSTACLES,
    "costmap_2d::VoxelLayer": OBSTACLES
    | dict.fromkeys(("origin_z", "z_resolution", "z_voxels", "unknown_threshold", "mark_threshold"), NUMBER),
    "costmap_2d::InflationLayer": {
        "enabled": FLAG,
        "inflation_radius": NUMBER,
        "cost_scaling_factor": NUMBER,
        "inflate_unknown": FLAG,
    },
}
COSTMAP: dict[str, tuple[type, ...]] = {
    **dict.fromkeys(("global_frame", "robot_base_frame", "map_type", "map_topic"), TEXT),
    **dict.fromkeys(("rolling_window", "track_unknown_space", "always_send_full_costmap", "static_map"), FLAG),
    **dict.fromkeys(("transform_tolerance", "update_frequency", "publish_frequency", "width", "height"), NUMBER),
    **dict.fromkeys(("resolution", "origin_x", "origin_y", "robot_radius", "footprint_padding"), NUMBER),
    "footprint": (list, str),
    "plugins": LIST,
}
# Of a file without `plugins`: loadOldParameters moves these to layers.
OLD = {
    "subscribe_to_updates": FLAG,
    "observation_sources": TEXT,
    "obstacle_range": NUMBER,
    "raytrace_range": NUMBER,
    "inflation_radius": NUMBER,
    "cost_scaling_factor": NUMBER,
}
# Of the .cfg files: dynamic_reconfigure would change what lies outside.
BOUNDS = {
    "update_frequency": (0, 100),
    "publish_frequency": (0, 100),
    "transform_tolerance": (0, 10),
    "resolution": (0, 50),
    "width": (0, 1e9),
    "height": (0, 1e9),
    "robot_radius": (0, 10),
    "inflation_radius": (0, 50),
    "cost_scaling_factor": (0, 100),
    "max_obstacle_height": (0, 50),
    "z_voxels": (0, 16),
}
# Names of ours that upstream never asks for.
OURS = {
    "depth_sources", "forget_unseen_after", "forget_out_of_view_after", "forget_beside_after", "remember_standing",
}  # fmt: skip
PLANNERS = {"navfn/NavfnROS", "base_local_planner/TrajectoryPlannerROS"}


class UpstreamError(Exception):
    """Upstream's node would end here, or use another value than the file says."""


def check(value: Any, kinds: tuple[type, ...], name: str) -> None:
    """As roscpp's getParam: whole numbers and others stand for each other, nothing else does."""
    if not isinstance(value, kinds) or (isinstance(value, bool) and bool not in kinds):
        raise UpstreamError(f"{name}: {value!r} is no {kinds[-1].__name__}")
    low, high = BOUNDS.get(name.rsplit("/", 1)[-1], (-1e9, 1e9))
    if isinstance(value, (int, float)) and not low <= value <= high:
        raise UpstreamError(f"{name}: {value} is out of bounds")


def check_group(tree: dict[str, Any], known: dict[str, tuple[type, ...]], name: str, others: set[str]) -> None:
    for key, value in tree.items():
        if key in known:
            check(value, known[key], f"{name}/{key}")
        elif key not in others:
            raise UpstreamError(f"{name}/{key}: nobody reads it")


def check_sources(layer: dict[str, Any], place: dict[str, Any], name: str) -> None:
    for source in str(layer.get("observation_sources", "")).split():
        own = place.get(source, {})
        check_group(own, SOURCE, f"{name}/{source}", set())
        if own.get("data_type", "PointCloud") not in DATA_TYPES:
            raise UpstreamError("Only topics that use point clouds or laser scans are currently supported")


def read_as_upstream(tree: dict[str, Any], name: str) -> list[str]:
    """Types of a costmap's layers; raises UpstreamError."""
    if "plugins" not in tree:
        sources = set(str(tree.get("observation_sources", "")).split())
        check_group(tree, COSTMAP | OLD, name, sources)
        check_sources(tree, tree, name)
        return ["costmap_2d::ObstacleLayer", "costmap_2d::InflationLayer"]
    plugins = {str(each["name"]): str(each["type"]) for each in tree["plugins"]}
    check_group(tree, COSTMAP, name, set(plugins))
    for layer, kind in plugins.items():
        if kind not in LAYERS:
            raise UpstreamError(f"{name}/plugins: no class {kind}")
        own = tree.get(layer, {})
        cameras = str(own.get("depth_sources", "")).split()
        sources = str(own.get("observation_sources", "")).split()
        check_group(own, LAYERS[kind], f"{name}/{layer}", OURS | {*cameras, *sources})
        check_sources(own, own, f"{name}/{layer}")
    return list(plugins.values())


def move_base_tree(*arguments: str) -> dict[str, Any]:
    """The parameters that the launch file gives move_base, as nested groups."""
    root: dict[str, Any] = {}
    for name, given in parse(ROOT / "launch" / "move_base_only.launch", *arguments).params.items():
        at = root
        *groups, last = name.strip("/").split("/")
        for group in groups:
            at = at.setdefault(group, {})
        at[last] = given.value
    return dict(root["move_base"])


@pytest.mark.parametrize("simulation", ["true", "false"])
@pytest.mark.parametrize("profile", ["tutorial", "tuned"])
def test_upstreams_move_base_reads_the_profile(profile: str, simulation: str) -> None:
    tree = move_base_tree(f"profile:={profile}", f"simulation:={simulation}")
    for name in ("global_costmap", "local_costmap"):
        layers = read_as_upstream(tree[name], name)
        assert layers[-1] == "costmap_2d::InflationLayer"
        assert layers.count("costmap_2d::ObstacleLayer") == (2 if profile == "tuned" else 1)
    assert {tree.get("base_global_planner", "navfn/NavfnROS")} <= PLANNERS
    assert {tree.get("base_local_planner", "base_local_planner/TrajectoryPlannerROS")} <= PLANNERS
    for name, value in tree["TrajectoryPlannerROS"].items():
        check(value, FLAG if isinstance(value, bool) else NUMBER, f"TrajectoryPlannerROS/{name}")


@pytest.mark.parametrize("profile", ["tutorial", "tuned"])
def test_nothing_of_a_profile_is_clamped_or_deprecated(profile: str, caplog: pytest.LogCaptureFixture) -> None:
    tree = move_base_tree(f"profile:={profile}")
    caplog.clear()  # roslaunch's own lines
    for name in ("global_costmap", "local_costmap"):
        read_costmap(tree[name], name=f"/move_base/{name}/")
    assert not caplog.messages


def test_ours_sees_by_the_depth_camera() -> None:
    for name in ("global_costmap", "local_costmap"):
        low = next(each for each in read_costmap(move_base_tree()[name]).layers if each.name == "low_obstacle_layer")
        assert {key: source.data_type for key, source in low.sources.items()} == {"depth_camera": "DepthImage"}


def test_what_upstream_cannot_read_is_found() -> None:
    """The check itself: the tuned profile of before, and other mistakes."""
    good = move_base_tree()["local_costmap"]
    read_as_upstream(good, "local_costmap")
    low = good["low_obstacle_layer"]
    before = {"observation_sources": "depth_camera", "depth_camera": {**low["depth_camera"], "data_type": "DepthImage"}}
    scan = good["obstacle_layer"]["laser_scan_sensor"]
    for change, said in [
        ({"low_obstacle_layer": before}, "nobody reads it"),
        ({"plugins": [*good["plugins"], {"name": "k", "type": "rosbot_patrol/KeepoutLayer"}], "k": {}}, "no class"),
        ({"obstacle_layer": {**good["obstacle_layer"], "laser_scan_sensor": {**scan, "marking": 1}}}, "is no bool"),
        ({"inflation_layer": {"inflation_radius": 60.0}}, "out of bounds"),
        ({"resolution": "0.05"}, "is no float"),
    ]:
        with pytest.raises(UpstreamError, match=said):
            read_as_upstream({**good, **change}, "local_costmap")
