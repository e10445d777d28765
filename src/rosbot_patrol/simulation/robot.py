"""The robot as its URDF describes it: shapes, wheels, mass, and where each frame sits on the base.

Frames joined by fixed joints are placed at once; wheels are the continuous joints. The planar position of a frame is
taken with all joints at zero.
"""

from __future__ import annotations

import logging
import math
from dataclasses import dataclass, field
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np

from rosbot_patrol.errors import WorldError
from rosbot_patrol.simulation.matrices import from_xyz_rpy
from rosbot_patrol.simulation.scene import Body, Collision, Material, Matrix, Shape, Visual, identity

log = logging.getLogger(__name__)


@dataclass(frozen=True, kw_only=True)
class Wheel:
    """A driven wheel: its joint, radius [m] and where its joint sits on the base [m]."""

    joint: str
    radius: float
    x: float
    y: float
    contact_y: float


@dataclass(frozen=True, kw_only=True)
class RobotDescription:
    """What the simulator needs of a URDF.

    Attributes:
        frames: base_from_frame of every link, shape (4, 4) each.
        wheels: the driven wheels, in the order of the file.
        body: visuals and collisions in the frame of the base.
        mass: of everything [kg].
    """

    name: str
    base: str
    frames: dict[str, Matrix]
    wheels: tuple[Wheel, ...]
    body: Body
    mass: float

    @property
    def axle_height(self) -> float:
        """Height of the base's frame above the floor [m]."""
        return max((w.radius for w in self.wheels), default=0.04)

    @property
    def track(self) -> float:
        """Distance between the contact lines of left and right wheels [m]."""
        sides = [w.contact_y for w in self.wheels]
        return max(sides) - min(sides)

    def frame(self, name: str) -> Matrix:
        """base_from_frame; raises WorldError where the robot has no such frame."""
        if name not in self.frames:
            raise WorldError(f"robot '{self.name}'", f"has no link '{name}', which a sensor needs")
        return self.frames[name]


def load_robot(path: str | Path) -> RobotDescription:
    """Read a URDF file; raises WorldError."""
    try:
        text = Path(path).read_text(encoding="utf-8")
    except OSError as err:
        raise WorldError(path, f"cannot be read: {err.strerror}") from err
    except UnicodeDecodeError as err:
        raise WorldError(path, f"is no text in UTF-8 ({err.reason} at byte {err.start})") from err
    return parse_robot(text, source=str(path))


def parse_robot(text: str, *, source: str = "robot_description") -> RobotDescription:
    """Read a URDF text.

    Args:
        text: the URDF (expanded, no xacro).
        source: where it comes from, for messages.

    Raises:
        WorldError: it is no URDF, its joints form no tree, or it has no wheels.
    """
    try:
        root = ET.fromstring(text)
    except ET.ParseError as err:
        raise WorldError(source, f"is not XML: {err}") from err
    if root.tag != "robot":
        raise WorldError(source, f"is no URDF, its first element is <{root.tag}>")
    return _Parser(source, root).parse()


