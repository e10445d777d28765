"""Depth images as a source of an obstacle layer: obstacles below or above the lidar's plane.

`depth_sources` are ours. Upstream takes a depth camera as PointCloud2 and clears by rays in the plane. Such a ray
passes over a low obstacle to the wall behind it; it removes the mark as soon as the robot is too near to see the
obstacle. Here a mark goes only when the camera looks behind it, from just above the floor to the top (as in projective
fusion, e.g. Newcombe et al., KinectFusion, 2011). Give the source its own layer: a lidar's beams in the same layer
would clear the camera's marks.

The height up to which points count as floor grows with the distance, as do the errors of the camera's pitch and of the
depth. Obstacles at the lidar's height are left to the lidar (`lidar_height`); otherwise people who pass would leave
marks that only the camera can clear.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.costmap.costs import CostCells
from rosbot_patrol.costmap.sensor_params import DepthSourceParams
from rosbot_patrol.costmap.sources import depth_kernels as kernels
from rosbot_patrol.costmap.sources.observation import Observation
from rosbot_patrol.errors import ImageError
from rosbot_patrol.grid import GridInfo

Array = NDArray[np.float64]
DepthCells = NDArray[np.float32]

EDGE = 0.05  # of a square of floor in which points are counted [m]
_MOST = 4096  # places in one picture
_BAND = 0.02  # above and below the lidar's height [m]
_STEP = 0.025  # between the heights checked for a view behind a mark [m]


@dataclass(frozen=True)
class Optics:
    """A pinhole [px]."""

    fx: float
    fy: float
    cx: float
    cy: float

    def strided(self, stride: int, start: int) -> Array:
        """fx, fy, cx, cy of the picture that holds every `stride`-th row and column from `start` on."""
        return np.array(
            [self.fx / stride, self.fy / stride, (self.cx - start) / stride, (self.cy - start) / stride], np.float64
        )


@dataclass(frozen=True)
class DepthPicture:
    """Every n-th row and column of a depth picture.

    Attributes:
        stamp: when it was taken [s].
        depth: along the optical axis [m], shape (H, W), NaN where it is not known.
        optics: fx, fy, cx, cy [px of this picture].
    """

    stamp: float
    depth: DepthCells
    optics: Array

    @classmethod
    def of(cls, depth: NDArray[np.generic], optics: Optics, *, stride: int, stamp: float) -> DepthPicture:
        """Of a whole picture in metres (float32) or millimetres (uint16, 0 is unknown), as REP 118 has them.

        Only the pixels that are kept are copied.

        Raises:
            ImageError: it is no such picture.
        """
        if depth.ndim != 2 or depth.dtype.kind not in "fu" or min(depth.shape) < stride:
            raise ImageError(f"a picture of shape {depth.shape} and {depth.dtype} is no depth picture")
        start = stride // 2
        kept = depth[start::stride, start::stride]
        metres = np.ascontiguousarray(kept, np.float32)
        if depth.dtype.kind == "u":
            metres = np.where(metres > 0.0, metres * np.float32(0.001), np.float32(np.nan))
        return cls(stamp, metres, optics.strided(stride, start))


@dataclass(frozen=True)
class DepthView:
    """The space behind marks that a depth image shows.

    Attributes:
        picture: the depths.
        floor_from_optical: the costmap's frame with z from the floor, shape (3, 4).
        params: of the source.
    """

    picture: DepthPicture
    floor_from_optical: Array
    params: DepthSourceParams

    def clear(self, cells: CostCells, info: GridInfo, cleared: NDArray[np.int32], changes: NDArray[np.int64]) -> None:
        """Clear the marks that the camera looks behind; arguments as in `costmap_kernels.clear_rays`."""
        p = self.params
        kernels.clear_looked_behind(
            cells, info.resolution, info.origin_x, info.origin_y, self.picture.depth, self.picture.optics,
            self.floor_from_optical, p.min_range, p.raytrace_range, p.min_obstacle_height, p.floor_slope,
            p.max_obstacle_height, _STEP, cleared, changes,
        )  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class DepthObservation(Observation):
    """A depth image in the costmap's frame: `hits` are the obstacles; it clears by `depth`."""

    depth: DepthView


def observe_depth(picture: DepthPicture, costmap_from_optical: Array, params: DepthSourceParams) -> DepthObservation:
    """Turn a depth image, taken at a pose, into an observation.

    Args:
        picture: the depths.
        costmap_from_optical: pose of the optical frame (z ahead, x right, y down) in the costmap's, shape (4, 4).
        params: of the source.
    """
    p = params
    pose = np.ascontiguousarray(costmap_from_optical[:3], np.float64).copy()
    pose[2, 3] -= p.floor_height
    half = math.ceil(p.obstacle_range / EDGE) + 1
    bins = np.zeros((2 * half, 2 * half, 4))
    found = np.empty((_MOST, 2))
    lidar = (p.lidar_height - _BAND, p.lidar_height + _BAND) if p.lidar_height > 0.0 else (math.inf, -math.inf)
    heights = np.array([p.max_obstacle_height, *lidar])
    reach = math.ceil(p.lidar_reach / EDGE - 1e-9)
    count = kernels.standing_points(
        picture.depth, picture.optics, pose, 0.0, p.obstacle_range, p.min_obstacle_height, p.floor_slope, heights,
        EDGE, p.min_points, reach, bins, found,
    )  # fmt: skip
    hits = found[:count] + pose[:2, 3]
    return DepthObservation(
        stamp=picture.stamp,
        sensor=(float(pose[0, 3]), float(pose[1, 3])),
        hits=hits,
        ends=np.empty((0, 2)),
        height=p.min_obstacle_height,
        depth=DepthView(picture, pose, p),
    )
