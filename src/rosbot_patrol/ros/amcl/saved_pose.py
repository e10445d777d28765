"""The pose that amcl saves to its parameters `initial_*`, with its time and odometry.

As in upstream, a restarted node continues from there. But a master may outlive a simulation: in the next one the robot
starts at its start again, with a clock that begins anew. So the time is saved too. If the first scan is older, the
saved pose belongs to another run, and the defaults replace it. The odometry is saved too, to know the robot's motion
since then.
"""

from __future__ import annotations

import logging
import math
from dataclasses import fields, replace
from typing import Any

import rospy

from rosbot_patrol.amcl.parameters import AmclParams
from rosbot_patrol.geometry import Pose2D

log = logging.getLogger(__name__)

NAMES = tuple(f"initial_{key}" for key in ("pose_x", "pose_y", "pose_a", "cov_xx", "cov_yy", "cov_aa"))
SAVED = "~saved_pose"
ODOMETRY = ("odom_x", "odom_y", "odom_a")
SLACK_S = 1.0
FAR_M = 3.0  # the robot stops without amcl, so odometry farther off must have restarted


class SavedPose:
    """The pose that a previous node saved, and the saving of this node's pose."""

    def __init__(self) -> None:
        self._before = self._found = _read(rospy.get_param(SAVED, None))
        self._last: tuple[float, ...] = ()

    def own(self, params: AmclParams, stamp: float) -> AmclParams | None:
        """Initial pose without values saved in another run, None if nothing is to be changed.

        A value that a launch file has set since then is not the saved one, and stays.

        Args:
            params: as read at the start.
            stamp: stamp of the first scan [s].
        """
        before, self._before = self._before, {}
        if stamp >= before.get("stamp", -math.inf) - SLACK_S:
            return None
        saved = {name for name in NAMES if getattr(params, name) == before.get(name)}
        if not saved:
            return None
        log.warning(
            "the saved pose %.2f %.2f %.2f is of another run (saved at %.1f s, it is %.1f s now): starting without it",
            *(getattr(params, name) for name in NAMES[:3]),
            before["stamp"],
            stamp,
        )
        defaults: dict[str, Any] = {f.name: f.default for f in fields(params) if f.name in saved}
        return replace(params, **defaults)

    def odometry(self, params: AmclParams, now: Pose2D) -> Pose2D | None:
        """odom_from_base at the saved pose, None if it is unknown or the pose was set since then.

        Args:
            params: as read at the start; a pose in them other than the saved one has no odometry.
            now: odom_from_base at the first scan.
        """
        found = self._found
        if not found or any(getattr(params, name) != found[name] for name in NAMES):
            return None
        then = Pose2D(*(found[name] for name in ODOMETRY))
        return then if math.dist(then[:2], now[:2]) < FAR_M else None

    def save(self, values: tuple[float, ...], stamp: float, odometry: Pose2D) -> None:
        """Set the parameters `NAMES`; raises the errors of rospy.set_param."""
        if values == self._last:
            return
        pose = dict(zip(NAMES, values, strict=True))
        for name, value in pose.items():
            rospy.set_param(f"~{name}", value)
        rospy.set_param(SAVED, {**pose, **dict(zip(ODOMETRY, odometry, strict=True)), "stamp": stamp})
        self._last = values


def _read(tree: object) -> dict[str, float]:
    if tree is None or tree == {}:  # `rosparam delete` of each value leaves an empty namespace
        return {}
    wanted = (*NAMES, *ODOMETRY, "stamp")
    if isinstance(tree, dict) and all(isinstance(tree.get(name), int | float) for name in wanted):
        return {name: float(tree[name]) for name in wanted}
    log.warning("%s is not as amcl writes it, it is left out", rospy.resolve_name(SAVED))
    return {}
