"""Point clouds as a source of an obstacle layer (costmap_2d's `data_type: PointCloud2` and `PointCloud`).

Matches costmap_2d::ObservationBuffer: points between `min_obstacle_height` and `max_obstacle_height` in the costmap's
frame count; the others neither mark nor clear. The ray from the sensor to each point clears in the plane.

Differs: of a cloud every `stride`-th row and column is used (4; of a cloud without rows every `stride`-th point).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.costmap.sensor_params import SourceParams
from rosbot_patrol.costmap.sources.observation import Observation
from rosbot_patrol.counts import count_of
from rosbot_patrol.errors import ImageError

Array = NDArray[np.float64]

_FLOATS = {7: "f4", 8: "f8"}  # of sensor_msgs/PointField


@dataclass(frozen=True)
class CloudLayout:
    """Memory layout of a sensor_msgs/PointCloud2.

    Attributes:
        fields: name to offset [bytes], type and count, as in sensor_msgs/PointField.
        point_step: from point to point [bytes].
        row_step: from row to row [bytes].
    """

    width: int
    height: int
    fields: dict[str, tuple[int, int]]
    point_step: int
    row_step: int
    is_bigendian: bool = False


def cloud_points(data: bytes, layout: CloudLayout, stride: int = 1) -> Array:
    """Finite points of a cloud, shape (N, 3) [m]; only the points used are copied.

    Raises:
        ImageError: it has no floats x, y and z, or not so many bytes as it says.
    """
    c = layout
    missing = [k for k in "xyz" if c.fields.get(k, (0, 0))[1] not in _FLOATS]
    if missing:
        there = ", ".join(c.fields) or "none"
        raise ImageError(f"a cloud without floats {' and '.join(missing)} (fields: {there})")
    ends = [c.fields[k][0] + int(_FLOATS[c.fields[k][1]][1]) for k in "xyz"]
    if c.width and c.height and (max(ends) > c.point_step or c.row_step < c.width * c.point_step):
        raise ImageError(f"a cloud of {c.width} points a row in steps of {c.point_step} and {c.row_step} bytes")
    if len(data) < c.row_step * c.height:
        raise ImageError(f"a cloud of {count_of(len(data), 'byte')}, expected {c.row_step} x {c.height}")
    order = ">" if c.is_bigendian else "<"
    start = stride // 2 if min(c.width, c.height) > stride else 0
    along = slice(start, None, stride)
    across = slice(start, None, stride) if c.height > 1 else slice(None)
    parts = []
    for key in "xyz":
        offset, kind = c.fields[key]
        view: NDArray[np.float64] = np.ndarray(
            (c.height, c.width), order + _FLOATS[kind], data, offset, (c.row_step, c.point_step)
        )
        parts.append(np.asarray(view[across, along], np.float64).ravel())
    points = np.column_stack(parts)
    finite: Array = points[np.isfinite(points).all(axis=1)]
    return finite


def observe_cloud(
    points: Array, costmap_from_sensor: Array, params: SourceParams, *, stamp: float, top: float = np.inf
) -> Observation:
    """Turn a cloud, taken at a pose, into an observation.

    Args:
        points: in the sensor's frame [m], shape (N, 3).
        costmap_from_sensor: shape (4, 4).
        params: of the source.
        stamp: when it was measured [s].
        top: the layer's `max_obstacle_height` [m]: higher points clear and do not mark.
    """
    placed = points @ costmap_from_sensor[:3, :3].T + costmap_from_sensor[:3, 3]
    z = placed[:, 2]
    counts = (z >= params.min_obstacle_height) & (z <= params.max_obstacle_height)
    ends = np.ascontiguousarray(placed[counts, :2])
    hits = np.ascontiguousarray(placed[counts & (z <= top), :2])
    return Observation(
        stamp=stamp,
        sensor=(float(costmap_from_sensor[0, 3]), float(costmap_from_sensor[1, 3])),
        hits=hits,
        ends=ends,
        height=min(params.max_obstacle_height, max(params.min_obstacle_height, min(0.0, top))),
    )
