"""A costmap that is fed from a bag, as `ros/move_base_costmap` feeds it: scans wait until tf can place them."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from typing import Any

from rosbot_patrol.costmap.layered import LayeredCostmap
from rosbot_patrol.costmap.layers.obstacle import ObservationBuffer, ObstacleLayer, height_problem, observe_level
from rosbot_patrol.costmap.params import read_costmap
from rosbot_patrol.errors import LaserTilted, TransformError
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.grid import Grid
from rosbot_patrol.scan import LaserScan, level_scan
from rosbot_patrol.scan_check import ScanCheck
from rosbot_patrol.tf.tree import TransformTree

KEPT = 5  # scans that wait for tf
PATIENCE = 1.0  # where the parameters set no limit, scans that say nothing stop the robot after so long [s]


class BagCostmap:
    """One of move_base's two costmaps.

    Args:
        tree: its parameters.
        name: "global_costmap" or "local_costmap".
        transforms: tf.

    Raises:
        ParamError: a parameter makes no sense.
    """

    def __init__(self, tree: Mapping[str, Any], name: str, transforms: TransformTree) -> None:
        config = read_costmap(dict(tree), name=f"{name}/")
        self.costmap = LayeredCostmap(config)
        self.params = config.params
        self.frame = self.params.global_frame.lstrip("/")
        self.base = self.params.robot_base_frame.lstrip("/")
        self.problem = "it has not been updated yet"
        self.last = Grid(self.costmap.info, self.costmap.cells.copy())
        self._transforms = transforms
        self._scans: deque[LaserScan] = deque(maxlen=KEPT)
        self._next = 0.0
        self._check = ScanCheck(f"the {name} sees nothing by it")

    def _buffers(self) -> list[tuple[ObstacleLayer, ObservationBuffer]]:
        """Those of its layers that take scans."""
        layers = self.costmap.obstacle_layers
        return [
            (layer, buffer)
            for layer in layers
            for buffer in layer.buffers.values()
            if buffer.params.data_type == "LaserScan"
        ]

    def hear_map(self, grid: Grid) -> None:
        """Give a map to its static layers; raises MapError."""
        for layer in self.costmap.static_layers:
            layer.set_map(grid)

    def hear_scan(self, scan: LaserScan, now: float) -> None:
        """Keep a scan until the next update; one that says nothing is left out."""
        if self._check.accepts(scan, now):
            self._scans.append(scan)

    def robot_pose(self, now: float) -> Pose2D:
        """The robot in this costmap's frame; raises TransformError where it is not known or too old."""
        found, stamp = self._transforms.newest(self.frame, self.base)
        if 0.0 < self.params.transform_tolerance < now - stamp:
            raise TransformError(self.frame, self.base, f"the newest is {now - stamp:.2f} s old")
        return found.pose

    def update_when_due(self, now: float) -> None:
        """Update, as often as the parameters say."""
        if self.params.update_frequency == 0.0 or now < self._next - 1e-6:
            return
        self._next = now + 1.0 / self.params.update_frequency
        try:
            pose = self.robot_pose(now)
        except TransformError as err:
            self.problem = str(err)
            return
        self._place_scans(now)
        self.costmap.update(now, pose)
        self.last = Grid(self.costmap.info, self.costmap.cells.copy())
        self.problem = ""

    def is_current(self, now: float) -> bool:
        """Whether what drives by this costmap can trust it."""
        limits = [buffer.params.expected_update_rate for _, buffer in self._buffers()]
        is_blind = self._check.lasts(now, max(limits, default=0.0) or PATIENCE)
        return not self.problem and not is_blind and self.costmap.is_current(now)

    def _place_scans(self, now: float) -> None:
        waiting, self._scans = list(self._scans), deque(maxlen=KEPT)
        for scan in waiting:
            try:
                level = level_scan(scan, self._transforms.transform(self.frame, scan.frame_id, scan.stamp), self.frame)
            except LaserTilted as err:
                self._check.refuse(str(err), now)
                continue
            except TransformError:
                if waiting[-1].stamp - scan.stamp <= 1.0:
                    self._scans.append(scan)
                continue
            for layer, buffer in self._buffers():
                problem = height_problem(level, buffer.params)
                if problem:
                    self._check.refuse(problem, now)
                    continue
                self._check.clear(now)
                buffer.add(observe_level(level, buffer.params, layer.params.max_obstacle_height))
