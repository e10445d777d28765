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
    tf_broadcast: bool = param(True, doc="send map -> odom")
    transform_tolerance: float = param(0.1, unit="s", lo=0.0, clamps="both", doc="how far ahead map -> odom is stamped")
    use_map_topic: bool = param(False, doc="take the map from the topic `map`, not from the service `static_map`")
    first_map_only: bool = param(False, doc="take only the first map of the topic")
    gui_publish_rate: float = param(-1.0, unit="Hz", doc="most often that particles are shown; -1: each update")
    save_pose_rate: float = param(0.5, unit="Hz", doc="how often the pose is saved as initial_pose_*; -1: never")

    min_particles: int = param(100, lo=1, clamps="both", doc="fewest particles")
    max_particles: int = param(5000, lo=1, clamps="both", doc="most particles")
    kld_err: float = param(0.01, lo=1e-6, clamps="both", doc="largest error of the particles' distribution")
    kld_z: float = param(0.99, lo=0.0, clamps="both", doc="upper quantile of the normal distribution for that error")
    update_min_d: float = param(0.2, unit="m", lo=0.0, clamps="both", doc="way in x or y before an update")
    update_min_a: float = param(math.pi / 6.0, unit="rad", lo=0.0, clamps="both", doc="turn before an update")
    resample_interval: int = param(2, lo=1, clamps="both", doc="updates between resamplings")
    selective_resampling: bool = param(False, doc="resample only when few particles carry the weight")
    recovery_alpha_slow: float = param(
        0.001, lo=0.0, hi=1.0, clamps="both", doc="decay of the slow average of the weights; 0: off"
    )
    recovery_alpha_fast: float = param(
        0.1, lo=0.0, hi=1.0, clamps="both", doc="decay of the fast average of the weights; 0: off"
    )

    initial_pose_x: float = param(0.0, unit="m", ignores_nan=True, check=_not_finite, doc="where the robot starts")
    initial_pose_y: float = param(0.0, unit="m", ignores_nan=True, check=_not_finite, doc="where the robot starts")
    initial_pose_a: float = param(0.0, unit="rad", ignores_nan=True, check=_not_finite, doc="where the robot starts")
    initial_cov_xx: float = param(0.25, unit="m2", lo=0.0, ignores_nan=True, check=_not_finite, doc="how sure that is")
    initial_cov_yy: float = param(0.25, unit="m2", lo=0.0, ignores_nan=True, check=_not_finite, doc="how sure that is")
    initial_cov_aa: float = param(
        (math.pi / 12.0) ** 2, unit="rad2", lo=0.0, ignores_nan=True, check=_not_finite, doc="how sure that is"
    )
    force_update_after_initialpose: bool = param(False, doc="update at the next scan after `initialpose`")
    force_update_after_set_map: bool = param(False, doc="update at the next scan after `set_map`")

    laser_model_type: str = param("likelihood_field", choices=SENSOR_MODELS, doc="sensor model")
    laser_min_range: float = param(-1.0, unit="m", doc="shorter beams count as misses; -1: the scan's own")
    laser_max_range: float = param(-1.0, unit="m", doc="longer beams are left out; -1: the scan's own")
    laser_max_beams: int = param(30, lo=2, clamps="both", doc="beams of a scan that are used, evenly spread")
    laser_z_hit: float = param(0.95, lo=0.0, clamps="both", doc="share of beams that hit what is on the map")
    laser_z_short: float = param(0.1, lo=0.0, clamps="both", doc="share that ends early (beam)")
    laser_z_max: float = param(0.05, lo=0.0, clamps="both", doc="share that misses (beam)")
    laser_z_rand: float = param(0.05, lo=0.0, clamps="both", doc="share of noise")
    laser_sigma_hit: float = param(0.2, unit="m", lo=1e-6, doc="spread of hits")
    laser_lambda_short: float = param(0.1, unit="1/m", lo=0.0, clamps="both", doc="decay of early ends (beam)")
    laser_likelihood_max_dist: float = param(2.0, unit="m", lo=1e-6, doc="obstacles farther than this do not count")
    do_beamskip: bool = param(False, doc="leave beams out that few particles agree with (likelihood_field_prob)")
    beam_skip_distance: float = param(0.5, unit="m", lo=0.0, clamps="both", doc="how near to an obstacle a beam agrees")
    beam_skip_threshold: float = param(
        0.3, lo=0.0, hi=1.0, clamps="both", doc="share of particles that must agree with a beam"
    )
    beam_skip_error_threshold: float = param(
        0.9, lo=0.0, hi=1.0, clamps="both", doc="more beams skipped than this: none is skipped"
    )

    odom_model_type: str = param("diff", choices=MOTION_MODELS, doc="motion model")
    odom_alpha1: float = param(0.2, lo=0.0, clamps="both", doc="error of turning from turning")
    odom_alpha2: float = param(0.2, lo=0.0, clamps="both", doc="error of turning from driving")
    odom_alpha3: float = param(0.2, lo=0.0, clamps="both", doc="error of driving from driving")
    odom_alpha4: float = param(0.2, lo=0.0, clamps="both", doc="error of driving from turning")
    odom_alpha5: float = param(0.2, lo=0.0, clamps="both", doc="error of sliding from driving (omni)")

    std_warn_level_x: float = param(0.2, unit="m", lo=0.0, doc="spread from which /diagnostics warns")
    std_warn_level_y: float = param(0.2, unit="m", lo=0.0, doc="spread from which /diagnostics warns")
    std_warn_level_yaw: float = param(0.1, unit="rad", lo=0.0, doc="spread from which /diagnostics warns")
    trust_lost_below: float = param(0.45, lo=0.0, hi=1.0, doc="lost where scans and map agree by less (ours)")
    trust_sure_above: float = param(0.6, lo=0.0, hi=1.0, doc="sure again where they agree by more (ours)")
    seek: str = param(
        "lost", choices=SEEK, doc="when to search the whole map beside the filter: when asked, when lost too (ours)"
    )
    bag_scan_period: float = param(-1.0, unit="s", doc="accepted for upstream's sake (used when playing a bag)")
