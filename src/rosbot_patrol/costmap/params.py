"""Parameters of costmaps and layers: upstream's names and defaults, and the pre-hydro form (no `plugins`)."""

from __future__ import annotations

import logging
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from rosbot_patrol.costmap.sensor_params import DEPTH_IMAGE, DepthSourceParams, RangeSensorParams, SourceParams
from rosbot_patrol.errors import ParamError
from rosbot_patrol.params import load, param

log = logging.getLogger(__name__)


@dataclass(frozen=True, kw_only=True)
class CostmapParams:
    """Parameters of a costmap_2d costmap."""

    global_frame: str = param("map", doc="frame of the costmap")
    robot_base_frame: str = param("base_link", doc="frame of the robot")
    transform_tolerance: float = param(
        0.3, unit="s", lo=0.0, hi=10.0, clamps="both", doc="maximum age of the robot's pose"
    )
    update_frequency: float = param(5.0, unit="Hz", lo=0.0, hi=100.0, clamps="both", doc="rate of updates")
    publish_frequency: float = param(
        0.0, unit="Hz", lo=0.0, hi=100.0, clamps="both", doc="rate of publishing; 0: never"
    )
    width: float = param(10.0, unit="m", lo=0.0, clamps="both", doc="extent in x, unless a map gives it")
    height: float = param(10.0, unit="m", lo=0.0, clamps="both", doc="extent in y, unless a map gives it")
    resolution: float = param(0.05, unit="m", lo=0.001, hi=50.0, clamps="above", doc="edge of a cell")
    origin_x: float = param(0.0, unit="m", doc="left edge; ignored with rolling_window")
    origin_y: float = param(0.0, unit="m", doc="lower edge; ignored with rolling_window")
    rolling_window: bool = param(False, doc="keep the robot in the middle")
    track_unknown_space: bool = param(False, doc="distinguish unknown cells from free ones")
    always_send_full_costmap: bool = param(False, doc="publish whole grids instead of updates")
    footprint: Any = param("[]", doc="corners of the robot [[x, y], ...]")
    robot_radius: float = param(
        0.46, unit="m", lo=0.0, hi=10.0, clamps="both", doc="radius of the robot, if no footprint is given"
    )
    footprint_padding: float = param(0.01, unit="m", doc="margin added to each corner")


@dataclass(frozen=True, kw_only=True)
class StaticParams:
    """Parameters of costmap_2d::StaticLayer."""

    enabled: bool = param(True, doc="use the layer")
    map_topic: str = param("map", doc="topic of the map (nav_msgs/OccupancyGrid)")
    first_map_only: bool = param(False, doc="ignore later maps")
    subscribe_to_updates: bool = param(False, doc="use <map_topic>_updates")
    track_unknown_space: bool = param(True, doc="distinguish unknown cells from free ones")
    use_maximum: bool = param(False, doc="combine by maximum instead of overwriting")
    lethal_cost_threshold: int = param(100, lo=0, hi=100, clamps="both", doc="lowest occupancy of a lethal cell")
    unknown_cost_value: int = param(-1, lo=-128, hi=255, doc="occupancy that means unknown")
    trinary_costmap: bool = param(
        True, doc="only free, lethal and unknown cells; false: intermediate values become costs"
    )


@dataclass(frozen=True, kw_only=True)
class ObstacleParams:
    """Parameters of costmap_2d::ObstacleLayer."""

    enabled: bool = param(True, doc="use the layer")
    track_unknown_space: bool = param(
        False, doc="distinguish unknown cells from free ones; default: the costmap's setting"
    )
    footprint_clearing_enabled: bool = param(True, doc="cells under the robot are free")
    combination_method: int = param(
        1, doc="0: overwrite, 1: maximum, any other: leave the costmap as it is (upstream: 99)"
    )
    max_obstacle_height: float = param(
        2.0, unit="m", lo=0.0, hi=50.0, clamps="both", doc="maximum height of points that mark; higher ones only clear"
    )
    transform_tolerance: float = param(0.2, unit="s", lo=0.0, doc="accepted, has no effect")
    observation_sources: str = param("", doc="names of the sources, separated by spaces")
    depth_sources: str = param(
        "", doc="ours: names of depth cameras, separated by spaces; a key that upstream does not read"
    )
    forget_unseen_after: float = param(
        0.0,
        unit="s",
        lo=0.0,
        doc="ours: time after which a mark goes if beams passed its place and none hit it; 0: never",
    )
    forget_out_of_view_after: float = param(
        0.0, unit="s", lo=0.0, doc="ours: time after which a mark goes that was neither hit nor in view; 0: never"
    )
    forget_beside_after: float = param(
        0.0,
        unit="s",
        lo=0.0,
        doc="ours: the same within 0.6 m of the robot's centre, where it cannot look again; 0: as elsewhere",
    )
    remember_standing: float = param(
        0.0,
        lo=0.0,
        hi=100.0,
        doc="ours: a mark is kept out of view for this many times as long as it was seen, 10 minutes at most",
    )


