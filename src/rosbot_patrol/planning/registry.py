"""Upstream's plug-in names and what stands behind them here."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rosbot_patrol.costmap.layered import LayeredCostmap
from rosbot_patrol.errors import ParamError
from rosbot_patrol.params import load
from rosbot_patrol.planning.interfaces import GlobalPlanner, LocalPlanner, Recovery
from rosbot_patrol.planning.navfn import NavfnParams, NavfnPlanner
from rosbot_patrol.planning.recoveries import ClearCostmap, ClearCostmapParams, Rotate, RotateParams
from rosbot_patrol.planning.trajectory_planner import TrajectoryPlanner
from rosbot_patrol.planning.trajectory_planner_params import TrajectoryPlannerParams

GLOBAL_PLANNERS = ("navfn/NavfnROS",)
LOCAL_PLANNERS = ("base_local_planner/TrajectoryPlannerROS",)
RECOVERIES = ("clear_costmap_recovery/ClearCostmapRecovery", "rotate_recovery/RotateRecovery")

Tree = Mapping[str, Any]


def short_name(plugin: str) -> str:
    """The namespace a plug-in reads its parameters from: "NavfnROS" of "navfn/NavfnROS"."""
    return plugin.replace("::", "/").rsplit("/", 1)[-1]


def _known(plugin: str, known: tuple[str, ...], name: str) -> str:
    for candidate in known:
        if plugin in (candidate, short_name(candidate)):
            return candidate
    raise ParamError(name, f"knows no plug-in '{plugin}', expected one of {', '.join(known)}")


def _group(tree: Tree, key: str, name: str) -> dict[str, Any]:
    group = tree.get(key, {})
    if not isinstance(group, Mapping):
        raise ParamError(name + key, f"expected a group of parameters, got {group!r}")
    return dict(group)


def make_global_planner(plugin: str, tree: Tree, *, name: str = "~") -> GlobalPlanner:
    """The planner of a name such as navfn/NavfnROS, with its parameters from move_base's namespace."""
    space = short_name(_known(plugin, GLOBAL_PLANNERS, f"{name}base_global_planner"))
    return NavfnPlanner(load(NavfnParams, _group(tree, space, name), name=f"{name}{space}/"))


def make_local_planner(
    plugin: str, tree: Tree, costmap: LayeredCostmap, *, controller_frequency: float, name: str = "~"
) -> LocalPlanner:
    """The local planner of a name such as base_local_planner/TrajectoryPlannerROS, over a local costmap."""
    space = short_name(_known(plugin, LOCAL_PLANNERS, f"{name}base_local_planner"))
    values = {"controller_frequency": controller_frequency, **_group(tree, space, name)}
    _old_names(values)
    params = load(TrajectoryPlannerParams, values, name=f"{name}{space}/", ignore=_IGNORED)
    return TrajectoryPlanner(
        params,
        costmap.footprint,
        resolution=costmap.info.resolution,
    )


_IGNORED = ("acc_lim_th", "acc_limit_x", "acc_limit_y", "acc_limit_th", "pdist_scale", "gdist_scale", "path_bias")


def _old_names(values: dict[str, Any]) -> None:
    for old, new in (
        ("acc_lim_th", "acc_lim_theta"),
        ("pdist_scale", "path_distance_bias"),
        ("gdist_scale", "goal_distance_bias"),
    ):
        if old in values:
            values.setdefault(new, values[old])


def make_recovery(plugin: str, label: str, values: Tree, *, name: str = "~", defaults: Tree | None = None) -> Recovery:
    """The recovery behaviour of a plug-in name, called `label`, with its own parameters over `defaults`."""
    kind = _known(plugin, RECOVERIES, f"{name}recovery_behaviors")
    merged = {**(defaults or {}), **values}
    if kind == RECOVERIES[0]:
        ignore = ("layer_names", "invert_area_to_clear")
        return ClearCostmap(load(ClearCostmapParams, merged, name=f"{name}{label}/", ignore=ignore), name=label)
    return Rotate(load(RotateParams, merged, name=f"{name}{label}/", ignore=("sim_time",)), name=label)


def make_recoveries(
    tree: Tree, *, conservative: float, clearing_radius: float, clearing_rotation: bool, name: str = "~"
) -> list[Recovery]:
    """The behaviours that `recovery_behaviors` names, or upstream's four."""
    local = _group(tree, "TrajectoryPlannerROS", name)
    turn = {
        new: local[old]
        for old, new in (
            ("acc_lim_theta", "acc_lim_th"),
            ("max_rotational_vel", "max_rotational_vel"),
            ("min_in_place_vel_theta", "min_in_place_rotational_vel"),
        )
        if old in local
    }
    listed = tree.get("recovery_behaviors")
    if listed is not None:
        return [_listed(item, tree, turn, name) for item in _as_list(listed, name)]
    clear, rotate = RECOVERIES
    found = [("conservative_reset", clear, {"reset_distance": conservative})]
    if clearing_rotation:
        found.append(("rotate_recovery", rotate, turn))
    found.append(("aggressive_reset", clear, {"reset_distance": clearing_radius * 4.0}))
    if clearing_rotation:
        found.append(("rotate_recovery", rotate, turn))
    return [make_recovery(k, n, _group(tree, n, name), name=name, defaults=d) for n, k, d in found]


def _as_list(value: Any, name: str) -> list[Any]:
    if not isinstance(value, (list, tuple)):
        raise ParamError(f"{name}recovery_behaviors", f"expected a list of {{name, type}}, got {value!r}")
    return list(value)


def _listed(item: Any, tree: Tree, turn: Tree, name: str) -> Recovery:
    if not isinstance(item, Mapping) or not {"name", "type"} <= set(item):
        raise ParamError(f"{name}recovery_behaviors", f"expected {{name, type}}, got {item!r}")
    label, plugin = str(item["name"]), str(item["type"])
    defaults = turn if short_name(plugin) == "RotateRecovery" else {}
    return make_recovery(plugin, label, _group(tree, label, name), name=name, defaults=defaults)
