"""A campaign with a network that cannot run says so before its first patrol."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import pytest


@pytest.mark.parametrize(
    ("network", "sentence"),
    [("yolov4", "campaign: the weights file .*yolov4.weights is not there"), ("yolov9", "campaign: .*yolov9")],
)
def test_a_network_that_is_not_there_ends_it_at_once(network: str, sentence: str, tmp_path: Path) -> None:
    command = ["rosrun", "rosbot_patrol", "campaign", str(tmp_path / "played"), "--network", network]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 2
    assert re.fullmatch(sentence + ".*\n", done.stderr)
    assert not (tmp_path / "played").exists()
