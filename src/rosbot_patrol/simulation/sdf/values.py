"""Numbers, sizes and poses in SDF's form, checked; every error names file and element."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np

from rosbot_patrol.errors import WorldError
from rosbot_patrol.simulation.scene.matrices import from_xyz_rpy
from rosbot_patrol.simulation.scene.scene import Matrix, identity

VERSIONS = ("1.4", "1.5", "1.6", "1.7")
TRUE = ("true", "1")

_THIN = 1e-3  # thickness of a box with size 0, such as a picture on a wall [m]


@dataclass(frozen=True)
class Place:
    """A position in a file, for messages."""

    path: Path
    where: str = ""

    def inside(self, what: str) -> Place:
        """The position of a part of it."""
        return replace(self, where=f"{self.where}, {what}" if self.where else what)

    def error(self, problem: str) -> WorldError:
        """Make the error for a problem here."""
        return WorldError(self.path, f"{self.where}: {problem}" if self.where else problem)


def is_true(text: str | None) -> bool:
    """Whether the text of an element or attribute is true."""
    return (text or "").strip().lower() in TRUE


def floats(text: str, count: int, place: Place) -> tuple[float, ...]:
    """Parse `count` finite numbers; raises WorldError."""
    try:
        values = tuple(float(word) for word in text.split())
    except ValueError:
        values = ()
    if len(values) != count or not all(map(math.isfinite, values)):
        expected = "one number" if count == 1 else f"{count} numbers"
        raise place.error(f"expected {expected}, got '{' '.join(text.split())}'")
    return values


def sizes(shape: ET.Element, tag: str, count: int, place: Place) -> tuple[float, ...]:
    """Read the positive numbers in the element `tag` of a shape; raises WorldError."""
    text = shape.findtext(tag)
    if text is None:
        raise place.error(f"<{shape.tag}> has no <{tag}>")
    values = floats(text, count, place.inside(f"<{tag}>"))
    if min(values) <= 0.0:
        raise place.inside(f"<{tag}>").error(f"expected positive numbers, got '{text.strip()}'")
    return values


def box_sizes(box: ET.Element, place: Place) -> tuple[float, ...]:
    """Read x, y, z of a box; one of them may be 0, for a sheet. Raises WorldError."""
    values = floats(box.findtext("size") or "", 3, place.inside("<size>")) if box.find("size") is not None else ()
    if sum(value == 0.0 for value in values) == 1 and min(values) == 0.0:
        return tuple(max(value, _THIN) for value in values)
    return sizes(box, "size", 3, place)


def pose_of(element: ET.Element, place: Place) -> Matrix:
    """Read the element's <pose> in its reference frame; without one it is the identity. Raises WorldError.

    Three numbers are a position; `degrees` and a quaternion (`rotation_format`) are read as in later SDF.
    """
    pose = element.find("pose")
    if pose is None or not (pose.text or "").strip():
        return identity()
    text, here = pose.text or "", place.inside("<pose>")
    if pose.get("rotation_format") == "quat_xyzw":
        return _from_quaternion(floats(text, 7, here), here)
    if len(text.split()) == 3:
        return from_xyz_rpy(floats(text, 3, here))
    v = floats(text, 6, here)
    turn = [math.radians(angle) for angle in v[3:]] if is_true(pose.get("degrees")) else v[3:]
    return from_xyz_rpy(v[:3], turn)


def turned_to(normal: tuple[float, ...]) -> Matrix:
    """Rotation of the z axis to a normal of any length, shape (4, 4)."""
    z = np.array(normal) / max(math.hypot(*normal), 1e-12)
    side = np.array([1.0, 0.0, 0.0]) if abs(z[0]) < 0.9 else np.array([0.0, 1.0, 0.0])
    y = np.cross(z, side)
    y /= np.linalg.norm(y)
    turn = identity()
    turn[:3, :3] = np.column_stack((np.cross(y, z), y, z))
    return turn


def _from_quaternion(v: tuple[float, ...], place: Place) -> Matrix:
    length = math.hypot(*v[3:])
    if length == 0.0:
        raise place.error("expected a quaternion, got one of length 0")
    x, y, z, w = (value / length for value in v[3:])
    pose = identity()
    pose[:3, :3] = (
        (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)),
        (2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w)),
        (2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)),
    )
    pose[:3, 3] = v[:3]
    return pose
