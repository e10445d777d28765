"""Calibration of a camera: its file, and the address under which drivers look for it.

Matches camera_info_manager and camera_calibration_parsers (noetic): addresses file:/// and package://, the default
`file://${ROS_HOME}/camera_info/${NAME}.yaml`, the keys of the file, and the words of the warnings.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import yaml

from rosbot_patrol.errors import ParamError
from rosbot_patrol.files import write_atomic
from rosbot_patrol.yaml_files import read_mapping

log = logging.getLogger(__name__)

DEFAULT_URL = "file://${ROS_HOME}/camera_info/${NAME}.yaml"
_MATRICES = {
    "camera_matrix": (3, 3),
    "distortion_coefficients": (1, 0),
    "rectification_matrix": (3, 3),
    "projection_matrix": (3, 4),
}


@dataclass(frozen=True)
class Calibration:
    """Fields of sensor_msgs/CameraInfo.

    Attributes:
        width: columns of the pictures that it belongs to; height: their rows.
        name: of the camera.
        model: of the distortion, such as plumb_bob; d: its coefficients.
        k: intrinsic matrix, 9 numbers by rows; 0 first if the camera is not calibrated.
        r: rectification matrix, 9 numbers; p: projection matrix, 12 numbers.
    """

    width: int
    height: int
    name: str = ""
    model: str = "plumb_bob"
    d: tuple[float, ...] = (0.0,) * 5
    k: tuple[float, ...] = (0.0,) * 9
    r: tuple[float, ...] = (0.0,) * 9
    p: tuple[float, ...] = (0.0,) * 12

    @property
    def is_calibrated(self) -> bool:
        """Whether it has an intrinsic matrix."""
        return self.k[0] != 0.0

    @classmethod
    def of_pinhole(cls, width: int, height: int, horizontal_fov: float, name: str = "") -> Calibration:
        """An ideal camera with a horizontal field of view [rad]."""
        focal = 0.5 * width / math.tan(0.5 * horizontal_fov)
        x, y = 0.5 * width - 0.5, 0.5 * height - 0.5
        k = (focal, 0.0, x, 0.0, focal, y, 0.0, 0.0, 1.0)
        r = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
        return cls(width, height, name, k=k, r=r, p=(*k[:3], 0.0, *k[3:6], 0.0, *k[6:], 0.0))


def read_calibration(path: Path) -> Calibration:
    """Read a calibration file. Raises ParamError that names the file and key."""
    tree = read_mapping(path, keys="image_width, image_height, camera_matrix and so on")
    sizes = [tree.get(key) for key in ("image_width", "image_height")]
    if not all(isinstance(size, int) and size > 0 for size in sizes):
        raise ParamError(str(path), "image_width and image_height must be numbers of pixels")
    found = {key: _matrix(path, key, tree.get(key), *shape) for key, shape in _MATRICES.items()}
    return Calibration(
        width=int(tree["image_width"]),
        height=int(tree["image_height"]),
        name=str(tree.get("camera_name", "")),
        model=str(tree.get("distortion_model", "plumb_bob")),
        d=found["distortion_coefficients"],
        k=found["camera_matrix"],
        r=found["rectification_matrix"],
        p=found["projection_matrix"],
    )


def write_calibration(path: Path, calibration: Calibration) -> None:
    """Write a calibration file, with its folders. Raises OSError."""
    c = calibration
    tree = {
        "image_width": c.width,
        "image_height": c.height,
        "camera_name": c.name,
        "camera_matrix": {"rows": 3, "cols": 3, "data": list(c.k)},
        "distortion_model": c.model,
        "distortion_coefficients": {"rows": 1, "cols": len(c.d), "data": list(c.d)},
        "rectification_matrix": {"rows": 3, "cols": 3, "data": list(c.r)},
        "projection_matrix": {"rows": 3, "cols": 4, "data": list(c.p)},
    }
    write_atomic(path, yaml.safe_dump(tree, sort_keys=False, default_flow_style=None).encode())


def _matrix(path: Path, key: str, value: object, rows: int, cols: int) -> tuple[float, ...]:
    data = value.get("data") if isinstance(value, Mapping) else None
    if not isinstance(data, Sequence) or isinstance(data, str) or not all(_is_finite(each) for each in data):
        raise ParamError(str(path), f"{key} must have rows, cols and data, a list of numbers")
    if cols and len(data) != rows * cols:
        raise ParamError(str(path), f"{key} has {len(data)} numbers; {rows * cols} are expected")
    return tuple(float(each) for each in data)


def _is_finite(value: object) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)


def path_of(url: str, name: str, *, ros_home: Path, package: Callable[[str], str]) -> Path:
    """The file that an address names.

    Args:
        url: file:///... or package://PACKAGE/..., with ${NAME} and ${ROS_HOME}; "" is the default.
        name: of the camera.
        ros_home: ROS's folder of the user.
        package: folder of a package; raises LookupError.

    Raises:
        ParamError: for any other address.
    """
    full = (url or DEFAULT_URL).replace("${NAME}", name).replace("${ROS_HOME}", str(ros_home))
    scheme, _, rest = full.partition("://")
    if scheme == "file" and rest.startswith("/"):
        return Path(rest)
    folder, _, below = rest.partition("/")
    if scheme == "package" and folder and below:
        try:
            return Path(package(folder)) / below
        except LookupError as err:
            raise ParamError("camera_info_url", f"{full}: the package '{folder}' is not known ({err})") from err
    raise ParamError(
        "camera_info_url", f"Invalid camera calibration URL: {full}: use file:///... or package://NAME/..."
    )


class CalibrationStore:
    """The calibration of one camera, read when it is first asked for.

    Args:
        path: of its file.
        name: of the camera.
        horizontal_fov: field of view of a camera without calibration [rad]; 0: unknown.
    """

    def __init__(self, path: Path, name: str, horizontal_fov: float = 0.0) -> None:
        self._path, self._name, self._fov = path, name, horizontal_fov
        self._known: Calibration | None = None
        self._is_read = False
        self._told: tuple[int, int] | None = None

    def of(self, width: int, height: int) -> Calibration:
        """The calibration for pictures of a size. One of another size is not used, and logged once."""
        known = self._read()
        if known is not None and (known.width, known.height) == (width, height):
            return known
        if known is not None and self._told != (width, height):
            self._told = (width, height)
            log.error(
                "%s is for pictures of %d x %d, and the camera sends %d x %d: not used; calibrate anew or set the size",
                *(self._path, known.width, known.height, width, height),
            )
        if self._fov:
            return Calibration.of_pinhole(width, height, self._fov, self._name)
        return Calibration(width, height, self._name, model="", d=())

    def set(self, calibration: Calibration) -> str:
        """Take a new calibration and write it to the file; returns why that failed, "" on success."""
        self._known, self._is_read, self._told = calibration, True, None
        try:
            write_calibration(self._path, calibration)
        except OSError as err:
            log.error("%s: the calibration is used, and lost at the end of this node: %s", self._path, err)
            return f"Error storing camera calibration. {self._path}: {err.strerror or err}"
        return ""

    def _read(self) -> Calibration | None:
        if self._is_read:
            return self._known
        self._is_read = True
        if not self._path.exists():
            log.warning("Camera calibration file %s not found.", self._path)
            return None
        try:
            self._known = read_calibration(self._path)
        except ParamError as err:
            log.error("the camera is not calibrated: %s", err)
        if self._known is not None and self._known.name != self._name:
            log.warning("[%s] does not match name %s in file %s", self._name, self._known.name, self._path)
        return self._known
