"""Table of upstream's plug-in names and the classes that implement them here."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from typing import Any

from rosbot_patrol.costmap.layered import LayeredCostmap
from rosbot_patrol.errors import ParamError
from rosbot_patrol.params import load
from rosbot_patrol.planning.global_planners.global_planner import GlobalPlannerParams, PotentialFieldPlanner
from rosbot_patrol.planning.global_planners.navfn import NavfnParams, NavfnPlanner
from rosbot_patrol.planning.interfaces import GlobalPlanner, LocalPlanner, Recovery
from rosbot_patrol.planning.local_planners.base import SamplingPlanner
from rosbot_patrol.planning.local_planners.dwa_params import RENAMED, DWAPlannerParams, with_new_names
from rosbot_patrol.planning.local_planners.dwa_planner import DWAPlanner
from rosbot_patrol.planning.local_planners.trajectory_params import TrajectoryPlannerParams
from rosbot_patrol.planning.local_planners.trajectory_planner import TrajectoryPlanner
from rosbot_patrol.planning.recoveries import (
    ClearCostmap,
    ClearCostmapParams,
    MoveSlowAndClear,
    MoveSlowParams,
    Rotate,
    RotateParams,
)
from rosbot_patrol.tunable import tunable

NAVFN, GLOBAL_PLANNER = "navfn/NavfnROS", "global_planner/GlobalPlanner"
GLOBAL_PLANNERS = (NAVFN, GLOBAL_PLANNER)
TRAJECTORY, DWA = "base_local_planner/TrajectoryPlannerROS", "dwa_local_planner/DWAPlannerROS"
CLEAR = "clear_costmap_recovery/ClearCostmapRecovery"
ROTATE = "rotate_recovery/RotateRecovery"
MOVE_SLOW = "move_slow_and_clear/MoveSlowAndClear"
LOCAL_PLANNERS = (TRAJECTORY, DWA)
RECOVERIES = (CLEAR, ROTATE, MOVE_SLOW)
# Parameters that a dynamic_reconfigure server offers, by plug-in; a change goes to the planner's `reconfigure`.
TUNABLE = {
    NAVFN: tunable(NavfnParams, NavfnPlanner.tunable),
    GLOBAL_PLANNER: tunable(GlobalPlannerParams, PotentialFieldPlanner.tunable),
    TRAJECTORY: tunable(TrajectoryPlannerParams, TrajectoryPlanner.tunable),
    DWA: tunable(DWAPlannerParams, DWAPlanner.tunable),
}

Tree = Mapping[str, Any]

log = logging.getLogger(__name__)


def short_name(plugin: str) -> str:
    """Namespace of a plug-in's parameters: "NavfnROS" for "navfn/NavfnROS"."""
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
    """Make the planner for a name such as navfn/NavfnROS, with parameters from move_base's namespace."""
    kind = _known(plugin, GLOBAL_PLANNERS, f"{name}base_global_planner")
    space = short_name(kind)
    values, where = _group(tree, space, name), f"{name}{space}/"
    if kind == NAVFN:
        return NavfnPlanner(load(NavfnParams, values, name=where))
    return PotentialFieldPlanner(load(GlobalPlannerParams, values, name=where))


def make_local_planner(
    plugin: str, tree: Tree, costmap: LayeredCostmap, *, controller_frequency: float, name: str = "~"
) -> SamplingPlanner[Any]:
    """Make the local planner for a name such as base_local_planner/TrajectoryPlannerROS, over a local costmap."""
    kind = _known(plugin, LOCAL_PLANNERS, f"{name}base_local_planner")
    space = short_name(kind)
    prefix = f"{name}{space}/"
    values = {"controller_frequency": controller_frequency, **_group(tree, space, name)}
    footprint, resolution = costmap.footprint, costmap.info.resolution
    if kind == DWA:
        values = with_new_names(values, RENAMED, prefix)
        return DWAPlanner(load(DWAPlannerParams, values, name=prefix), footprint, resolution=resolution)
    for old, new in _MISTAKEN:
        if values.pop(old, None) is not None:
            log.error("You are using %s where you should be using %s", old, new)
    values = with_new_names(values, _RENAMED, prefix)
    params = load(TrajectoryPlannerParams, values, name=prefix, ignore=("path_bias",))
    return TrajectoryPlanner(params, footprint, resolution=resolution)


