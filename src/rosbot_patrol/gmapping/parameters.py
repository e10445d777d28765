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
    transform_publish_period: float = param(0.05, unit="s", lo=0.0, doc="time between transforms map -> odom; 0: none")
    tf_delay: float = param(-1.0, unit="s", doc="time by which map -> odom is post-dated; -1: transform_publish_period")
    map_update_interval: float = param(5.0, unit="s", lo=0.0, doc="minimum time between maps")
    throttle_scans: int = param(1, lo=1, doc="use every n-th scan")

    maxUrange: float = param(-1.0, unit="m", doc="usable range of beams; -1: maxRange")  # noqa: N815
    maxRange: float = param(  # noqa: N815
        -1.0, unit="m", doc="maximum range; longer beams are ignored; -1: the scan's range_max less 0.01"
    )
    minimumScore: float = param(0.0, lo=0.0, doc="minimum score of an accepted match")  # noqa: N815
    sigma: float = param(0.05, unit="m2", lo=1e-6, doc="width of the score function in matching")
    kernelSize: int = param(1, unit="cells", lo=0, hi=10, doc="search radius for a wall around the end of a beam")  # noqa: N815
    lstep: float = param(0.05, unit="m", lo=1e-6, doc="initial translation step of the matching")
    astep: float = param(0.05, unit="rad", lo=1e-6, doc="initial rotation step of the matching")
    iterations: int = param(5, lo=0, hi=20, doc="number of refinements of a match")
    lsigma: float = param(0.075, unit="m2", lo=1e-6, doc="width of the likelihood of a beam")
    ogain: float = param(3.0, lo=1e-6, doc="smoothing of the weights; a larger value makes them more equal")
    lskip: int = param(0, lo=0, doc="number of beams skipped between two in the likelihood")

    srr: float = param(0.1, unit="m/m", lo=0.0, doc="translation noise from translation")
    srt: float = param(0.2, unit="rad/m", lo=0.0, doc="rotation noise from translation")
    str_: float = param(0.1, name="str", unit="m/rad", lo=0.0, doc="translation noise from rotation")
    stt: float = param(0.2, unit="rad/rad", lo=0.0, doc="rotation noise from rotation")
    linearUpdate: float = param(1.0, unit="m", lo=0.0, doc="distance between updates")  # noqa: N815
    angularUpdate: float = param(0.5, unit="rad", lo=0.0, doc="turn between updates")  # noqa: N815
    temporalUpdate: float = param(-1.0, unit="s", doc="time after which an update needs no motion; -1: never")  # noqa: N815
    resampleThreshold: float = param(  # noqa: N815
        0.5, lo=0.0, hi=1.0, doc="effective share of the particles below which they are resampled"
    )
    particles: int = param(30, lo=1, hi=10000, doc="number of particles")

    xmin: float = param(-100.0, unit="m", doc="initial extent of the map; it grows as needed")
    ymin: float = param(-100.0, unit="m", doc="initial extent of the map; it grows as needed")
    xmax: float = param(100.0, unit="m", doc="initial extent of the map; it grows as needed")
    ymax: float = param(100.0, unit="m", doc="initial extent of the map; it grows as needed")
    delta: float = param(0.05, unit="m", lo=1e-3, doc="edge of a cell")
    occ_thresh: float = param(0.25, lo=0.0, hi=1.0, doc="share of hits above which a cell is occupied")
    llsamplerange: float = param(0.01, unit="m", doc="accepted, has no effect, as upstream")
    llsamplestep: float = param(0.01, unit="m", doc="accepted, has no effect, as upstream")
    lasamplerange: float = param(0.005, unit="rad", doc="accepted, has no effect, as upstream")
    lasamplestep: float = param(0.005, unit="rad", doc="accepted, has no effect, as upstream")
    loop_closure: bool = param(
        False,
        doc="whether loops are closed for good: all poses are corrected, the map is drawn anew; not upstream's",
    )
    map_file: str = param("", doc="yaml of a saved map to extend; empty: start a new map")
    initial_pose_x: float = param(0.0, unit="m", doc="initial position on the saved map")
    initial_pose_y: float = param(0.0, unit="m", doc="initial position on the saved map")
    initial_pose_a: float = param(0.0, unit="rad", doc="initial heading on the saved map")
    seed: int = param(0, lo=0, doc="seed of all random numbers: the same inputs and seed give the same map")
