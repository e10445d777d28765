"""A camera's calibration: its file, its address, and pictures of another size."""

from __future__ import annotations

import logging
import math
from dataclasses import replace
from pathlib import Path

import pytest

from rosbot_patrol.drivers.cameras.calibration import (
    Calibration,
    CalibrationStore,
    path_of,
    read_calibration,
    write_calibration,
)
from rosbot_patrol.errors import ParamError

ASTRA = replace(
    Calibration.of_pinhole(640, 480, 1.0, "rgb_camera"), d=(0.1, -0.2, 0.001, 0.002, 0.0), model="plumb_bob"
)
# as camera_calibration writes it
UPSTREAM = """image_width: 640
image_height: 480
camera_name: rgb_camera
camera_matrix:
  rows: 3
  cols: 3
  data: [594.27, 0, 321.69, 0, 594.27, 244.36, 0, 0, 1]
distortion_model: plumb_bob
distortion_coefficients:
  rows: 1
  cols: 5
  data: [0.03, -0.06, 0.0, 0.0, 0.0]
rectification_matrix:
  rows: 3
  cols: 3
  data: [1, 0, 0, 0, 1, 0, 0, 0, 1]
projection_matrix:
  rows: 3
  cols: 4
  data: [594.27, 0, 321.69, 0, 0, 594.27, 244.36, 0, 0, 0, 1, 0]
"""


def folder_of(package: str) -> str:
    if package != "robot":
        raise LookupError(package)
    return "/opt/robot"


def test_a_file_comes_back_as_it_was_written(tmp_path: Path) -> None:
    path = tmp_path / "made" / "camera.yaml"
    write_calibration(path, ASTRA)
    assert read_calibration(path) == ASTRA


def test_a_file_of_camera_calibration_is_read(tmp_path: Path) -> None:
    path = tmp_path / "camera.yaml"
    path.write_text(UPSTREAM)
    read = read_calibration(path)
    assert (read.width, read.height, read.name, read.k[0], read.d[1]) == (640, 480, "rgb_camera", 594.27, -0.06)
    assert read.is_calibrated


@pytest.mark.parametrize(
    ("old", "new", "what"),
    [
        ("image_width: 640", "image_width: wide", "image_width and image_height must be numbers of pixels"),
        ("244.36, 0, 0, 1]\ndistortion_model", "244.36, 0, 0]\ndistortion_model", "camera_matrix has 8 numbers; 9"),
        ("data: [0.03", "data: [.nan", "distortion_coefficients must have rows, cols and data"),
        ("image_width: 640", "image_width: [", "is no valid yaml"),
    ],
)
def test_a_broken_file_is_named_with_its_key(tmp_path: Path, old: str, new: str, what: str) -> None:
    path = tmp_path / "camera.yaml"
    path.write_text(UPSTREAM.replace(old, new))
    with pytest.raises(ParamError, match=what) as caught:
        read_calibration(path)
    assert str(path) in str(caught.value)


@pytest.mark.parametrize(
    ("url", "path"),
    [
        ("", "/home/me/.ros/camera_info/cam.yaml"),
        ("file:///etc/${NAME}.yaml", "/etc/cam.yaml"),
        ("file://${ROS_HOME}/c.yaml", "/home/me/.ros/c.yaml"),
        ("package://robot/cal/${NAME}.yaml", "/opt/robot/cal/cam.yaml"),
    ],
)
def test_addresses(url: str, path: str) -> None:
    assert path_of(url, "cam", ros_home=Path("/home/me/.ros"), package=folder_of) == Path(path)


@pytest.mark.parametrize("url", ["http://host/cam.yaml", "cam.yaml", "package://other/cam.yaml", "package://robot"])
def test_other_addresses_are_refused(url: str) -> None:
    with pytest.raises(ParamError, match="camera_info_url"):
        path_of(url, "cam", ros_home=Path("/"), package=folder_of)


def test_pictures_of_another_size_are_told_once(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    path = tmp_path / "camera.yaml"
    write_calibration(path, ASTRA)
    store = CalibrationStore(path, "rgb_camera", horizontal_fov=1.0)
    assert store.of(640, 480) == ASTRA
    with caplog.at_level(logging.WARNING):
        for _ in range(3):
            small = store.of(320, 240)
    (record,) = caplog.records
    assert f"{path} is for pictures of 640 x 480, and the camera sends 320 x 240" in record.getMessage()
    assert small.k[0] == pytest.approx(160.0 / math.tan(0.5))


def test_without_a_file_only_the_size_is_known(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    path = tmp_path / "none.yaml"
    found = CalibrationStore(path, "cam").of(640, 480)
    assert (found.width, found.height, found.is_calibrated) == (640, 480, False)
    assert f"Camera calibration file {path} not found." in caplog.text


def test_another_name_is_told_and_the_file_used(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    path = tmp_path / "camera.yaml"
    write_calibration(path, ASTRA)
    assert CalibrationStore(path, "cam").of(640, 480) == ASTRA
    assert f"[cam] does not match name rgb_camera in file {path}" in caplog.text


def test_a_new_one_is_used_and_stored(tmp_path: Path) -> None:
    path = tmp_path / "made" / "camera.yaml"
    store = CalibrationStore(path, "rgb_camera")
    assert store.set(ASTRA) == ""
    assert store.of(640, 480) == read_calibration(path) == ASTRA


def test_one_that_cannot_be_written_is_used_all_the_same(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    store = CalibrationStore(tmp_path / "file" / "camera.yaml", "rgb_camera")
    assert store.set(ASTRA).startswith("Error storing camera calibration.")
    assert store.of(640, 480) == ASTRA
