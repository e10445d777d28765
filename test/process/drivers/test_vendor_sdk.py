"""Slamtec's own SDK reads our emulated lidar, and sees the same room.

It needs the wheel pyrplidarsdk, which no set-up brings.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

sdk = pytest.importorskip("pyrplidarsdk", reason="the maker's SDK is not installed: pip install pyrplidarsdk")

ROOM = Path(__file__).parents[2] / "rostest" / "rplidar_room.py"


@pytest.mark.parametrize(
    ("model", "off"), [("A1", 2.0), ("A2", 2.0), ("A3", 5.5), ("C1", 2.0), ("S1", 2.0), ("S2", 4.5)]
)
def test_the_makers_sdk_sees_the_room(model: str, off: float, tmp_path: Path) -> None:
    link = tmp_path / "rplidar"
    process = subprocess.Popen(
        [sys.executable, str(ROOM), model, str(link), "any_speed"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"
        driver = sdk.RplidarDriver(port=str(link), baudrate=115200)
        assert driver.connect()
        assert driver.get_health().status == 0
        assert driver.start_scan()
        turns = [turn for _ in range(8) if (turn := driver.get_scan_data())]
        driver.stop_scan()
        driver.disconnect()
    finally:
        process.kill()
        process.wait()
    assert len(turns) > 3
    for angle, distance, _ in (tuple(np.array(part, float) for part in turn) for turn in turns[1:]):
        radians = angle if angle.max() < 7.0 else np.radians(angle)
        millimetres = distance * 1000.0 if distance.max() < 100.0 else distance
        with np.errstate(divide="ignore"):
            room = np.minimum(2000 / np.abs(np.cos(radians)), 1500 / np.abs(np.sin(radians)))
        assert np.abs(millimetres - room)[millimetres > 0.0].max() < off