@dataclass(frozen=True, kw_only=True)
class VoxelParams(ObstacleParams):
    """Parameters of costmap_2d::VoxelLayer; with planar scans it is an obstacle layer."""

    origin_z: float = param(0.0, unit="m", lo=0.0, clamps="both", doc="height of the lowest voxel")
    z_resolution: float = param(0.2, unit="m", lo=0.0, hi=50.0, clamps="both", doc="height of a voxel")
    z_voxels: int = param(10, lo=0, hi=16, clamps="both", doc="voxels in a column; points above the column are ignored")
    unknown_threshold: int = param(
        15, lo=0, hi=16, clamps="both", doc="accepted, has no effect: cells that beams passed are free"
    )
    mark_threshold: int = param(
        0, lo=0, hi=16, clamps="both", doc="number of voxels above which a cell is marked; a planar scan has one"
    )
    publish_voxel_map: bool = param(False, doc="accepted, has no effect: there are no voxels to show")


@dataclass(frozen=True, kw_only=True)
class KeepoutParams(StaticParams):
    """Parameters of rosbot_patrol/KeepoutLayer (ours)."""

    map_topic: str = param("keepout_mask", doc="topic of the mask (nav_msgs/OccupancyGrid), if there is no mask_file")
    mask_file: str = param("", doc="map_server yaml of the mask")
    mask_frame: str = param("map", doc="frame of mask_file")
    subscribe_to_updates: bool = param(False, doc="use <map_topic>_updates")
    trinary_costmap: bool = param(True, doc="false: intermediate values become costs")


@dataclass(frozen=True, kw_only=True)
class InflationParams:
    """Parameters of costmap_2d::InflationLayer."""

    enabled: bool = param(True, doc="use the layer")
    inflation_radius: float = param(
        0.55, unit="m", lo=0.0, hi=50.0, clamps="both", doc="distance from obstacles up to which costs are raised"
    )
    cost_scaling_factor: float = param(
        10.0, unit="1/m", lo=0.0, hi=100.0, clamps="both", doc="rate at which costs fall with the distance"
    )
    inflate_unknown: bool = param(False, doc="give unknown cells all costs; false: only inscribed and lethal ones")


@dataclass(frozen=True)
class LayerConfig:
    """One configured layer: name, upstream's type without its package, parameters, and observation sources."""

    name: str
    type: str
    params: StaticParams | ObstacleParams | InflationParams | RangeSensorParams  # and what is derived of them
    sources: dict[str, SourceParams]


@dataclass(frozen=True)
class CostmapConfig:
    """A costmap's parameters and its layers in order."""

    params: CostmapParams
    layers: list[LayerConfig]
    name: str = "costmap"


LAYER_TYPES: dict[str, type] = {
    "StaticLayer": StaticParams,
    "ObstacleLayer": ObstacleParams,
    "VoxelLayer": VoxelParams,
    "InflationLayer": InflationParams,
    "KeepoutLayer": KeepoutParams,
    "RangeSensorLayer": RangeSensorParams,
}

_SOURCES = ("observation_sources", "depth_sources")
_RANGES = ("obstacle_range", "raytrace_range")
_HEIGHTS = ("max_obstacle_height", "min_obstacle_height")
_VOXEL = ("origin_z", "z_resolution", "z_voxels", "unknown_threshold", "mark_threshold", "publish_voxel_map")
# What a layer of each type takes from the costmap's own namespace, over its own (upstream's copyParentParameters).
_FROM_COSTMAP: dict[str, tuple[str, ...]] = {
    "StaticLayer": ("map_topic", "unknown_cost_value", "lethal_cost_threshold", "track_unknown_space"),
    "ObstacleLayer": ("max_obstacle_height", *_RANGES, "track_unknown_space"),
    "VoxelLayer": _VOXEL,
    "InflationLayer": ("cost_scaling_factor", "inflation_radius"),
    "KeepoutLayer": (),
    "RangeSensorLayer": (),
}
# And what pre-hydro files have there besides (the last two of the map are ours: upstream drops them).
_LEGACY: dict[str, tuple[str, ...]] = {
    "static_layer": (*_FROM_COSTMAP["StaticLayer"], "subscribe_to_updates", "first_map_only"),
    "obstacle_layer": (*_FROM_COSTMAP["ObstacleLayer"], *_VOXEL, "min_obstacle_height", *_SOURCES),
    "inflation_layer": _FROM_COSTMAP["InflationLayer"],
}


