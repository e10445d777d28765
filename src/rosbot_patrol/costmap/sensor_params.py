"""Parameters of what costmaps see by: observation sources of an obstacle layer, and range sensors."""

from __future__ import annotations

from dataclasses import dataclass

from rosbot_patrol.params import param

DEPTH_IMAGE = "DepthImage"

_UNDER, _TOP = 0.02, 0.3


@dataclass(frozen=True, kw_only=True)
class SourceParams:
    """One observation source of an obstacle layer."""

    topic: str = param("", doc="topic, the source's name where empty")
    sensor_frame: str = param("", doc="frame of the sensor, the message's where empty")
    data_type: str = param("PointCloud", choices=("LaserScan", "PointCloud", "PointCloud2"))
    observation_persistence: float = param(0.0, unit="s", lo=0.0, doc="how long a scan is used again")
    expected_update_rate: float = param(0.0, unit="s", lo=0.0, doc="older input stops the robot; 0 is never")
    min_obstacle_height: float = param(0.0, unit="m")
    max_obstacle_height: float = param(2.0, unit="m")
    obstacle_range: float = param(2.5, unit="m", lo=0.0, doc="hits farther away are not marked")
    raytrace_range: float = param(3.0, unit="m", lo=0.0, doc="cells are cleared up to here")
    inf_is_valid: bool = param(False, doc="a beam without a hit clears")
    clearing: bool = param(False)
    marking: bool = param(True)
    stride: int = param(
        4, lo=1, hi=64, doc="ours: every n-th point of a cloud, or row and column of a picture, is used"
    )
    max_rate: float = param(0.0, unit="Hz", lo=0.0, doc="ours: so many clouds or pictures a second are used; 0 all")


@dataclass(frozen=True, kw_only=True)
class DepthSourceParams(SourceParams):
    """One of `depth_sources`, which are ours: what a depth camera sees of things that the lidar misses.

    They stand beside `observation_sources`, as upstream's layer ends move_base for a data_type that it does not know.

    Heights are above the floor, which lies at `floor_height` in the costmap's frame: odom and map lie where base_link
    does, on the ROSbot at the height of its axles.
    """

    data_type: str = param(DEPTH_IMAGE, choices=(DEPTH_IMAGE,), doc="sensor_msgs/Image with 32FC1 or 16UC1")
    camera_info_topic: str = param("", doc="camera_info beside the topic where empty")
    min_obstacle_height: float = param(_UNDER, unit="m", doc="above the floor; lower is floor")
    max_obstacle_height: float = param(_TOP, unit="m", doc="above the floor; higher is no obstacle")
    floor_height: float = param(0.0, unit="m", doc="the floor in the costmap's frame")
    floor_slope: float = param(
        0.012, lo=0.0, hi=0.2, doc="the floor's band grows by this much for each metre away (pitch, noise of the depth)"
    )
    min_points: int = param(2, lo=1, doc="pixels (of those used) that must agree on 5 x 5 cm of floor")
    min_range: float = param(0.4, unit="m", lo=0.0, doc="the camera sees nothing nearer than this")
    lidar_height: float = param(
        0.0, unit="m", doc="above the floor; what the camera sees at this height is left to the lidar; 0 marks all"
    )
    lidar_reach: float = param(0.1, unit="m", lo=0.0, hi=0.5, doc="and what stands this near to it")


@dataclass(frozen=True, kw_only=True)
class RangeSensorParams:
    """Parameters of range_sensor_layer::RangeSensorLayer."""

    enabled: bool = param(True)
    ns: str = param("", doc="put before each topic")
    topics: tuple[str, ...] = param(("/sonar",), doc="of sensor_msgs/Range")
    no_readings_timeout: float = param(
        0.0, unit="s", lo=0.0, clamps="both", doc="no reading for so long stops the robot; 0 is never"
    )
    input_sensor_type: str = param(
        "ALL",
        choices=("ALL", "VARIABLE", "FIXED"),
        doc="FIXED: only readings of sensors that tell nearer or not (min_range = max_range); VARIABLE: only others",
    )
    clear_threshold: float = param(0.2, lo=0.0, hi=1.0, clamps="both", doc="cells less probably occupied are free")
    mark_threshold: float = param(0.8, lo=0.0, hi=1.0, clamps="both", doc="cells more probably occupied are lethal")
    clear_on_max_reading: bool = param(False, doc="a reading of max_range clears the cone; else it says nothing")
    inflate_cone: float = param(
        1.0, lo=0.0, hi=1.0, clamps="both", doc="1 updates all around the cone, less only inside it"
    )
    phi: float = param(1.2, unit="m", lo=0.0, doc="distance from which on readings count half")
    use_decay: bool = param(False, doc="forget marks that have not been seen for pixel_decay")
    pixel_decay: float = param(10.0, unit="s", lo=0.0, doc="how long a mark stays then")
