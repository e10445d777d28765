"""Numbers, sizes and poses as SDF writes them, checked; every error names file and element."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np

from rosbot_patrol.errors import WorldError
from rosbot_patrol.simulation.matrices import from_xyz_rpy
from rosbot_patrol.simulation.scene import Matrix, identity

VERSIONS = ("1.4", "1.5", "1.6", "1.7")


@dataclass(frozen=True)
class Place:
    """Where in which file one is, for messages."""

    path: Path
    where: str = ""

    def inside(self, what: str) -> Place:
        """A part of it."""
        return replace(self, where=f"{self.where}, {what}" if self.where else what)

    def error(self, problem: str) -> WorldError:
        """The error that names it."""
        return WorldError(self.path, f"{self.where}: {problem}" if self.where else problem)


def read_sdf(path: Path) -> ET.Element:
    """The root of an SDF file.

    Raises:
        WorldError: the file cannot be read, is not XML or no SDF.
    """
    try:
        root = ET.fromstring(path.read_bytes())
    except OSError as err:
        raise WorldError(path, f"cannot be read: {err.strerror}") from err
    except (ET.ParseError, LookupError, ValueError) as err:
        raise WorldError(path, f"is not XML, or not all of it: {err}") from err
    if root.tag != "sdf":
        raise WorldError(path, f"is no SDF file, its first element is <{root.tag}>")
    return root


def floats(text: str, count: int, place: Place) -> tuple[float, ...]:
    """That many finite numbers; raises WorldError."""
    try:
        values = tuple(float(word) for word in text.split())
    except ValueError:
        values = ()
    if len(values) != count or not all(map(math.isfinite, values)):
        expected = "one number" if count == 1 else f"{count} numbers"
        raise place.error(f"expected {expected}, got '{' '.join(text.split())}'")
    return values


def sizes(shape: ET.Element, tag: str, count: int, place: Place) -> tuple[float, ...]:
    """The positive numbers in the element `tag` of a shape; raises WorldError."""
    text = shape.findtext(tag)
    if text is None:
        raise place.error(f"<{shape.tag}> has no <{tag}>")
    values = floats(text, count, place.inside(f"<{tag}>"))
    if min(values) <= 0.0:
        raise place.inside(f"<{tag}>").error(f"expected positive numbers, got '{text.strip()}'")
    return values


def pose_of(element: ET.Element, place: Place) -> Matrix:
    """The element's <pose> against what it is relative to; no pose is the identity. Raises WorldError."""
    pose = element.find("pose")
    if pose is None or not (pose.text or "").strip():
        return identity()
    v = floats(pose.text or "", 6, place.inside("<pose>"))
    return from_xyz_rpy(v[:3], v[3:])


def turned_to(normal: tuple[float, ...]) -> Matrix:
    """The turn that takes the z axis to a normal of any length, shape (4, 4)."""
    z = np.array(normal) / max(math.hypot(*normal), 1e-12)
    side = np.array([1.0, 0.0, 0.0]) if abs(z[0]) < 0.9 else np.array([0.0, 1.0, 0.0])
    y = np.cross(z, side)
    y /= np.linalg.norm(y)
    turn = identity()
    turn[:3, :3] = np.column_stack((np.cross(y, z), y, z))
    return turn
