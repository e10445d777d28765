"""dynamic_reconfigure of amcl: parameters that can be changed at run time, with upstream's names.

Differs: frames, `use_map_topic` and `first_map_only` cannot be changed; `restore_defaults` restores the values at
start. The particles stay; upstream draws them anew around the last pose. Only changed values are written to the
parameter server, so that a respawned amcl has the recovery of its launch file.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rosbot_patrol.amcl.parameters import AmclParams
from rosbot_patrol.ros.runtime.reconfigure import ReconfigureServer
from rosbot_patrol.tunable import changed

NAMES = (
    "min_particles",
    "max_particles",
    "kld_err",
    "kld_z",
    "update_min_d",
    "update_min_a",
    "resample_interval",
    "selective_resampling",
    "transform_tolerance",
    "recovery_alpha_slow",
    "recovery_alpha_fast",
    "tf_broadcast",
    "gui_publish_rate",
    "save_pose_rate",
    "force_update_after_initialpose",
    "force_update_after_set_map",
    "laser_model_type",
    "laser_min_range",
    "laser_max_range",
    "laser_max_beams",
    "laser_z_hit",
    "laser_z_short",
    "laser_z_max",
    "laser_z_rand",
    "laser_sigma_hit",
    "laser_lambda_short",
    "laser_likelihood_max_dist",
    "do_beamskip",
    "beam_skip_distance",
    "beam_skip_threshold",
    "beam_skip_error_threshold",
    "odom_model_type",
    "odom_alpha1",
    "odom_alpha2",
    "odom_alpha3",
    "odom_alpha4",
    "odom_alpha5",
    "std_warn_level_x",
    "std_warn_level_y",
    "std_warn_level_yaw",
    "trust_lost_below",
    "trust_sure_above",
    "seek",
)


class AmclTuning:
    """The dynamic_reconfigure server of amcl.

    Args:
        params: current parameters.
        prefix: amcl's name and a slash, for messages.
        take: receives the parameters after a change.
    """

    def __init__(self, params: AmclParams, prefix: str, take: Callable[[AmclParams], None]) -> None:
        self._params, self._prefix, self._take = params, prefix, take
        self._server = ReconfigureServer("", params, NAMES, self._apply)

    def _apply(self, changes: dict[str, Any]) -> AmclParams:
        wanted = changed(self._params, changes, NAMES, name=self._prefix)
        self._take(wanted)
        self._params = wanted
        return wanted
