"""Doors of an SDF model: a link with a door's name, on a revolute joint about a vertical axis."""

from __future__ import annotations

import math
from dataclasses import dataclass
from xml.etree import ElementTree as ET

import numpy as np

from rosbot_patrol.simulation.actors.doors import SWING
from rosbot_patrol.simulation.scene.scene import Matrix, identity
from rosbot_patrol.simulation.sdf.frames import Frames
from rosbot_patrol.simulation.sdf.values import Place, floats, is_true


@dataclass(frozen=True)
class Hinge:
    """Position of a door's axis, x, y [m], and its opening angle [rad], counter-clockwise positive."""

    axis: tuple[float, float]
    swing: float


def read_hinge(model: ET.Element, link: str, frames: Frames, world_from_model: Matrix, place: Place) -> Hinge | None:
    """Read the hinge of a link, None if the link is no door or has no such joint.

    Args:
        model: the <model>.
        link: name of the link.
        frames: frames of the model.
        world_from_model: pose of the model that puts the link at its place in the world.
        place: position of the link in the file, for messages.

    Raises:
        WorldError: a number of the joint is invalid.
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
        world_from_axis = world_from_model @ _frame_of_axis(joint, frames, here)
        upright = float((world_from_axis[:3, :3] @ np.array(axis))[2]) / max(math.hypot(*axis), 1e-12)
        widest = _widest(joint, here)
        if abs(upright) < 0.99 or widest == 0.0:
            continue  # a flap, or locked: it stays closed
        swing = math.copysign(1.0, upright) * widest
        return Hinge((float(world_from_joint[0, 3]), float(world_from_joint[1, 3])), swing)
    return None


def carried_by(model: ET.Element, link: str) -> list[str]:
    """Links attached to another one by joints of any kind, such as handles to a door's leaf."""
    carried: list[str] = []
    waiting = [link]
    while waiting:
        parent = waiting.pop()
        for joint in model.findall("joint"):
            child = (joint.findtext("child") or "").strip()
            if (joint.findtext("parent") or "").strip() == parent and child not in (link, *carried):
                carried.append(child)
                waiting.append(child)
    return carried


def _frame_of_axis(joint: ET.Element, frames: Frames, place: Place) -> Matrix:
    """model_from_axis: the frame of the joint, or, in SDF 1.5 or 1.7, of the model or another frame."""
    axis = joint.find("axis")
    if axis is not None and is_true(axis.findtext("use_parent_model_frame")):
        return identity()
    named = joint.find("axis/xyz")
    other = named.get("expressed_in") if named is not None else None
    return frames.frame(other or joint.get("name") or "", place)


def _widest(joint: ET.Element, place: Place) -> float:
    """The limit that is farther from closed, a right angle without limits, 0 if it cannot move."""
    texts = {tag: joint.findtext(f"axis/limit/{tag}") for tag in ("lower", "upper")}
    limits = [floats(text, 1, place.inside(f"<{tag}>"))[0] if text else 0.0 for tag, text in texts.items()]
    widest = max(limits, key=lambda limit: (abs(limit), limit))
    if widest == 0.0 and all(texts.values()):
        return 0.0
    if widest == 0.0 or abs(widest) > math.pi:
        return math.copysign(SWING, widest)
    return widest
