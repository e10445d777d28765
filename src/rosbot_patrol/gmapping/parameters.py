"""Parameters of slam_gmapping; names and defaults as upstream (slam_gmapping 1.4)."""

from __future__ import annotations

from dataclasses import dataclass

from rosbot_patrol.params import param


@dataclass(frozen=True, kw_only=True)
class GmappingParams:
    """Parameters of slam_gmapping; names and defaults as upstream."""

    base_frame: str = param("base_link", doc="frame of the robot")
    map_frame: str = param("map", doc="frame of the map")
    odom_frame: str = param("odom", doc="frame of the odometry")
    transform_publish_period: float = param(
        0.05, unit="s", lo=0.0, doc="time between two transforms map -> odom; 0: none are sent"
    )
    tf_delay: float = param(-1.0, unit="s", doc="how far ahead map -> odom is stamped; -1: transform_publish_period")
    map_update_interval: float = param(5.0, unit="s", lo=0.0, doc="least time between two maps")
    throttle_scans: int = param(1, lo=1, doc="take in every so many-th scan")

    maxUrange: float = param(-1.0, unit="m", doc="beams are used up to here; -1: maxRange")  # noqa: N815
    maxRange: float = param(  # noqa: N815
        -1.0, unit="m", doc="longer beams are no measurement; -1: the scan's range_max less 0.01"
    )
    minimumScore: float = param(0.0, lo=0.0, doc="least score of a match that is believed")  # noqa: N815
    sigma: float = param(0.05, unit="m2", lo=1e-6, doc="width of the score in the matching")
    kernelSize: int = param(1, unit="cells", lo=0, hi=10, doc="how far from a beam's end a wall is looked for")  # noqa: N815
    lstep: float = param(0.05, unit="m", lo=1e-6, doc="first step of the search")
    astep: float = param(0.05, unit="rad", lo=1e-6, doc="first turn of the search")
    iterations: int = param(5, lo=0, hi=20, doc="refinements of a match")
    lsigma: float = param(0.075, unit="m2", lo=1e-6, doc="width of a beam's likelihood")
    ogain: float = param(3.0, lo=1e-6, doc="smooths the weights: larger, and they differ less")
    lskip: int = param(0, lo=0, doc="beams to skip between two in the likelihood")

    srr: float = param(0.1, unit="m/m", lo=0.0, doc="error of driving from driving")
    srt: float = param(0.2, unit="rad/m", lo=0.0, doc="error of turning from driving")
    str_: float = param(0.1, name="str", unit="m/rad", lo=0.0, doc="error of driving from turning")
    stt: float = param(0.2, unit="rad/rad", lo=0.0, doc="error of turning from turning")
    linearUpdate: float = param(1.0, unit="m", lo=0.0, doc="way before an update")  # noqa: N815
    angularUpdate: float = param(0.5, unit="rad", lo=0.0, doc="turn before an update")  # noqa: N815
    temporalUpdate: float = param(-1.0, unit="s", doc="time before an update without motion; -1: none")  # noqa: N815
    resampleThreshold: float = param(  # noqa: N815
        0.5, lo=0.0, hi=1.0, doc="resample where the effective share of the particles is less"
    )
    particles: int = param(30, lo=1, hi=10000, doc="number of particles")

    xmin: float = param(-100.0, unit="m", doc="first extent of the map; it grows where needed")
    ymin: float = param(-100.0, unit="m", doc="first extent of the map; it grows where needed")
    xmax: float = param(100.0, unit="m", doc="first extent of the map; it grows where needed")
    ymax: float = param(100.0, unit="m", doc="first extent of the map; it grows where needed")
    delta: float = param(0.05, unit="m", lo=1e-3, doc="edge of a cell")
    occ_thresh: float = param(0.25, lo=0.0, hi=1.0, doc="share of the beams that makes a cell occupied")
    llsamplerange: float = param(0.01, unit="m", doc="accepted for upstream's sake; without effect, as there")
    llsamplestep: float = param(0.01, unit="m", doc="accepted for upstream's sake; without effect, as there")
    lasamplerange: float = param(0.005, unit="rad", doc="accepted for upstream's sake; without effect, as there")
    lasamplestep: float = param(0.005, unit="rad", doc="accepted for upstream's sake; without effect, as there")
    map_file: str = param("", doc="yaml of a saved map to go on with; empty: begin a new one")
    initial_pose_x: float = param(0.0, unit="m", doc="where the robot stands on the saved map")
    initial_pose_y: float = param(0.0, unit="m", doc="where the robot stands on the saved map")
    initial_pose_a: float = param(0.0, unit="rad", doc="where the robot stands on the saved map")
    seed: int = param(0, lo=0, doc="of all chance: the same inputs and seed give the same map")
