"""Depth by OpenNI2's own test device, where the package openni and Debian's libopenni2-0 are installed."""

from __future__ import annotations

import importlib.util
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from rosbot_patrol.drivers.cameras.openni_depth import DepthCapture, OpenniDepth
from rosbot_patrol.errors import DeviceError

LIBRARIES = next(iter(Path("/usr/lib").glob("*/libOpenNI2.so.0")), Path("/nowhere/libOpenNI2.so.0"))
HAS_PACKAGE = importlib.util.find_spec("openni") is not None
READ = """
import sys
from pathlib import Path
from rosbot_patrol.drivers.cameras.openni_depth import OpenniDepth
camera = OpenniDepth(Path(sys.argv[1]), "Dummy")
found = [camera.read() for _ in range(5)]
print(found[-1].millimetres.shape, found[-1].at > found[0].at, camera.horizontal_fov > 0.0)
camera.close()
"""


def test_metres_are_unknown_where_nothing_was_measured() -> None:
    metres = DepthCapture(np.array([[0, 1500]], np.uint16), 0.0).metres
    assert np.isnan(metres[0, 0])
    assert metres[0, 1] == pytest.approx(1.5)


def test_what_is_missing_is_told(tmp_path: Path) -> None:
    words = "holds no libOpenNI2.so" if HAS_PACKAGE else "the package openni is missing"
    with pytest.raises(DeviceError, match=words):
        OpenniDepth(tmp_path)


@pytest.mark.skipif(not HAS_PACKAGE, reason="needs the package openni: .ws/venv/bin/pip install openni==2.3.0")
@pytest.mark.skipif(not LIBRARIES.exists(), reason="needs Debian's libopenni2-0")
def test_pictures_of_openni_s_test_device(tmp_path: Path) -> None:
    (tmp_path / "libOpenNI2.so").symlink_to(LIBRARIES)
    drivers = tmp_path / "OpenNI2" / "Drivers"
    drivers.mkdir(parents=True)
    for driver in (LIBRARIES.parent / "OpenNI2" / "Drivers").glob("libDummyDevice.so*"):
        (drivers / driver.name).symlink_to(driver)
    done = subprocess.run([sys.executable, "-c", READ, str(tmp_path)], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[-1].endswith("True True")
