"""<road>s of a world: visible strips on the ground that the robot drives over."""

from __future__ import annotations

import itertools
import math
from xml.etree import ElementTree as ET

import numpy as np

from rosbot_patrol.simulation.scene.matrices import from_xyz_rpy
from rosbot_patrol.simulation.scene.scene import Body, Material, Shape, Visual
from rosbot_patrol.simulation.sdf.values import Place, floats

_THICK = 0.004  # [m]
_GREY = Material(rgba=(0.30, 0.30, 0.31, 1.0))


def read_road(element: ET.Element, place: Place, name: str, material: Material | None) -> Body:
    """Make a road along its points, with round corners.

    Args:
        element: the <road>.
        place: position of the element in the file.
        name: name of the body.
        material: its material, None for asphalt.

    Raises:
        WorldError: fewer than two points, or an invalid number.
    """
    width = floats(element.findtext("width") or "1", 1, place.inside("<width>"))[0]
    points = [np.array(floats(p.text or "", 3, place.inside("<point>"))) for p in element.findall("point")]
    if len(points) < 2 or width <= 0.0:
        raise place.error(f"expected a width and at least 2 points, got {width:g} m and {len(points)}")
    look = material or _GREY
    visuals = []
    for a, b in itertools.pairwise(points):
        x, y, z = (a + b) / 2.0
        strip = Shape(kind="box", size=(max(math.hypot(*(b - a)[:2]), _THICK), width, _THICK))
        pose = from_xyz_rpy((x, y, z), (0.0, 0.0, math.atan2(b[1] - a[1], b[0] - a[0])))
        visuals.append(Visual(shape=strip, pose=pose, material=look))
    corner = Shape(kind="cylinder", size=(width / 2.0, _THICK))
    visuals += [Visual(shape=corner, pose=from_xyz_rpy(point.tolist()), material=look) for point in points[1:-1]]
    return Body(name=name, kind="floor", visuals=tuple(visuals))
