"""The network that the detector says it runs, and its calibration."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rospy", reason="ROS is not on the path: `. scripts/env` first")
import rospy
from belief_pictures import calibration

from rosbot_patrol.detection.identity import network_sum
from rosbot_patrol.patrol.belief.calibration import CAUTIOUS, save_calibration
from rosbot_patrol.patrol.senses.health import NoHealth
from rosbot_patrol.ros.detector.running_network import RunningNetwork

ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture
def running(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """What the parameter says."""
    told: dict[str, Any] = {}
    monkeypatch.setattr(rospy, "get_param", lambda name, default=None: told.get(name, default))
    return told


def test_the_house_network_is_known_by_its_weights(running: dict[str, Any]) -> None:
    sha256 = network_sum(ROOT / "models" / "house.cfg", ROOT / "models" / "house.weights")
    running["darknet_ros/running"] = {"network": "house", "sha256": sha256, "threshold": 0.3}
    found = RunningNetwork("", "", NoHealth())()
    assert found.calibration.network == "house"
    assert found.threshold == 0.3


@pytest.mark.parametrize(
    ("told", "words"),
    [
        (None, "has not said which network it runs"),
        ("nonsense", "has not said which network it runs"),
        ({"network": "hog", "sha256": ""}, "the network 'hog' has no files"),
        ({"network": "house", "sha256": "12", "threshold": "x"}, "no calibration of the network 'house'"),
    ],
)
def test_without_a_calibration_the_cautious_one_counts_and_is_told(
    running: dict[str, Any], told: object, words: str, caplog: pytest.LogCaptureFixture
) -> None:
    if told is not None:
        running["darknet_ros/running"] = told
    network = RunningNetwork("", "", NoHealth())
    assert network().calibration is CAUTIOUS
    network()
    (record,) = [r for r in caplog.records if words in r.getMessage()]  # told once
    assert "the cautious calibration is used, one side alone confirms nobody" in record.getMessage()


def test_a_folder_of_ones_own_comes_first_and_a_name_needs_no_detector(tmp_path: Path) -> None:
    save_calibration(tmp_path / "mine.json", dataclasses.replace(calibration(), network="house"))
    assert RunningNetwork("house", str(tmp_path), NoHealth())().calibration.sha256 == "sum"
    assert RunningNetwork("house", str(tmp_path / "gone"), NoHealth())().calibration.sha256 != "sum"