_MISTAKEN = (("acc_limit_x", "acc_lim_x"), ("acc_limit_y", "acc_lim_y"), ("acc_limit_th", "acc_lim_theta"))
_RENAMED = {
    "acc_lim_th": "acc_lim_theta",
    "pdist_scale": "path_distance_bias",
    "gdist_scale": "goal_distance_bias",
    "min_in_place_rotational_vel": "min_in_place_vel_theta",
}


def make_recovery(
    plugin: str,
    label: str,
    values: Tree,
    *,
    name: str = "~",
    defaults: Tree | None = None,
    planner: LocalPlanner | None = None,
) -> Recovery:
    """Make the recovery behaviour for a plug-in name, called `label`, with its own parameters over `defaults`.

    `planner` is the local planner that MoveSlowAndClear slows down.
    """
    kind = _known(plugin, RECOVERIES, f"{name}recovery_behaviors")
    prefix = f"{name}{label}/"
    merged = {**(defaults or {}), **values}
    if kind == CLEAR:
        return ClearCostmap(load(ClearCostmapParams, merged, name=prefix), name=label)
    if kind == MOVE_SLOW:
        return MoveSlowAndClear(load(MoveSlowParams, merged, name=prefix), name=label, planner=planner)
    return Rotate(load(RotateParams, merged, name=prefix, ignore=("sim_time",)), name=label)


def make_recoveries(
    tree: Tree,
    *,
    conservative: float,
    clearing_radius: float,
    clearing_rotation: bool,
    name: str = "~",
    planner: LocalPlanner | None = None,
) -> list[Recovery]:
    """Make the behaviours that `recovery_behaviors` names, or upstream's four; `planner` as in `make_recovery`."""
    turn = _turning(tree, name)
    listed = tree.get("recovery_behaviors")
    if listed is not None:
        return [_listed(item, tree, turn, name, planner) for item in _as_list(listed, name)]
    found: list[tuple[str, str, Tree]] = [("conservative_reset", CLEAR, {"reset_distance": conservative})]
    if clearing_rotation:
        found.append(("rotate_recovery", ROTATE, turn))
    found.append(("aggressive_reset", CLEAR, {"reset_distance": clearing_radius * 4.0}))
    if clearing_rotation:
        found.append(("rotate_recovery", ROTATE, turn))
    return [make_recovery(k, n, _group(tree, n, name), name=name, defaults=d) for n, k, d in found]


def _turning(tree: Tree, name: str) -> dict[str, Any]:
    """The local planner's turning limits under RotateRecovery's names, from the first of several names that is given.

    Upstream reads them from TrajectoryPlannerROS whatever the local planner, and uses max_vel_theta even if there is a
    max_rotational_vel. Here DWAPlannerROS's own are read, and a speed for turning on the spot counts first.
    """
    is_dwa = short_name(str(tree.get("base_local_planner", ""))) == short_name(DWA)
    local = _group(tree, short_name(DWA if is_dwa else TRAJECTORY), name)
    slowest = "min_vel_theta" if is_dwa else "min_in_place_vel_theta"
    wanted = {
        "acc_lim_th": ("acc_lim_theta", "acc_lim_th"),
        "max_rotational_vel": ("max_rotational_vel", "max_vel_theta", "max_rot_vel"),
        "min_in_place_rotational_vel": (slowest, "min_in_place_rotational_vel", "min_rot_vel"),
        "yaw_goal_tolerance": ("yaw_goal_tolerance",),
    }
    return {key: local[own] for key, names in wanted.items() for own in names[::-1] if own in local}


def _as_list(value: Any, name: str) -> list[Any]:
    if not isinstance(value, (list, tuple)):
        raise ParamError(f"{name}recovery_behaviors", f"expected a list of {{name, type}}, got {value!r}")
    return list(value)


def _listed(item: Any, tree: Tree, turn: Tree, name: str, planner: LocalPlanner | None) -> Recovery:
    if not isinstance(item, Mapping) or not {"name", "type"} <= set(item):
        raise ParamError(f"{name}recovery_behaviors", f"expected {{name, type}}, got {item!r}")
    label, plugin = str(item["name"]), str(item["type"])
    defaults = turn if short_name(plugin) == "RotateRecovery" else {}
    return make_recovery(plugin, label, _group(tree, label, name), name=name, defaults=defaults, planner=planner)
