"""Parameters of the patrol's inputs: names of frames and topics, and how long a value is good."""

from __future__ import annotations

from dataclasses import dataclass

from rosbot_patrol.params import param


@dataclass(frozen=True, kw_only=True)
class EyesTopics:
    """Topics of camera, depth and map, and the limits of what they show."""

    camera_info_topic: str = param("camera/rgb/camera_info", doc="calibration of the detector's camera")
    depth_topic: str = param(
        "camera/depth/image_raw",
        doc="depth in m (32FC1) or mm (16UC1), to place boxes and reject flat pictures; empty: none",
    )
    depth_info_topic: str = param(
        "camera/depth/camera_info", doc="calibration of the depth camera; if silent, that of the colour camera is used"
    )
    depth_reach: float = param(
        4.5,
        unit="m",
        lo=0.0,
        doc="boxes beyond this range without a lidar hit are approached before they count",
    )
    view_range: float = param(8.0, unit="m", lo=0.5, doc="range assumed for lidar beams without a return")
    floor_height: float = param(
        -0.04, unit="m", doc="height of the floor in the map frame; negative, as base_link lies at the axles"
    )
    off_map: float = param(
        0.3,
        unit="m",
        lo=0.05,
        hi=1.0,
        doc="minimum distance of a lidar point from everything on the map to count as not mapped",
    )


@dataclass(frozen=True, kw_only=True)
class InputParams:
    """Sources of the patrol's inputs, and their maximum ages."""

    base_frame: str = param("base_link", doc="frame of the robot")
    odom_frame: str = param("odom", doc="frame in which turns are measured")
    map_frame: str = param("map", doc="frame of the points file")
    pose_timeout: float = param(0.5, unit="s", lo=0.05, doc="maximum age of odom -> base_link")
    map_timeout: float = param(
        2.0, unit="s", lo=0.1, doc="maximum age of map -> odom, which amcl repeats with each scan; older: no pose"
    )
    scan_timeout: float = param(1.0, unit="s", lo=0.05, doc="maximum age of a scan used for obstacles")
    battery_topic: str = param("battery", doc="state of the battery (TurtleBot3: battery_state)")
    latched_window: float = param(
        10.0, unit="s", lo=0.0, doc="for this long after start, latched triggers already handled are ignored"
    )
