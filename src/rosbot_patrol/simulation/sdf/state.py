"""The <state> of a world: poses and sizes of models and links when Gazebo saved it, and insertions and deletions."""

from __future__ import annotations

from dataclasses import dataclass, field
from xml.etree import ElementTree as ET

from rosbot_patrol.simulation.scene.scene import Matrix
from rosbot_patrol.simulation.sdf.values import Place, floats, pose_of

Scale = tuple[float, float, float]


@dataclass
class State:
    """Poses and scales by "model", "model::inner" and "model/link", all in the world frame.

    Attributes:
        poses: poses of models and links.
        scales: scales of models.
        inserted: elements of models that were added while Gazebo ran.
        deleted: names of models that were removed.
    """

    poses: dict[str, Matrix] = field(default_factory=dict)
    scales: dict[str, Scale] = field(default_factory=dict)
    inserted: list[ET.Element] = field(default_factory=list)
    deleted: set[str] = field(default_factory=set)

    def read(self, element: ET.Element, place: Place) -> None:
        """Read a <state>; raises WorldError if a number is invalid."""
        for model in element.findall("model"):
            self._model(model, "", place)
        for inserted in element.findall("insertions"):
            self.inserted += inserted.findall("model")
        self.deleted |= {(name.text or "").strip() for name in element.findall("deletions/name")}

    def _model(self, element: ET.Element, outer: str, place: Place) -> None:
        name = outer + element.get("name", "").removeprefix(outer)
        here = place.inside(f"state of model '{name}'")
        if element.find("pose") is not None:
            self.poses[name] = pose_of(element, here)
        scale = element.findtext("scale")
        if scale:
            x, y, z = floats(scale, 3, here.inside("<scale>"))
            if min(x, y, z) <= 0.0:
                raise here.inside("<scale>").error(f"expected positive numbers, got '{scale.strip()}'")
            self.scales[name] = (x, y, z)
        for link in element.findall("link"):
            if link.find("pose") is not None:
                label = link.get("name", "")
                label = label.removeprefix(f"{element.get('name')}::")  # in files of Gazebo before version 3
                pose = pose_of(link, here.inside(f"link '{label}'"))
                inner, _, last = label.rpartition("::")
                self.poses[f"{name}/{label}"] = pose
                if inner:
                    self.poses.setdefault(f"{name}::{inner}/{last}", pose)
        for inner_model in element.findall("model"):
            self._model(inner_model, f"{name}::", place)
