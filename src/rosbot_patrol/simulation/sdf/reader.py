"""Reader of an SDF world's models: links, nested and included models, actors, and the poses of the saved state."""

from __future__ import annotations

import logging
import re
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path
from xml.etree import ElementTree as ET

from rosbot_patrol.errors import WorldError
from rosbot_patrol.simulation.actors.doors import DoorPlace
from rosbot_patrol.simulation.scene.matrices import to_pose2d
from rosbot_patrol.simulation.scene.scene import Body, Collision, Matrix, Visual, identity
from rosbot_patrol.simulation.sdf.actors import ActorPlace, actor_kind, places_of, read_actor
from rosbot_patrol.simulation.sdf.bodies import floor, instead, inverse, kind_of, together
from rosbot_patrol.simulation.sdf.doors import Hinge, carried_by, read_hinge
from rosbot_patrol.simulation.sdf.files import LostFiles, ModelPath, model_file
from rosbot_patrol.simulation.sdf.frames import Frames
from rosbot_patrol.simulation.sdf.shapes import ShapeReader
from rosbot_patrol.simulation.sdf.state import Scale, State
from rosbot_patrol.simulation.sdf.values import VERSIONS, Place, pose_of
from rosbot_patrol.simulation.sdf.xml import read_sdf

log = logging.getLogger(__name__)

_KNOWN = {
    "world": {"model", "include", "state", "actor", "frame", "population", "road"},
    "model": {"link", "model", "include", "frame", "joint", "pose", "static", "placement_frame"},
    "link": {"pose", "collision", "visual"},
    "include": {"uri", "name", "pose", "static", "placement_frame"},
    "actor": {"pose", "skin", "animation", "script", "link", "joint", "static"},
}
# Gazebo's own settings, or parts that move: skipped without a message.
_WITHOUT_MEANING = {
    "gravity", "physics", "scene", "gui", "audio", "wind", "magnetic_field", "atmosphere", "spherical_coordinates",
    "inertial", "self_collide", "kinematic", "enable_wind", "allow_auto_disable", "velocity_decay", "must_be_base_link",
    "plugin_filename", "real_time_update_rate", "max_step_size", "real_time_factor", "battery", "audio_source",
    "audio_sink", "collide",
}  # fmt: skip
_ONES: Scale = (1.0, 1.0, 1.0)