@dataclass
class _Parser:
    source: str
    root: ET.Element
    colours: dict[str, tuple[float, float, float, float]] = field(default_factory=dict)

    def parse(self) -> RobotDescription:
        links = {link.get("name", ""): link for link in self.root.findall("link")}
        if not links:
            raise WorldError(self.source, "has no links")
        joints = [j for j in self.root.findall("joint") if j.find("parent") is not None and j.find("child") is not None]
        base, frames = self._place(links, joints)
        for material in self.root.findall("material"):
            self._remember(material)
        visuals: list[Visual] = []
        collisions: list[Collision] = []
        for name, link in links.items():
            visuals += [v for e in link.findall("visual") if (v := self._visual(e, frames[name], name))]
            collisions += [c for e in link.findall("collision") if (c := self._collision(e, frames[name], name))]
        wheels = tuple(self._wheel(j, links, frames) for j in joints if j.get("type") == "continuous")
        if not wheels:
            raise WorldError(self.source, "has no continuous joint, so no wheels to drive by")
        if not any(w.y > 0 for w in wheels) or not any(w.y < 0 for w in wheels):
            raise WorldError(self.source, "has wheels on one side only")
        name = self.root.get("name", "robot")
        masses = [float(e.get("value", 0.0)) for e in self.root.findall("link/inertial/mass")]
        body = Body(name=name, kind="robot", static=False, visuals=tuple(visuals), collisions=tuple(collisions))
        return RobotDescription(name=name, base=base, frames=frames, wheels=wheels, body=body, mass=sum(masses) or 5.0)

    def _place(self, links: dict[str, ET.Element], joints: list[ET.Element]) -> tuple[str, dict[str, Matrix]]:
        below: dict[str, list[tuple[str, Matrix]]] = {}
        children = set()
        for joint in joints:
            parent, child = _link_of(joint, "parent"), _link_of(joint, "child")
            for end in (parent, child):
                if end not in links:
                    name = joint.get("name")
                    raise WorldError(self.source, f"joint '{name}' names the link '{end}', which is not there")
            below.setdefault(parent, []).append((child, self._origin(joint)))
            children.add(child)
        roots = [name for name in links if name not in children]
        if len(roots) != 1:
            raise WorldError(self.source, f"its joints form no single tree (roots: {', '.join(roots) or 'none'})")
        base = "base_link" if "base_link" in links else roots[0]
        frames = {roots[0]: identity()}
        todo = [roots[0]]
        while todo:
            parent = todo.pop()
            for child, offset in below.get(parent, []):
                frames[child] = frames[parent] @ offset
                todo.append(child)
        base_from_root = np.linalg.inv(frames[base])
        return base, {name: base_from_root @ pose for name, pose in frames.items()}

    def _origin(self, element: ET.Element) -> Matrix:
        origin = element.find("origin")
        if origin is None:
            return identity()
        xyz = self._numbers(origin.get("xyz", "0 0 0"), 3, "<origin xyz>")
        return from_xyz_rpy(xyz, self._numbers(origin.get("rpy", "0 0 0"), 3, "<origin rpy>"))

    def _numbers(self, text: str, count: int, where: str) -> tuple[float, ...]:
        try:
            values = tuple(float(w) for w in text.split())
        except ValueError:
            values = ()
        if len(values) != count or not all(map(math.isfinite, values)):
            raise WorldError(self.source, f"{where}: expected {count} numbers, got '{text}'")
        return values

    def _shape(self, element: ET.Element, link: str) -> Shape | None:
        geometry = element.find("geometry")
        found = next(iter(geometry), None) if geometry is not None else None
        if found is None:
            raise WorldError(self.source, f"link '{link}' has a shape without geometry")
        if found.tag == "box":
            return Shape(kind="box", size=self._numbers(found.get("size", ""), 3, f"link '{link}', box size"))
        radius, length = found.get("radius", ""), found.get("length", "")
        if found.tag == "cylinder":
            return Shape(kind="cylinder", size=self._numbers(f"{radius} {length}", 2, f"link '{link}', cylinder"))
        if found.tag == "sphere":
            return Shape(kind="sphere", size=self._numbers(radius, 1, f"link '{link}', sphere"))
        log.info("%s: link '%s': %s left out", self.source, link, found.tag)
        return None

    def _visual(self, element: ET.Element, base_from_link: Matrix, link: str) -> Visual | None:
        shape = self._shape(element, link)
        if shape is None:
            return None
        material = element.find("material")
        rgba = self._remember(material) if material is not None else (0.5, 0.5, 0.5, 1.0)
        return Visual(shape=shape, pose=base_from_link @ self._origin(element), material=Material(rgba=rgba))

    def _collision(self, element: ET.Element, base_from_link: Matrix, link: str) -> Collision | None:
        shape = self._shape(element, link)
        return None if shape is None else Collision(shape=shape, pose=base_from_link @ self._origin(element))

    def _remember(self, material: ET.Element) -> tuple[float, float, float, float]:
        colour = material.find("color")
        name = material.get("name", "")
        if colour is not None:
            v = self._numbers(colour.get("rgba", ""), 4, f"material '{name}'")
            self.colours[name] = (v[0], v[1], v[2], v[3])
        return self.colours.get(name, (0.5, 0.5, 0.5, 1.0))

    def _wheel(self, joint: ET.Element, links: dict[str, ET.Element], frames: dict[str, Matrix]) -> Wheel:
        child = _link_of(joint, "child")
        link = links[child]
        pose = frames[child]
        parts = [(e, s) for e in link.findall("collision") if (s := self._shape(e, child)) and s.kind != "box"]
        radius = parts[0][1].size[0] if parts else 0.04
        contact = pose @ self._origin(parts[0][0]) if parts else pose
        return Wheel(
            joint=joint.get("name", child),
            radius=radius,
            x=float(pose[0, 3]),
            y=float(pose[1, 3]),
            contact_y=float(contact[1, 3]),
        )


def _link_of(joint: ET.Element, end: str) -> str:
    element = joint.find(end)
    return "" if element is None else element.get("link", "")
