"""A simulated world: the bodies of an SDF file (1.4 to 1.7, as Gazebo classic writes them), and who walks about in it.

Read: models, nested ones too, links, poses and the frames they are relative to, <include> on a search path, the
<state> that overrides poses and sizes, box, cylinder, sphere, plane and mesh geometry, materials as colours. A model
whose name, uri or mesh speaks of a person or a fire hydrant becomes an actor, and so does an <actor>.

Differs: every model is static (what Gazebo would push aside stands fast here); joints hold, but for a door's hinge
(`sdf_doors`), which a service moves; lights, plugins, sensors and physics settings are skipped. What is not read is
named once in a warning.
"""

from __future__ import annotations

import itertools
import logging
import re
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path
from xml.etree import ElementTree as ET

from rosbot_patrol.errors import WorldError
from rosbot_patrol.geometry import Pose2D, distance
from rosbot_patrol.simulation.doors import DoorPlace
from rosbot_patrol.simulation.matrices import to_pose2d
from rosbot_patrol.simulation.scene import Body, BodyKind, Collision, Material, Matrix, Shape, Visual, identity
from rosbot_patrol.simulation.sdf_doors import read_hinge
from rosbot_patrol.simulation.sdf_files import ModelPath, model_file
from rosbot_patrol.simulation.sdf_frames import Frames
from rosbot_patrol.simulation.sdf_shapes import PLANE, Scale, ShapeReader
from rosbot_patrol.simulation.sdf_values import VERSIONS, Place, floats, pose_of, read_sdf

log = logging.getLogger(__name__)

_ACTOR_WORDS = {"person": "person", "pedestrian": "person", "hydrant": "fire_hydrant"}
_WALK_SPEED = 0.8  # of an actor whose waypoints tell no time [m/s]
_KNOWN = {
    "world": {"model", "include", "state", "actor", "frame"},
    "model": {"link", "model", "include", "frame", "joint", "pose", "static", "placement_frame"},
    "link": {"pose", "collision", "visual"},
    "include": {"uri", "name", "pose", "static", "placement_frame"},
    "actor": {"pose", "skin", "animation", "script", "link", "joint", "static"},
}
# Of Gazebo's own running, or of what moves: skipped without a word.
_WITHOUT_MEANING = {
    "gravity", "physics", "scene", "gui", "audio", "wind", "magnetic_field", "atmosphere", "spherical_coordinates",
    "inertial", "self_collide", "kinematic", "enable_wind", "allow_auto_disable", "velocity_decay", "must_be_base_link",
    "plugin_filename",
}  # fmt: skip
_ONES: Scale = (1.0, 1.0, 1.0)


@dataclass(frozen=True, kw_only=True)
class ActorPlace:
    """An actor that the world's file puts somewhere.

    Attributes:
        name: unique in the world.
        model: person or fire_hydrant.
        pose: where it stands at first.
        path: where it walks, () stays.
        speed: of the walk [m/s].
        loop: whether it walks round and round.
    """

    name: str
    model: str
    pose: Pose2D
    path: tuple[Pose2D, ...] = ()
    speed: float = 0.0
    loop: bool = False


@dataclass(frozen=True, kw_only=True)
class World:
    """Everything that stands in a world, the actors it begins with, and its doors on hinges."""

    name: str = "empty"
    bodies: tuple[Body, ...] = ()
    actors: tuple[ActorPlace, ...] = ()
    doors: tuple[DoorPlace, ...] = ()


def load_world(
    path: str | Path,
    model_path: Iterable[str | Path] = (),
    find_package: Callable[[str], Path | None] | None = None,
) -> World:
    """Read an SDF world.

    Args:
        path: the file.
        model_path: folders in which `model://NAME` is looked up, before `models` beside the file or its folder.
        find_package: the folder of a ROS package by name, where no folder has it.

    Raises:
        WorldError: the file cannot be read, is not SDF, or an element makes no sense; names file and element.
    """
    path = Path(path)
    folders = [*map(Path, model_path), path.parent / "models", path.parent.parent / "models"]
    reader = _Reader(path, ModelPath(tuple(folders), find_package))
    world = reader.read()
    if reader.lights:
        log.info("%s: %d lights are not simulated, the camera has its own", path, reader.lights)
    if reader.skipped:
        log.warning("%s: skipped, not simulated here: %s", path, ", ".join(sorted(reader.skipped)))
    return world


@dataclass
class _State:
    """What <state> says: poses and scales by "model", "model::inner" and "model/link", all against the world."""

    poses: dict[str, Matrix] = field(default_factory=dict)
    scales: dict[str, Scale] = field(default_factory=dict)
    inserted: list[ET.Element] = field(default_factory=list)
    deleted: set[str] = field(default_factory=set)

    def read(self, element: ET.Element, place: Place) -> None:
        for model in element.findall("model"):
            self._model(model, "", place)
        for inserted in element.findall("insertions"):
            self.inserted += inserted.findall("model")
        self.deleted |= {(name.text or "").strip() for name in element.findall("deletions/name")}

    def _model(self, element: ET.Element, outer: str, place: Place) -> None:
        name = outer + element.get("name", "")
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
                self.poses[f"{name}/{label}"] = pose_of(link, here.inside(f"link '{label}'"))
        for inner in element.findall("model"):
            self._model(inner, f"{name}::", place)


