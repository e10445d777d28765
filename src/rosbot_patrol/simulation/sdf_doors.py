"""Doors of an SDF model: a link that speaks of a door, on a revolute joint about an upright axis."""

from __future__ import annotations

import math
from dataclasses import dataclass
from xml.etree import ElementTree as ET

import numpy as np

from rosbot_patrol.simulation.doors import SWING
from rosbot_patrol.simulation.scene import Matrix
from rosbot_patrol.simulation.sdf_frames import Frames
from rosbot_patrol.simulation.sdf_values import Place, floats


@dataclass(frozen=True)
class Hinge:
    """Where a door's axis stands, x, y [m], and by what angle it opens [rad], counter-clockwise positive."""

    axis: tuple[float, float]
    swing: float


def read_hinge(model: ET.Element, link: str, frames: Frames, world_from_model: Matrix, place: Place) -> Hinge | None:
    """The hinge of a link, None where the link is no door or hangs on no such joint.

    Args:
        model: the <model>.
        link: name of the link.
        frames: of the model.
        world_from_model: such that the link is where it stands in the world.
        place: of the link, for messages.

    Raises:
        WorldError: numbers of the joint that make no sense.
    """
    if "door" not in f"{place.where} {link}".lower():
        return None
    for joint in model.findall("joint"):
        child = (joint.findtext("child") or "").strip()
        if joint.get("type") != "revolute" or child != link:
            continue
        here = place.inside(f"joint '{joint.get('name')}'")
        world_from_joint = world_from_model @ frames.frame(joint.get("name") or "", here)
        axis = floats(joint.findtext("axis/xyz") or "0 0 1", 3, here.inside("<xyz>"))
        upright = float((world_from_joint[:3, :3] @ np.array(axis))[2]) / max(math.hypot(*axis), 1e-12)
        if abs(upright) < 0.99:
            continue  # a flap: it stays as it is
        swing = math.copysign(1.0, upright) * _widest(joint, here)
        return Hinge((float(world_from_joint[0, 3]), float(world_from_joint[1, 3])), swing)
    return None


def _widest(joint: ET.Element, place: Place) -> float:
    """The limit that is farther from closed, a right angle where there is none."""
    limits = []
    for tag in ("lower", "upper"):
        text = joint.findtext(f"axis/limit/{tag}")
        limits.append(floats(text, 1, place.inside(f"<{tag}>"))[0] if text else 0.0)
    widest = max(limits, key=lambda limit: (abs(limit), limit))
    if widest == 0.0 or abs(widest) > math.pi:
        return math.copysign(SWING, widest)
    return widest