def read_costmap(tree: Mapping[str, Any], *, name: str = "~costmap/") -> CostmapConfig:
    """Read a costmap's namespace into one checked configuration.

    Without `plugins`, pre-hydro names are translated as in upstream's loadOldParameters. With `plugins`, layers inherit
    some parameters from the costmap's namespace as in its copyParentParameters.

    Raises:
        ParamError: a value is wrong, or a plug-in's type is not known.
    """
    if not isinstance(tree, Mapping):
        raise ParamError(name, f"expected a group of parameters, got {tree!r}")
    legacy = "plugins" not in tree
    if legacy:
        tree = translate_legacy(tree)
    plugins = _plugins(tree["plugins"], name + "plugins")
    sources = [s for p in plugins for s in _source_names(_sub(tree, p[0], name))]
    taken = [key for plugin in plugins for key in _FROM_COSTMAP[plugin[1]]]
    ignore = ["plugins", "static_map", "map_type", *[p[0] for p in plugins], *sources, *taken, *_RANGES, *_HEIGHTS]
    if legacy:
        ignore += [key for keys in _LEGACY.values() for key in keys]
    params = load(CostmapParams, tree, name=name, ignore=ignore)
    layers = [_read_layer(tree, plugin, params, name) for plugin in plugins]
    return CostmapConfig(params, layers, name.strip("~/"))


def translate_legacy(tree: Mapping[str, Any]) -> dict[str, Any]:
    """Translate pre-hydro parameters to plug-ins: static_layer if `static_map`, obstacle_layer, inflation_layer."""
    out = dict(tree)
    plugins = [{"name": "obstacle_layer", "type": "costmap_2d::ObstacleLayer"}]
    if tree.get("map_type") == "voxel":
        plugins[0]["type"] = "costmap_2d::VoxelLayer"
    if tree.get("static_map", False):
        plugins.insert(0, {"name": "static_layer", "type": "costmap_2d::StaticLayer"})
    plugins.append({"name": "inflation_layer", "type": "costmap_2d::InflationLayer"})
    for layer, keys in _LEGACY.items():
        if all(plugin["name"] != layer for plugin in plugins):
            continue
        moved = {key: tree[key] for key in keys if key in tree}
        if layer == "obstacle_layer":
            moved.update({source: tree[source] for source in _source_names(tree) if source in tree})
        given = tree.get(layer, {})
        out[layer] = {**given, **moved} if isinstance(given, Mapping) else given
    out["plugins"] = plugins
    return out


def _plugins(value: Any, name: str) -> list[tuple[str, str]]:
    if not isinstance(value, (list, tuple)):
        raise ParamError(name, f"expected a list of {{name, type}}, got {value!r}")
    found = []
    for item in value:
        if not isinstance(item, Mapping) or not {"name", "type"} <= set(item):
            raise ParamError(name, f"expected {{name, type}}, got {item!r}")
        kind = re.split("::|/", str(item["type"]))[-1]
        if kind not in LAYER_TYPES:
            raise ParamError(name, f"knows no layer '{item['type']}', expected one of {', '.join(LAYER_TYPES)}")
        found.append((str(item["name"]), kind))
    return found


def _sub(tree: Mapping[str, Any], key: str, name: str) -> Mapping[str, Any]:
    sub = tree.get(key, {})
    if not isinstance(sub, Mapping):
        raise ParamError(name + key, f"expected a group of parameters, got {sub!r}")
    return sub


def _read_layer(tree: Mapping[str, Any], plugin: tuple[str, str], params: CostmapParams, name: str) -> LayerConfig:
    layer, kind = plugin
    own = dict(_sub(tree, layer, name))
    own.update({key: tree[key] for key in _FROM_COSTMAP[kind] if key in tree})
    prefix = f"{name}{layer}/"
    sources: dict[str, SourceParams] = {}
    if kind in ("ObstacleLayer", "VoxelLayer"):
        own.setdefault("track_unknown_space", params.track_unknown_space)
        for source in _source_names(own):
            sources[source] = _read_source(tree, own, source, prefix)
    ignore = [*sources, *_RANGES, *_HEIGHTS, *_VOXEL]
    return LayerConfig(layer, kind, load(LAYER_TYPES[kind], own, name=prefix, ignore=ignore), sources)


def _read_source(tree: Mapping[str, Any], layer: Mapping[str, Any], source: str, prefix: str) -> SourceParams:
    """Read a source; ranges and heights are looked up in the source, the layer and the costmap (searchParam)."""
    inherited: dict[str, Any] = {}
    for scope in (tree, layer):
        inherited.update({key: scope[key] for key in _RANGES if key in scope})
    own = _sub(layer, source, prefix)
    values = {**inherited, **own, "topic": own.get("topic") or source}
    name = f"{prefix}{source}/"
    if source in str(layer.get("depth_sources", "")).split():
        return load(DepthSourceParams, values, name=name)
    if own.get("data_type") != DEPTH_IMAGE:
        return load(SourceParams, values, name=name)
    log.warning(
        "%sdata_type: move %s from observation_sources to depth_sources: upstream's node ends here", name, source
    )
    return load(DepthSourceParams, values, name=name)


def _source_names(layer: Mapping[str, Any]) -> list[str]:
    return [source for key in _SOURCES for source in str(layer.get(key, "")).split()]
