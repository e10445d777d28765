"""The sum of a network's files."""

from __future__ import annotations

from pathlib import Path

import pytest

from rosbot_patrol.detection.identity import network_sum
from rosbot_patrol.errors import DetectorError


def test_the_sum_is_of_both_files(tmp_path: Path) -> None:
    cfg, weights = tmp_path / "a.cfg", tmp_path / "a.weights"
    cfg.write_bytes(b"[net]")
    weights.write_bytes(b"1")
    first = network_sum(cfg, weights)
    weights.write_bytes(b"2")
    assert network_sum(cfg, weights) != first


def test_a_file_that_is_gone_is_named(tmp_path: Path) -> None:
    with pytest.raises(DetectorError, match=r"the network file .*a\.cfg cannot be read"):
        network_sum(tmp_path / "a.cfg", tmp_path / "a.weights")
