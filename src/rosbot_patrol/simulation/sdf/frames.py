"""Frames of a model or world, by which poses are relative to each other (SDF 1.7; attribute `frame` in 1.5)."""

from __future__ import annotations

import logging
from xml.etree import ElementTree as ET

import numpy as np

from rosbot_patrol.simulation.scene.scene import Matrix, identity
from rosbot_patrol.simulation.sdf.values import Place, pose_of

log = logging.getLogger(__name__)

_HERE = ("", "__model__", "world")


class Frames:
    """The named elements of one model or world, each with its pose in that model or world.

    Args:
        element: the <model> or <world>.
        place: position of the element in the file.
    """

    def __init__(self, element: ET.Element, place: Place) -> None:
        self._place = place
        self._named: dict[str, ET.Element] = {}
        for child in element:
            if child.tag in ("link", "frame", "joint", "model", "include"):
                name = child.get("name") or (child.findtext("name") or "").strip()
                self._named.setdefault(name, child)
        self._known: dict[str, Matrix] = {}
        self._pending: list[str] = []

    def pose(self, child: ET.Element, place: Place, default: str = "") -> Matrix:
        """Pose of an element relative to `default`, "" for this model, unless its <pose> names another frame.

        Raises:
            WorldError: the pose is invalid, or the frames form a cycle.
        """
        own = pose_of(child, place)
        element = child.find("pose")
        other = default
        if element is not None:
            other = element.get("relative_to") or element.get("frame") or default
        if not self.knows(other):
            log.warning(
                "%s: %s: the pose is relative to '%s', which is not known; read as relative to its parent",
                place.path, place.where, other,
            )  # fmt: skip
            other = default if self.knows(default) else ""
        placement = child.get("placement_frame") or child.findtext("placement_frame")
        if child.tag == "model" and placement:
            own = own @ np.linalg.inv(Frames(child, place).frame(placement.strip(), place))
        return self.frame(other, place) @ own if other not in _HERE else own

    def frame(self, name: str, place: Place) -> Matrix:
        """Pose of a named frame; raises WorldError if the name is unknown, or frames form a cycle."""
        if name in _HERE:
            return identity()
        if not self.knows(name):
            raise place.error(f"there is no frame '{name}'")
        if name not in self._known:
            if name in self._pending:
                circle = " -> ".join([*self._pending[self._pending.index(name) :], name])
                raise place.error(f"the frames are relative to each other in a circle: {circle}")
            self._pending.append(name)
            self._known[name] = self._resolve(name, place)
            self._pending.pop()
        return self._known[name]

    def knows(self, name: str) -> bool:
        """Whether there is a frame of that name."""
        outer, _, inner = name.partition("::")
        return name in _HERE or name in self._named or bool(inner and self._inner(outer).knows(inner))

    def _inner(self, model: str) -> Frames:
        element = self._named.get(model)
        if element is None or element.tag != "model":
            element = ET.Element("model")  # the frames of an included model are not read
        return Frames(element, self._place.inside(f"model '{model}'"))

    def _resolve(self, name: str, place: Place) -> Matrix:
        if name not in self._named:
            outer, _, inner = name.partition("::")
            return self.frame(outer, place) @ self._inner(outer).frame(inner, place)
        element = self._named[name]
        default = ""
        if element.tag == "frame":
            default = element.get("attached_to") or ""
        elif element.tag == "joint":
            default = (element.findtext("child") or "").strip()
        return self.pose(element, self._place.inside(f"{element.tag} '{name}'"), default)
