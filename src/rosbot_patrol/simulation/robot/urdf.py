"""Reader of URDF: links with their shapes, joints with their axes, and the tree that they form.

Meshes are found by ROS's and Gazebo's names (package://, model://, file://, or a path beside the file). One that is
missing or broken is left out, as in Gazebo; a link without any other visual shows its collision shapes. Of the <gazebo>
extensions only the sensors and the joints of a differential or skid-steer drive are read.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np

from rosbot_patrol.counts import count_of
from rosbot_patrol.errors import WorldError
from rosbot_patrol.simulation.meshes.files import load_parts
from rosbot_patrol.simulation.scene.matrices import from_xyz_rpy
from rosbot_patrol.simulation.scene.scene import Collision, Material, Matrix, Shape, Visual, identity

FindPackage = Callable[[str], Path | None]
Rgba = tuple[float, float, float, float]

_GREY: Rgba = (0.5, 0.5, 0.5, 1.0)


@dataclass(frozen=True, kw_only=True)
class Link:
    """A link: its visuals and collisions, in its own frame, and its mass [kg]."""

    name: str
    visuals: tuple[Visual, ...]
    collisions: tuple[Collision, ...]
    mass: float


@dataclass(frozen=True, kw_only=True)
class Joint:
    """A joint: the pose of its child on its parent with the joint at zero, and its axis in the child's frame.

    Attributes:
        kind: fixed, continuous, revolute, prismatic, floating or planar.
        axis: shape (3,), None if the file gives none.
    """

    name: str
    kind: str
    parent: str
    child: str
    pose: Matrix
    axis: tuple[float, ...] | None


@dataclass(frozen=True, kw_only=True)
class SensorTag:
    """A <sensor> of a <gazebo> extension.

    Attributes:
        kind: its type.
        link: its link; pose: its place there.
        frame: of its messages, "" for the link's.
        fan: angle between its outermost beams [rad], a full turn if the file does not say.
    """

    kind: str
    link: str
    pose: Matrix
    frame: str
    fan: float = math.tau


@dataclass(frozen=True, kw_only=True)
class Urdf:
    """A robot's links and joints.

    Attributes:
        root: the link without a parent joint.
        sensors: those of the <gazebo> extensions.
        lost: a sentence for each mesh that cannot be used.
        drive: joints of a drive plug-in, left and right.
    """

    name: str
    root: str
    links: dict[str, Link]
    joints: tuple[Joint, ...]
    sensors: tuple[SensorTag, ...]
    lost: tuple[str, ...] = ()
    drive: tuple[tuple[str, ...], tuple[str, ...]] = ((), ())

    def frames(self) -> dict[str, Matrix]:
        """root_from_link of every link, with all joints at zero."""
        below: dict[str, list[Joint]] = {}
        for joint in self.joints:
            below.setdefault(joint.parent, []).append(joint)
        frames, todo = {self.root: identity()}, [self.root]
        while todo:
            parent = todo.pop()
            for joint in below.get(parent, []):
                frames[joint.child] = frames[parent] @ joint.pose
                todo.append(joint.child)
        return frames


def read_urdf(text: str, source: str, find_package: FindPackage) -> Urdf:
    """Read the links and joints of a URDF text.

    Args:
        text: the URDF (expanded, no xacro).
        source: origin of the text, for messages; a mesh's relative path starts in its folder.
        find_package: folder of a package or model by name, None if it is unknown.

    Raises:
        WorldError: it is not URDF, its joints form no tree, or a number is invalid.
    """
    try:
        root = ET.fromstring(text)
    except ET.ParseError as err:
        raise WorldError(source, f"is not XML: {err}") from err
    if root.tag != "robot":
        raise WorldError(source, f"is no URDF, its first element is <{root.tag}>")
    return _Reader(source, root, find_package).read()


@dataclass
class _Reader:
    source: str
    root: ET.Element
    find_package: FindPackage
    colours: dict[str, Rgba] = field(default_factory=dict)
    lost: dict[str, None] = field(default_factory=dict)

    def read(self) -> Urdf:
        for material in self.root.findall("material"):
            self._colour(material)
        links = {link.get("name", ""): self._link(link) for link in self.root.findall("link")}
        if not links:
            raise WorldError(self.source, "has no links")
        joints = tuple(self._joint(joint, links) for joint in self.root.findall("joint"))
        carried = {joint.child for joint in joints}
        roots = [name for name in links if name not in carried]
        if len(roots) != 1:
            raise WorldError(self.source, f"its joints form no single tree (roots: {', '.join(roots) or 'none'})")
        urdf = Urdf(
            name=self.root.get("name", "robot"),
            root=roots[0],
            links=links,
            joints=joints,
            sensors=tuple(self._sensors(links)),
            lost=tuple(self.lost),
            drive=(self._driven("left", joints), self._driven("right", joints)),
        )
        lost = set(links) - set(urdf.frames())
        if lost:
            raise WorldError(self.source, f"its joints form no single tree, they go round at '{min(lost)}'")
        return urdf

    def _link(self, element: ET.Element) -> Link:
        name = element.get("name", "")
        collisions = [
            Collision(shape=shape, pose=self._origin(e)) for e in element.findall("collision")
            for shape, _ in self._shapes(e, name)
        ]  # fmt: skip
        listed = element.findall("visual")
        visuals = [v for e in listed for v in self._visuals(e, name)]
        if listed and not visuals:
            visuals = [Visual(shape=c.shape, pose=c.pose, material=Material(rgba=_GREY)) for c in collisions]
        mass = element.find("inertial/mass")
        weight = self._numbers(mass.get("value", "0"), 1, f"link '{name}', mass")[0] if mass is not None else 0.0
        return Link(name=name, visuals=tuple(visuals), collisions=tuple(collisions), mass=weight)

    def _joint(self, element: ET.Element, links: dict[str, Link]) -> Joint:
        name = element.get("name", "")
        ends = []
        for end in ("parent", "child"):
            found = element.find(end)
            if found is None:
                raise WorldError(self.source, f"joint '{name}' has no <{end}>")
            link = found.get("link", "")
            if link not in links:
                raise WorldError(self.source, f"joint '{name}' names the link '{link}', which is not there")
            ends.append(link)
        axis = element.find("axis")
        return Joint(
            name=name,
            kind=element.get("type", "fixed"),
            parent=ends[0],
            child=ends[1],
            pose=self._origin(element),
            axis=None if axis is None else self._numbers(axis.get("xyz", "1 0 0"), 3, f"joint '{name}', axis"),
        )

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
            raise WorldError(self.source, f"{where}: expected {count_of(count, 'number')}, got '{text}'")
        return values

    def _visuals(self, element: ET.Element, link: str) -> list[Visual]:
        material = element.find("material")
        given = self._colour(material) if material is not None else None
        pose = self._origin(element)
        return [
            Visual(shape=shape, pose=pose, material=Material(rgba=given or own or _GREY))
            for shape, own in self._shapes(element, link)
        ]

    def _shapes(self, element: ET.Element, link: str) -> list[tuple[Shape, Rgba | None]]:
        """The shapes of a <visual> or <collision>, with a mesh's own colours."""
        geometry = element.find("geometry")
        found = next(iter(geometry), None) if geometry is not None else None
        if found is None:
            raise WorldError(self.source, f"link '{link}' has a shape without geometry")
        where = f"link '{link}', {found.tag}"
        radius, length = found.get("radius", ""), found.get("length", "")
        if found.tag == "box":
            return [(Shape(kind="box", size=self._sizes(found.get("size", ""), 3, f"{where} size")), None)]
        if found.tag == "cylinder":
            return [(Shape(kind="cylinder", size=self._sizes(f"{radius} {length}", 2, where)), None)]
        if found.tag == "capsule":
            return [(Shape(kind="capsule", size=self._sizes(f"{radius} {length}", 2, where)), None)]
        if found.tag == "sphere":
            return [(Shape(kind="sphere", size=self._sizes(radius, 1, where)), None)]
        if found.tag == "mesh":
            return self._mesh(found, where)
        raise WorldError(self.source, f"link '{link}' has the unknown geometry <{found.tag}>")

    def _sizes(self, text: str, count: int, where: str) -> tuple[float, ...]:
        sizes = self._numbers(text, count, where)
        if min(sizes) < 0.0:
            raise WorldError(self.source, f"{where}: '{text}' is a negative size")
        return sizes

    def _mesh(self, element: ET.Element, where: str) -> list[tuple[Shape, Rgba | None]]:
        name = element.get("filename", "")
        scale = self._numbers(element.get("scale", "1 1 1"), 3, f"{where} scale")
        try:
            parts = load_parts(self._find(name))
        except WorldError as err:
            self.lost[f"{self.source}: {where} '{name}': {err}"] = None
            return []
        return [(Shape(kind="mesh", size=scale, vertices=part.vertices, faces=part.faces), part.rgba) for part in parts]

    def _find(self, name: str) -> Path:
        scheme, separator, rest = name.partition("://")
        if not separator:
            return Path(self.source).parent / name
        if scheme == "file":
            return Path(rest)
        package, _, inner = rest.partition("/")
        folder = self.find_package(package) or _enclosing(Path(self.source), package)
        if folder is None:
            raise WorldError(f"package '{package}'", "is not found")
        return folder / inner

    def _colour(self, material: ET.Element) -> Rgba | None:
        colour = material.find("color")
        name = material.get("name", "")
        if colour is not None:
            v = self._numbers(colour.get("rgba", ""), 4, f"material '{name}'")
            self.colours[name] = (v[0], v[1], v[2], v[3])
        return self.colours.get(name)

    def _sensors(self, links: dict[str, Link]) -> list[SensorTag]:
        found = []
        for extension in self.root.findall("gazebo"):
            link = extension.get("reference", "")
            for sensor in extension.findall("sensor") if link in links else ():
                text = sensor.findtext("pose", "").strip() or "0 0 0 0 0 0"
                where = f"sensor '{sensor.get('name', '')}'"
                numbers = self._numbers(text, 6, f"{where}, pose")
                frame = (sensor.findtext("plugin/frameName") or sensor.findtext("plugin/frame_name") or "").strip()
                found.append(
                    SensorTag(
                        kind=sensor.get("type", ""),
                        link=link,
                        pose=from_xyz_rpy(numbers[:3], numbers[3:]),
                        frame=frame.lstrip("/"),
                        fan=self._fan(sensor, where),
                    )
                )
        return found

    def _fan(self, sensor: ET.Element, where: str) -> float:
        """Angle between the outermost beams of a <ray> sensor [rad]."""
        scan = next(sensor.iter("horizontal"), None)
        low, high = (scan.findtext(f"{end}_angle") if scan is not None else None for end in ("min", "max"))
        if low is None or high is None:
            return math.tau
        (first,), (last,) = (self._numbers(text.strip(), 1, f"{where}, angle") for text in (low, high))
        return abs(last - first)

    def _driven(self, side: str, joints: tuple[Joint, ...]) -> tuple[str, ...]:
        """Joints that the drive plug-in names for a side (leftJoint, leftFrontJoint, front_left_joint, ...)."""
        known = {joint.name for joint in joints}
        named = [
            (e.text or "").strip()
            for e in self.root.iterfind("gazebo/plugin/*")
            if side in e.tag.lower() and e.tag.lower().endswith("joint")
        ]
        return tuple(dict.fromkeys(name for name in named if name in known))


def lateral(frame: Matrix, axis: tuple[float, ...] | None) -> float:
    """Leftward component of an axis given in a frame: 1 left, -1 right; 1 if it is not given."""
    if axis is None:
        return 1.0
    direction = frame[:3, :3] @ np.asarray(axis, float)
    return float(direction[1] / max(float(np.linalg.norm(direction)), 1e-9))


def _enclosing(path: Path, package: str) -> Path | None:
    """The folder of that name above a file."""
    return next((folder for folder in path.resolve().parents if folder.name == package), None)
