"""Costmap with its inputs, without ROS: what a node does with its map, its sensors and the robot's pose.

move_base, its replay over a bag and the closed loop all run it.
"""

from __future__ import annotations

import enum
import logging
import threading
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.costmap.bounds import Bounds
from rosbot_patrol.costmap.inputs import Input, ScanInput, make_inputs
from rosbot_patrol.costmap.layered import LayeredCostmap
from rosbot_patrol.costmap.layers.keepout import KeepoutLayer
from rosbot_patrol.costmap.layers.static import StaticLayer
from rosbot_patrol.costmap.layers.zones import ZonesLayer
from rosbot_patrol.costmap.params import CostmapConfig, CostmapParams
from rosbot_patrol.errors import ParamError, TransformError
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.grid import Grid
from rosbot_patrol.maps.map_io import read_map
from rosbot_patrol.maps.zones import read_zones
from rosbot_patrol.tf.frames import Frames

log = logging.getLogger(__name__)

_ZONES_FRAME = "map"


class Fault(enum.Enum):
    """Kind of a costmap's fault."""

    NEW = "has not been updated yet"
    RESIZED = "has another size and has not been updated yet"
    NO_POSE = "does not know where the robot is"
    NO_MAP_POSE = "does not know where its map lies"


class FedCostmap:
    """A LayeredCostmap with the inputs of its layers. Times [s] are of one clock.

    The `hear` methods and the inputs may be called from other threads than `update`. Code that reads or changes
    `costmap` itself must hold `lock`.

    Args:
        config: parameters and layers.
        frames: transforms.
        name: "global_costmap" or "local_costmap".
        now: time at the start.
        keeps_last: copy each update to `last`, for costmaps that are read in each control cycle.
        zones: file of the owner's keep-out zones, which may be missing and may change; None: none.

    Raises:
        MapError: the mask file of a keep-out layer cannot be used.

    Attributes:
        costmap: the layers and their costs.
        inputs: sensor inputs of the layers.
        last: costs after the last update; nobody changes it.
        fault: reason why the robot must not drive by it, None if it may.
        problem: the same in a sentence, "" if it can.
        zones_problem: reason why the file of the zones is not used, "" if it is.
        map_problem: reason why a map in another frame could not be placed at the last update, "" if it could.
        updates: number of updates.
    """

    def __init__(
        self,
        config: CostmapConfig,
        frames: Frames,
        name: str,
        *,
        now: float = 0.0,
        keeps_last: bool = False,
        zones: Path | None = None,
    ) -> None:
        self.name = name
        self.params = config.params
        self.frame = config.params.global_frame.lstrip("/")
        self.base_frame = config.params.robot_base_frame.lstrip("/")
        self.lock = threading.RLock()
        self.costmap = LayeredCostmap(config)
        self._zones, self._zones_read = ZonesLayer(), (0, 0)
        self._zones_file = zones
        if zones is not None:
            self.costmap.add(self._zones)
        self.inputs: Sequence[Input[Any]] = make_inputs(self.costmap, now)
        self.map_problem = self.zones_problem = ""
        self.updates = 0
        self._frames = frames
        self._keeps_last = keeps_last
        self._map_frames: dict[int, str] = {}
        self.fault: Fault | None = Fault.NEW
        self.problem = Fault.NEW.value
        self._read_masks()
        self._keep_last()

    @property
    def scan_inputs(self) -> list[ScanInput]:
        """The inputs that take laser scans."""
        return [each for each in self.inputs if isinstance(each, ScanInput)]

    @property
    def map_layers(self) -> list[StaticLayer]:
        """The layers with a map from a topic."""
        layers = (layer for layer in self.costmap.static_layers if layer is not self._zones)
        return [layer for layer in layers if not _mask_file(layer)]

    def _read_masks(self) -> None:
        for layer in self.costmap.static_layers:
            if _mask_file(layer):
                grid = read_map(Path(_mask_file(layer)).expanduser())
                self.hear_map(layer, grid, layer.mask_frame if isinstance(layer, KeepoutLayer) else "")
                size = grid.cells.shape[::-1]
                log.info("%s: keep-out mask of %d x %d cells from %s", self.name, *size, _mask_file(layer))

    def _follow_zones(self) -> None:
        """Read the zones anew if their file has changed; of a bad one the zones before stay."""
        assert self._zones_file is not None
        try:
            state = self._zones_file.stat()
            read = state.st_mtime_ns, state.st_size
        except OSError:
            read = 0, 0
        if read == self._zones_read:
            return
        self._zones_read = read
        try:
            zones = read_zones(self._zones_file)
            self.zones_problem = ""
        except ParamError as err:
            self.zones_problem = f"{err}; the zones before stay"
            log.error("%s: %s", self.name, self.zones_problem)
            return
        log.info("%s: keep-out zones: %s", self.name, ", ".join(zone.name for zone in zones) or "none")
        self._zones.set_zones(zones)
        self._map_frames[id(self._zones)] = _ZONES_FRAME

    # Inputs

    def hear_map(self, layer: StaticLayer, grid: Grid, frame: str) -> None:
        """Give a layer its map, which is in a frame; raises MapError if it cannot be used."""
        with self.lock:
            layer.set_map(grid)
            self._map_frames[id(layer)] = frame

    def hear_map_update(self, layer: StaticLayer, x: int, y: int, cells: NDArray[np.int8]) -> None:
        """Give a layer a part of its map, which starts at a cell."""
        with self.lock:
            layer.update_map(x, y, cells)

    def has_map(self, layer: StaticLayer) -> bool:
        """Whether a layer has a map."""
        return id(layer) in self._map_frames

    def configure(self, params: CostmapParams) -> None:
        """Use other parameters; the caller holds `lock`. Raises ParamError."""
        before = self.costmap.info
        self.costmap.configure(params)
        if self.costmap.info != before:
            self._fail(Fault.RESIZED)
        self._keep_last()
        self.params = params

    # Updates

    def robot_pose(self, now: float) -> Pose2D:
        """Pose of the robot in this costmap's frame.

        Raises:
            TransformError: it is unknown, or older than `transform_tolerance`.
        """
        pose, stamp = self._frames.lookup_stamped(self.frame, self.base_frame)
        age = now - stamp
        if self.params.transform_tolerance > 0.0 and age > self.params.transform_tolerance:
            raise TransformError(self.frame, self.base_frame, f"the newest is {age:.2f} s old")
        return pose

    def update(self, now: float) -> tuple[Pose2D, list[Bounds]] | None:
        """Update the layers with the inputs received.

        Returns:
            The robot's pose and the areas written; None if there was no update, as `update_frequency` is 0 or the
            pose is not known (then `fault` says so).
        """
        if self.params.update_frequency == 0.0:
            return None
        try:
            pose = self.robot_pose(now)
        except TransformError as err:
            self._fail(Fault.NO_POSE, str(err))
            return None
        with self.lock:
            for each in self.inputs:
                each.take(self._frames, self.frame, now)
            if self._zones_file is not None:
                self._follow_zones()
            self._place_maps()
            areas = self.costmap.update(now, pose)
            self._keep_last()
            self.updates += 1
        self.fault, self.problem = None, ""
        return pose, areas

    def copy(self) -> Grid:
        """Place and costs now; waits for an update that is under way."""
        with self.lock:
            return Grid(self.costmap.info, self.costmap.cells.copy())

    def reset(self) -> None:
        """Forget sensor data; the map stays."""
        with self.lock:
            self.costmap.reset()

    def _fail(self, fault: Fault, problem: str = "") -> None:
        self.fault = fault
        self.problem = problem or fault.value

    def _place_maps(self) -> None:
        self.map_problem = ""
        for layer in self.costmap.static_layers:
            frame = self._map_frames.get(id(layer), self.frame)
            if frame and frame != self.frame:
                try:
                    layer.master_from_map = self._frames.lookup(self.frame, frame)
                except TransformError as err:
                    self.map_problem = str(err)

    def _keep_last(self) -> None:
        if self._keeps_last:
            self.last = Grid(self.costmap.info, self.costmap.cells.copy())

    # Judgement

    def is_current(self, now: float) -> bool:
        """Whether the robot can drive by this costmap."""
        is_blind = any(each.is_blind(now) for each in self.inputs)
        return not self.problem and not is_blind and self.costmap.is_current(now)

    def troubles(self, now: float) -> list[str]:
        """Silent or unusable inputs, a sentence each."""
        texts = (*(each.trouble(now) for each in self.inputs), self.zones_problem)
        return [f"{self.name}/{text}" for text in texts if text]


def _mask_file(layer: StaticLayer) -> str:
    return layer.mask_file if isinstance(layer, KeepoutLayer) else ""
