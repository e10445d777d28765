"""Parameters of amcl; names and defaults as upstream (navigation 1.17), so that its launch files work as they are."""

from __future__ import annotations

import math
from dataclasses import dataclass

from rosbot_patrol.amcl.motion_model import MOTION_MODELS
from rosbot_patrol.params import param

SENSOR_MODELS = ("beam", "likelihood_field", "likelihood_field_prob")
SEEK = ("never", "asked", "lost")


def _not_finite(value: float) -> str | None:
    return None if math.isfinite(value) else f"expected a finite number, got {value}"


@dataclass(frozen=True, kw_only=True)
class AmclParams:
    """Parameters of amcl; names and defaults as upstream."""

    odom_frame_id: str = param("odom", doc="frame of the odometry")
    base_frame_id: str = param("base_link", doc="frame of the robot")
    global_frame_id: str = param("map", doc="frame of the map")
    tf_broadcast: bool = param(True, doc="publish map -> odom")
    transform_tolerance: float = param(
        0.1, unit="s", lo=0.0, clamps="both", doc="time by which map -> odom is post-dated"
    )
    use_map_topic: bool = param(False, doc="take the map from the topic `map` instead of the service `static_map`")
    first_map_only: bool = param(False, doc="use only the first map of the topic")
    gui_publish_rate: float = param(-1.0, unit="Hz", doc="maximum rate of publishing particles; -1: at each update")
    save_pose_rate: float = param(0.5, unit="Hz", doc="rate of saving the pose as initial_pose_*; -1: never")

    min_particles: int = param(100, lo=1, clamps="both", doc="minimum number of particles")
    max_particles: int = param(5000, lo=1, clamps="both", doc="maximum number of particles")
    kld_err: float = param(0.01, lo=1e-6, clamps="both", doc="maximum error of the particle distribution")
    kld_z: float = param(0.99, lo=0.0, clamps="both", doc="upper quantile of the normal distribution for kld_err")
    update_min_d: float = param(0.2, unit="m", lo=0.0, clamps="both", doc="distance in x or y between updates")
    update_min_a: float = param(math.pi / 6.0, unit="rad", lo=0.0, clamps="both", doc="turn between updates")
    resample_interval: int = param(2, lo=1, clamps="both", doc="number of updates between resamplings")
    selective_resampling: bool = param(False, doc="resample only if few particles have most of the weight")
    recovery_alpha_slow: float = param(
        0.001, lo=0.0, hi=1.0, clamps="both", doc="decay rate of the slow average weight; 0: no random particles"
    )
    recovery_alpha_fast: float = param(
        0.1, lo=0.0, hi=1.0, clamps="both", doc="decay rate of the fast average weight; 0: no random particles"
    )

    initial_pose_x: float = param(0.0, unit="m", ignores_nan=True, check=_not_finite, doc="initial position")
    initial_pose_y: float = param(0.0, unit="m", ignores_nan=True, check=_not_finite, doc="initial position")
    initial_pose_a: float = param(0.0, unit="rad", ignores_nan=True, check=_not_finite, doc="initial heading")
    initial_cov_xx: float = param(
        0.25, unit="m2", lo=0.0, ignores_nan=True, check=_not_finite, doc="variance of the initial position"
    )
    initial_cov_yy: float = param(
        0.25, unit="m2", lo=0.0, ignores_nan=True, check=_not_finite, doc="variance of the initial position"
    )
    initial_cov_aa: float = param(
        (math.pi / 12.0) ** 2,
        unit="rad2",
        lo=0.0,
        ignores_nan=True,
        check=_not_finite,
        doc="variance of the initial heading",
    )
    force_update_after_initialpose: bool = param(False, doc="update at the first scan after `initialpose`")
    force_update_after_set_map: bool = param(False, doc="update at the first scan after `set_map`")

    laser_model_type: str = param("likelihood_field", choices=SENSOR_MODELS, doc="sensor model")
    laser_min_range: float = param(
        -1.0, unit="m", doc="minimum range; shorter beams count as misses; -1: the scan's own"
    )
    laser_max_range: float = param(-1.0, unit="m", doc="maximum range; longer beams are ignored; -1: the scan's own")
    laser_max_beams: int = param(30, lo=2, clamps="both", doc="number of beams used from a scan, evenly spread")
    laser_z_hit: float = param(0.95, lo=0.0, clamps="both", doc="share of beams that hit mapped obstacles")
    laser_z_short: float = param(0.1, lo=0.0, clamps="both", doc="share of beams that end early (beam)")
    laser_z_max: float = param(0.05, lo=0.0, clamps="both", doc="share of beams without a return (beam)")
    laser_z_rand: float = param(0.05, lo=0.0, clamps="both", doc="share of random beams")
    laser_sigma_hit: float = param(0.2, unit="m", lo=1e-6, doc="standard deviation of hits")
    laser_lambda_short: float = param(0.1, unit="1/m", lo=0.0, clamps="both", doc="decay rate of early ends (beam)")
    laser_likelihood_max_dist: float = param(
        2.0, unit="m", lo=1e-6, doc="distance at which the likelihood field is cut off"
    )
    do_beamskip: bool = param(False, doc="ignore beams that agree with few particles (likelihood_field_prob)")
    beam_skip_distance: float = param(
        0.5, unit="m", lo=0.0, clamps="both", doc="distance from an obstacle within which a beam agrees"
    )
    beam_skip_threshold: float = param(
        0.3, lo=0.0, hi=1.0, clamps="both", doc="minimum share of particles that a beam must agree with"
    )
    beam_skip_error_threshold: float = param(
        0.9, lo=0.0, hi=1.0, clamps="both", doc="share of skipped beams above which none is skipped"
    )

    odom_model_type: str = param("diff", choices=MOTION_MODELS, doc="motion model")
    odom_alpha1: float = param(0.2, lo=0.0, clamps="both", doc="rotation noise from rotation")
    odom_alpha2: float = param(0.2, lo=0.0, clamps="both", doc="rotation noise from translation")
    odom_alpha3: float = param(0.2, lo=0.0, clamps="both", doc="translation noise from translation")
    odom_alpha4: float = param(0.2, lo=0.0, clamps="both", doc="translation noise from rotation")
    odom_alpha5: float = param(0.2, lo=0.0, clamps="both", doc="sideways noise from translation (omni)")

    std_warn_level_x: float = param(0.2, unit="m", lo=0.0, doc="standard deviation above which /diagnostics warns")
    std_warn_level_y: float = param(0.2, unit="m", lo=0.0, doc="standard deviation above which /diagnostics warns")
    std_warn_level_yaw: float = param(0.1, unit="rad", lo=0.0, doc="standard deviation above which /diagnostics warns")
    trust_lost_below: float = param(
        0.45, lo=0.0, hi=1.0, doc="ours: agreement of scans and map below which the robot is lost"
    )
    trust_sure_above: float = param(0.6, lo=0.0, hi=1.0, doc="ours: agreement above which the pose is trusted again")
    seek: str = param(
        "lost", choices=SEEK, doc="ours: when to search the whole map beside the filter: on request, or when lost, too"
    )
    bag_scan_period: float = param(-1.0, unit="s", doc="accepted; upstream uses it to play a bag")
