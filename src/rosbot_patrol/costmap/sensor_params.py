"""Parameters of observation sources, depth cameras and range sensors."""

from __future__ import annotations

from dataclasses import dataclass

from rosbot_patrol.params import param

DEPTH_IMAGE = "DepthImage"

_UNDER, _TOP = 0.02, 0.3


@dataclass(frozen=True, kw_only=True)
class SourceParams:
    """One observation source of an obstacle layer."""

    topic: str = param("", doc="topic; empty: the source's name")
    sensor_frame: str = param("", doc="frame of the sensor; empty: the message's")
    data_type: str = param("PointCloud", choices=("LaserScan", "PointCloud", "PointCloud2"), doc="type of the messages")
    observation_persistence: float = param(0.0, unit="s", lo=0.0, doc="time for which a scan is used again")
    expected_update_rate: float = param(
        0.0, unit="s", lo=0.0, doc="maximum age of the input; older stops the robot; 0: never"
    )
    min_obstacle_height: float = param(0.0, unit="m", doc="minimum height of points that count")
    max_obstacle_height: float = param(2.0, unit="m", doc="maximum height of points that count")
    obstacle_range: float = param(2.5, unit="m", lo=0.0, doc="maximum range of hits that are marked")
    raytrace_range: float = param(3.0, unit="m", lo=0.0, doc="maximum range of clearing")
    inf_is_valid: bool = param(False, doc="clear along beams without a hit")
    clearing: bool = param(False, doc="clear along the beams")
    marking: bool = param(True, doc="mark the hits")
    stride: int = param(
        4, lo=1, hi=64, doc="ours: use every n-th point of a cloud, or every n-th row and column of an image"
    )
    max_rate: float = param(0.0, unit="Hz", lo=0.0, doc="ours: maximum rate of clouds or images used; 0: all")


@dataclass(frozen=True, kw_only=True)
class DepthSourceParams(SourceParams):
    """One of `depth_sources` (ours): obstacles that a depth camera sees and the lidar misses.

    They have their own list beside `observation_sources`, because upstream's layer ends move_base for a data_type that
    it does not know.

    Heights are above the floor, which lies at `floor_height` in the costmap's frame. The origins of odom and map are at
    the height of base_link: on the ROSbot that of its axles.
    """

    data_type: str = param(DEPTH_IMAGE, choices=(DEPTH_IMAGE,), doc="sensor_msgs/Image with 32FC1 or 16UC1")
    camera_info_topic: str = param("", doc="calibration of the camera; empty: camera_info beside the topic")
    min_obstacle_height: float = param(_UNDER, unit="m", doc="minimum height above the floor; lower points are floor")
    max_obstacle_height: float = param(
        _TOP, unit="m", doc="maximum height above the floor; higher points are no obstacles"
    )
    floor_height: float = param(0.0, unit="m", doc="height of the floor in the costmap's frame")
    floor_slope: float = param(
        0.012, lo=0.0, hi=0.2, doc="added to min_obstacle_height per metre of distance, for pitch and depth noise"
    )
    min_points: int = param(2, lo=1, doc="minimum number of used pixels on 5 x 5 cm of floor for a mark")
    min_range: float = param(0.4, unit="m", lo=0.0, doc="minimum range of the camera")
    lidar_height: float = param(
        0.0, unit="m", doc="height of the lidar above the floor; obstacles at this height are left to it; 0: mark all"
    )
    lidar_reach: float = param(
        0.1, unit="m", lo=0.0, hi=0.5, doc="horizontal distance around such obstacles that is left to the lidar, too"
    )


@dataclass(frozen=True, kw_only=True)
class RangeSensorParams:
    """Parameters of range_sensor_layer::RangeSensorLayer."""

    enabled: bool = param(True, doc="use the layer")
    ns: str = param("", doc="prefix of each topic")
    topics: tuple[str, ...] = param(("/sonar",), doc="topics of type sensor_msgs/Range")
    no_readings_timeout: float = param(
        0.0, unit="s", lo=0.0, clamps="both", doc="longest time without a reading; longer stops the robot; 0: never"
    )
    input_sensor_type: str = param(
        "ALL",
        choices=("ALL", "VARIABLE", "FIXED"),
        doc="FIXED: only readings of on/off sensors (min_range = max_range); VARIABLE: only the others",
    )
    clear_threshold: float = param(0.2, lo=0.0, hi=1.0, clamps="both", doc="occupancy below which a cell is free")
    mark_threshold: float = param(0.8, lo=0.0, hi=1.0, clamps="both", doc="occupancy above which a cell is lethal")
    clear_on_max_reading: bool = param(False, doc="a reading of max_range clears the cone; false: it is ignored")
    inflate_cone: float = param(
        1.0, lo=0.0, hi=1.0, clamps="both", doc="1: update everything around the cone; less: only inside it"
    )
    phi: float = param(1.2, unit="m", lo=0.0, doc="distance beyond which readings count half")
    use_decay: bool = param(False, doc="forget marks after pixel_decay")
    pixel_decay: float = param(10.0, unit="s", lo=0.0, doc="time without a hit after which a mark goes, with use_decay")