@dataclass
class Reader:
    """Reader of one world.

    Attributes:
        path: the world's file.
        model_path: search path of models.
        skipped: elements that are not supported.
        lost: files of models and meshes that cannot be used.
        renamed: new names ("name_1") of things with a name in use.
        versions: SDF versions read as if they were others, with one file of each.
        lights: number of lights.
        bodies, actors, doors: the contents of the world.
    """

    path: Path
    model_path: ModelPath
    skipped: set[str] = field(default_factory=set)
    lost: LostFiles = field(default_factory=LostFiles)
    renamed: list[str] = field(default_factory=list)
    versions: dict[str, Path] = field(default_factory=dict)
    lights: int = 0
    bodies: list[Body] = field(default_factory=list)
    actors: list[ActorPlace] = field(default_factory=list)
    doors: list[DoorPlace] = field(default_factory=list)
    _state: State = field(default_factory=State)
    _files: dict[Path, ET.Element] = field(default_factory=dict)
    _including: list[Path] = field(default_factory=list)
    _taken: set[str] = field(default_factory=set)

    def __post_init__(self) -> None:
        self._shapes = ShapeReader(self.model_path, self.skipped, self.lost)

    def read(self, root: ET.Element | None = None) -> str:
        """Read the file, or `root` instead; returns the world's name. Raises WorldError."""
        if root is not None:
            self._files[self.path] = root
        place = Place(self.path)
        worlds = self._parse(self.path).findall("world")
        if not worlds:
            raise WorldError(self.path, "has no <world> element")
        if len(worlds) > 1:
            log.warning("%s: holds %d worlds, only the first is read", self.path, len(worlds))
        world = worlds[0]
        for element in world.findall("state"):
            self._state.read(element, place)
        frames = Frames(world, place)
        self._note_skipped(world)
        for child in (*world, *self._state.inserted):
            self._child(child, place, frames, identity(), "")
        return world.get("name", "world")

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
            here = place.inside(f"actor '{child.get('name')}'")
            self._actor(child, here, outer + (child.get("name") or "actor"), world_from_outer @ pose_of(child, here))
        elif child.tag == "population":
            self._population(child, place.inside(f"population '{child.get('name')}'"), world_from_outer, outer)
        elif child.tag == "road":
            here = place.inside(f"road '{child.get('name')}'")
            self.bodies.append(self._shapes.road(child, here, self._fresh(outer + (child.get("name") or "road"))))

    def _parse(self, path: Path) -> ET.Element:
        if path not in self._files:
            root = self._files[path] = read_sdf(path)
            if root.get("version") not in VERSIONS:
                self.versions.setdefault(root.get("version", "not named"), path)
        return self._files[path]

    def _include(self, element: ET.Element, place: Place, frames: Frames, world_from_outer: Matrix, outer: str) -> None:
        self._note_skipped(element)
        uri = (element.findtext("uri") or "").strip()
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
            file, found = self._find_included(uri, here)
        except WorldError as err:
            if short == "ground_plane":
                self.bodies.append(floor(self._fresh(outer + (given or short))))
            else:
                self.lost.add(uri, "model", here, err)
            return
        if file in self._including:
            chain = " -> ".join(p.parent.name for p in (*self._including, file))
            raise here.error(f"the models include each other in a circle: {chain}")
        self._included(file, found, element, world_from_model, outer=outer, name=given or found.get("name") or short)

    def _find_included(self, uri: str, place: Place) -> tuple[Path, ET.Element]:
        """Find the file of an <include>, and the model, actor or light in it. Raises WorldError."""
        if not uri:
            raise place.error("has no <uri>")
        file = model_file(self.model_path.find(uri, place.path.parent, place), place)
        root = self._parse(file)
        found = next((root.find(tag) for tag in ("model", "actor", "light") if root.find(tag) is not None), None)
        if found is None:
            raise WorldError(file, "has no <model> element")
        return file, found

    def _included(
        self, file: Path, found: ET.Element, element: ET.Element, world_from_model: Matrix, *, outer: str, name: str
    ) -> None:
        if found.tag == "light":
            self.lights += len(self._parse(file).findall("light"))
            return
        inside = Place(file, f"{found.tag} '{name}'")
        placement = element.findtext("placement_frame")
        if placement:
            world_from_model = world_from_model @ inverse(Frames(found, inside).frame(placement.strip(), inside))
        elif element.find("pose") is None:
            world_from_model = world_from_model @ pose_of(found, inside)
        if found.tag == "actor":
            self._actor(found, inside, outer + name, world_from_model)
            return
        self._including.append(file)
        self._model(found, inside, world_from_model, outer + name)
        self._including.pop()

    def _population(self, element: ET.Element, place: Place, world_from_outer: Matrix, outer: str) -> None:
        model = element.find("model")
        if model is None:
            self.skipped.add("<population>")
            return
        name = model.get("name") or "model"
        here = place.inside(f"model '{name}'")
        for i, outer_from_copy in enumerate(places_of(element, place)):
            self._model(model, here, world_from_outer @ outer_from_copy, f"{outer}{name}_clone_{i}")

    def _is_actor(self, name: str, words: Iterable[str], pose: Matrix) -> bool:
        kind = actor_kind(words)
        if kind is not None and name not in self._state.deleted:
            pose = self._state.poses.get(name, pose)
            self.actors.append(ActorPlace(name=self._fresh(name), model=kind, pose=to_pose2d(pose)))
        return kind is not None

    def _actor(self, element: ET.Element, place: Place, name: str, world_from_actor: Matrix) -> None:
        self._note_skipped(element)
        if name not in self._state.deleted:
            pose = self._state.poses.get(name, world_from_actor)
            self.actors.append(read_actor(element, place, self._fresh(name), pose))

    def _model(self, element: ET.Element, place: Place, world_from_model: Matrix, name: str) -> None:
        if name in self._state.deleted:
            return
        meshes = {Path(uri.text or "").parts[1:2] for uri in element.iterfind("link/visual/geometry/mesh/uri")}
        words = (name, *(part for parts in meshes for part in parts)) if len(meshes) == 1 else (name,)
        if self._is_actor(name, words, self._state.poses.get(name, world_from_model)):
            return
        name = self._fresh(name)
        world_from_model = self._state.poses.get(name, world_from_model)
        self._note_skipped(element)
        frames = Frames(element, place)
        self._links(element, place, frames, world_from_model, name)
        for child in element:
            self._child(child, place, frames, world_from_model, f"{name}::")

    def _links(self, model: ET.Element, place: Place, frames: Frames, world_from_model: Matrix, name: str) -> None:
        """The bodies of a model, one per link; but a door's leaf includes the links attached to it."""
        links = model.findall("link")
        built: list[tuple[str, Body, Hinge | None]] = []
        for link in links:
            label = link.get("name") or "link"
            here = place.inside(f"link '{label}'")
            model_from_link = frames.pose(link, here)
            pose = self._state.poses.get(f"{name}/{label}", world_from_model @ model_from_link)
            body = self._link(link, here, frames, inverse(model_from_link), self._state.scales.get(name, _ONES))
            kind = kind_of(name, label, body.collisions)
            hinge = read_hinge(model, label, frames, pose @ inverse(model_from_link), here)
            hinge = hinge if body.collisions else None
            body_name = name if len(links) == 1 else self._fresh(f"{name}/{label}")
            built.append((label, replace(body, name=body_name, kind=kind, pose=pose, static=hinge is None), hinge))
        carried: set[str] = set()
        for label, body, hinge in built:
            if hinge is not None:
                hangs = set(carried_by(model, label)) - carried
                parts = [other for name_, other, own in built if name_ in hangs and own is None]
                carried |= hangs
                leaf = replace(together(body, parts), kind="door")
                self.doors.append(DoorPlace(body=leaf, axis=hinge.axis, swing=hinge.swing))
        self.bodies += [body for label, body, hinge in built if hinge is None and label not in carried]

    def _link(self, element: ET.Element, place: Place, frames: Frames, link_from_model: Matrix, scale: Scale) -> Body:
        """Visuals and collisions of a link; if all its visuals are lost, its collisions are shown."""
        self._note_skipped(element)
        visuals: list[Visual] = []
        collisions: list[Collision] = []
        is_lost = False
        for part in element:
            if part.tag not in ("visual", "collision"):
                continue
            here = place.inside(f"{part.tag} '{part.get('name')}'")
            pose = _part_pose(part, here, frames, link_from_model, element.get("name") or "")
            if part.tag == "collision":
                collisions += self._shapes.collisions(part, pose, here, scale)
                continue
            seen = self._shapes.visuals(part, pose, here, scale)
            is_lost |= seen is None
            visuals += seen or []
        if is_lost and not visuals:
            visuals = [instead(part) for part in collisions if part.shape.kind != "plane"]
        return Body(name="", visuals=tuple(visuals), collisions=tuple(collisions))

    def _fresh(self, name: str) -> str:
        """The name, or a similar one if it is taken."""
        if name in self._taken:
            number = 1
            while f"{name}_{number}" in self._taken:
                number += 1
            name = f"{name}_{number}"
            self.renamed.append(name)
        self._taken.add(name)
        return name

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
