"""slam_gmapping on a real robot's log; needs the project's data sets."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
import yaml

from rosbot_patrol import params
from rosbot_patrol.gmapping.parameters import GmappingParams
from rosbot_patrol.replay.bags.carmen import noisy_odometry, read_log
from rosbot_patrol.replay.results.mapping import map_log
from rosbot_patrol.replay.results.relations import consecutive_pairs, relation_errors
from rosbot_patrol.scan import scan_problem

ROOT = Path(__file__).parents[3]
LOG = ROOT.parent / "shared" / "datasets" / "intel-corrected.log.gz"


@pytest.mark.skipif(not LOG.exists(), reason=f"the data sets are not at {LOG.parent}")
def test_the_first_rooms_of_intel_are_mapped() -> None:
    log = read_log(LOG)
    assert len(log.scans) == 910
    tree = yaml.safe_load((ROOT / "config" / "gmapping.yaml").read_text()) | {"particles": 3}
    scans, reference = log.scans[:80], log.poses[:80]
    odometry = noisy_odometry(reference, np.random.default_rng(1))
    found = map_log(scans, odometry, params.load(GmappingParams, tree))
    pairs = np.array([(i, 79) for i in range(70)])
    errors = relation_errors(found.poses, reference, pairs)
    assert errors.shift < 0.4
    assert errors.turn < math.radians(2.0)
    assert relation_errors(odometry, reference, pairs).turn > math.radians(2.0)
    assert relation_errors(found.poses, reference, consecutive_pairs(80)).turn < math.radians(0.8)


@pytest.mark.skipif(not LOG.exists(), reason=f"the data sets are not at {LOG.parent}")
@pytest.mark.parametrize("name", ["csail", "fhw", "intel", "orebro"])
def test_no_scan_of_a_real_robot_is_refused(name: str) -> None:
    scans = read_log(LOG.parent / f"{name}-corrected.log.gz").scans
    assert len(scans) > 200
    assert {scan_problem(scan) for scan in scans} == {""}