@dataclass
class _Reader:
    path: Path
    model_path: ModelPath
    skipped: set[str] = field(default_factory=set)
    lights: int = 0
    bodies: list[Body] = field(default_factory=list)
    actors: list[ActorPlace] = field(default_factory=list)
    doors: list[DoorPlace] = field(default_factory=list)
    state: _State = field(default_factory=_State)
    files: dict[Path, ET.Element] = field(default_factory=dict)
    including: list[Path] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.shapes = ShapeReader(self.model_path, self.skipped)

    def read(self) -> World:
        place = Place(self.path)
        world = self._parse(self.path).find("world")
        if world is None:
            raise WorldError(self.path, "has no <world> element")
        for element in world.findall("state"):
            self.state.read(element, place)
        frames = Frames(world, place)
        self._note_skipped(world)
        for child in (*world, *self.state.inserted):
            self._child(child, place, frames, identity(), "")
        self._check_names()
        return World(
            name=world.get("name", "world"),
            bodies=tuple(self.bodies),
            actors=tuple(self.actors),
            doors=tuple(self.doors),
        )

    def _child(self, child: ET.Element, place: Place, frames: Frames, world_from_outer: Matrix, outer: str) -> None:
        if child.tag == "model":
            name = child.get("name")
            if not name:
                raise place.error("a <model> has no name")
            here = place.inside(f"model '{name}'")
            self._model(child, here, world_from_outer @ frames.pose(child, here), outer + name)
        elif child.tag == "include":
            self._include(child, place, frames, world_from_outer, outer)
        elif child.tag == "actor":
            self._actor(child, place.inside(f"actor '{child.get('name')}'"), world_from_outer)

    def _check_names(self) -> None:
        counted = Counter(
            [b.name for b in self.bodies] + [a.name for a in self.actors] + [d.body.name for d in self.doors]
        )
        twice = [name for name, count in counted.items() if count > 1]
        if twice:
            raise WorldError(self.path, f"the name '{twice[0]}' is used twice")

    def _parse(self, path: Path) -> ET.Element:
        if path not in self.files:
            root = self.files[path] = read_sdf(path)
            if root.get("version") not in VERSIONS:
                log.warning("%s: SDF version %s, read as 1.7", path, root.get("version", "is not named"))
        return self.files[path]

    def _include(self, element: ET.Element, place: Place, frames: Frames, world_from_outer: Matrix, outer: str) -> None:
        self._note_skipped(element)
        uri = (element.findtext("uri") or "").strip()
        if not uri:
            raise place.error("an <include> has no <uri>")
        here = place.inside(f"<include> of {uri}")
        short = re.sub(r"^\w+://", "", uri).strip("/")
        if short == "sun":
            self.lights += 1
            return
        given = (element.findtext("name") or "").strip()
        world_from_model = world_from_outer @ frames.pose(element, here)
        if self._is_actor(outer + (given or short), (given, short), world_from_model):
            return
        try:
            file = model_file(self.model_path.find(uri, place.path.parent, here), here)
        except WorldError:
            if short != "ground_plane":
                raise
            self.bodies.append(_floor(outer + (given or short)))
            return
        if file in self.including or file == self.path:
            chain = " -> ".join(p.parent.name for p in (*self.including, file))
            raise here.error(f"the models include each other in a circle: {chain}")
        found = self._parse(file).find("model")
        if found is None:
            raise WorldError(file, "has no <model> element")
        name = given or found.get("name") or short
        self.including.append(file)
        inside = Place(file, f"model '{name}'")
        placement = element.findtext("placement_frame")
        if placement:
            world_from_model = world_from_model @ _inverse(Frames(found, inside).frame(placement.strip(), inside))
        elif element.find("pose") is None:
            world_from_model = world_from_model @ pose_of(found, inside)
        self._model(found, inside, world_from_model, outer + name)
        self.including.pop()

    def _is_actor(self, name: str, words: Iterable[str], pose: Matrix) -> bool:
        text = set(re.split(r"[^a-z]+", " ".join(words).lower()))
        kind = next((kind for word, kind in _ACTOR_WORDS.items() if word in text), None)
        if kind is None:
            return False
        pose = self.state.poses.get(name, pose)
        if name not in self.state.deleted:
            self.actors.append(ActorPlace(name=name, model=kind, pose=to_pose2d(pose)))
        return True

    def _model(self, element: ET.Element, place: Place, world_from_model: Matrix, name: str) -> None:
        if name in self.state.deleted:
            return
        world_from_model = self.state.poses.get(name, world_from_model)
        meshes = {Path(uri.text or "").parts[1:2] for uri in element.iterfind("link/visual/geometry/mesh/uri")}
        if self._is_actor(name, (name, *(part for parts in meshes for part in parts)), world_from_model):
            return
        self._note_skipped(element)
        frames = Frames(element, place)
        links = element.findall("link")
        for link in links:
            label = link.get("name") or "link"
            here = place.inside(f"link '{label}'")
            model_from_link = frames.pose(link, here)
            pose = self.state.poses.get(f"{name}/{label}", world_from_model @ model_from_link)
            body_name = name if len(links) == 1 else f"{name}/{label}"
            body = self._link(link, here, frames, _inverse(model_from_link), self.state.scales.get(name, _ONES))
            kind = _kind_of(name, label, body.collisions)
            hinge = read_hinge(element, label, frames, pose @ _inverse(model_from_link), here)
            placed = replace(body, name=body_name, kind=kind, pose=pose, static=hinge is None)
            if hinge is None or not body.collisions:
                self.bodies.append(placed)
            else:
                self.doors.append(DoorPlace(body=replace(placed, kind="door"), axis=hinge.axis, swing=hinge.swing))
        for child in element:
            self._child(child, place, frames, world_from_model, f"{name}::")

    def _link(self, element: ET.Element, place: Place, frames: Frames, link_from_model: Matrix, scale: Scale) -> Body:
        """What a link shows and what of it stops the robot."""
        self._note_skipped(element)
        visuals: list[Visual] = []
        collisions: list[Collision] = []
        for part in element:
            if part.tag not in ("visual", "collision"):
                continue
            here = place.inside(f"{part.tag} '{part.get('name')}'")
            pose = _part_pose(part, here, frames, link_from_model, element.get("name") or "")
            if part.tag == "visual":
                visuals += self.shapes.visuals(part, pose, here, scale)
            else:
                collisions += self.shapes.collisions(part, pose, here, scale)
        return Body(name="", visuals=tuple(visuals), collisions=tuple(collisions))

    def _actor(self, element: ET.Element, place: Place, world_from_outer: Matrix) -> None:
        """A walking person of Gazebo's: its first trajectory, at its mean speed."""
        self._note_skipped(element)
        name = element.get("name") or "actor"
        pose = to_pose2d(self.state.poses.get(name, world_from_outer @ pose_of(element, place)))
        points, times = [], []
        trajectory = element.find("script/trajectory")
        for i, waypoint in enumerate(trajectory.findall("waypoint") if trajectory is not None else ()):
            here = place.inside(f"waypoint {i}")
            points.append(to_pose2d(world_from_outer @ pose_of(waypoint, here)))
            times.append(floats(waypoint.findtext("time") or "0", 1, here.inside("<time>"))[0])
        way = sum(distance(a, b) for a, b in itertools.pairwise(points))
        if not points or way == 0.0:
            self.actors.append(ActorPlace(name=name, model="person", pose=points[0] if points else pose))
            return
        lasts = times[-1] - times[0]
        loops = (element.findtext("script/loop") or "true").strip().lower() in ("true", "1")
        self.actors.append(
            ActorPlace(
                name=name, model="person", pose=points[0], path=tuple(points), loop=loops,
                speed=way / lasts if lasts > 0.0 else _WALK_SPEED,
            )
        )  # fmt: skip

    def _note_skipped(self, element: ET.Element) -> None:
        self.lights += sum(child.tag == "light" for child in element)
        strange = {c.tag for c in element} - _KNOWN[element.tag] - _WITHOUT_MEANING - {"light"}
        of = "" if element.tag == "world" else f" of {'an' if element.tag[0] in 'ai' else 'a'} {element.tag}"
        # a colon marks a vendor's extension
        self.skipped.update(f"<{tag}>{of}" for tag in strange if ":" not in tag and "}" not in tag)


def _part_pose(part: ET.Element, place: Place, frames: Frames, link_from_model: Matrix, link: str) -> Matrix:
    """link_from_part."""
    element = part.find("pose")
    if element is not None and (element.get("relative_to") or element.get("frame")):
        return link_from_model @ frames.pose(part, place, link)
    return pose_of(part, place)


def _inverse(pose: Matrix) -> Matrix:
    turn = pose[:3, :3].T
    inverse = identity()
    inverse[:3, :3], inverse[:3, 3] = turn, -turn @ pose[:3, 3]
    return inverse


def _kind_of(model: str, link: str, collisions: Iterable[Collision]) -> BodyKind:
    text = f"{model} {link}".lower()
    if "ground_plane" in text or any(c.shape.kind == "plane" for c in collisions):
        return "floor"
    if "wall" in text:
        return "wall"
    if "door" in text:
        return "door"
    return "furniture"


def _floor(name: str) -> Body:
    shape = Shape(kind="plane", size=PLANE)
    look = Material(rgba=(0.55, 0.55, 0.55, 1.0))
    return Body(
        name=name, kind="floor", visuals=(Visual(shape=shape, material=look),), collisions=(Collision(shape=shape),)
    )
