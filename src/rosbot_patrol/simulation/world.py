"""A simulated world: the bodies of an SDF file (1.4 to 1.7, as Gazebo classic writes them), and who walks about in it.

Read: models (also nested in <include>, found on a search path), links, poses, the <state> that overrides them, box,
cylinder, sphere, plane and mesh geometry, materials as colours. A model or include whose name or uri speaks of a
person or a fire hydrant becomes an actor.

Differs: every model is static (what Gazebo would push aside stands fast here); lights, plugins, sensors, joints and
physics settings are skipped, and named once in a warning.
"""

from __future__ import annotations

import logging
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np

from rosbot_patrol.errors import WorldError
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.simulation.matrices import from_xyz_rpy, to_pose2d
from rosbot_patrol.simulation.scene import Body, BodyKind, Collision, Material, Matrix, Shape, Visual, identity

log = logging.getLogger(__name__)

VERSIONS = ("1.4", "1.5", "1.6", "1.7")

_ACTOR_WORDS = {"person": "person", "fire_hydrant": "fire_hydrant", "hydrant": "fire_hydrant"}
_KNOWN = {
    "world": {"model", "include", "state"},
    "model": {"link", "pose", "static"},
    "link": {"pose", "collision", "visual"},
}
# Of Gazebo's own running: skipped without a word.
_WITHOUT_MEANING = {
    "<gravity>", "<physics>", "<scene>", "<gui>", "<audio>", "<wind>", "<magnetic_field>", "<atmosphere>",
    "<spherical_coordinates>", "<include> of model://sun", "<light>",
}  # fmt: skip
_SHAPES = {"box", "cylinder", "sphere", "plane", "mesh"}


@dataclass(frozen=True, kw_only=True)
class ActorPlace:
    """An actor that the world's file puts somewhere: its name, its model (person, fire_hydrant) and where it stands."""

    name: str
    model: str
    pose: Pose2D


@dataclass(frozen=True, kw_only=True)
class World:
    """Everything that stands in a world, and the actors it begins with."""

    name: str = "empty"
    bodies: tuple[Body, ...] = ()
    actors: tuple[ActorPlace, ...] = ()


def load_world(path: str | Path, model_path: Iterable[str | Path] = ()) -> World:
    """Read an SDF world.

    Args:
        path: the file.
        model_path: folders in which `model://NAME` is looked up.

    Raises:
        WorldError: the file cannot be read, is not SDF, or an element makes no sense; names file and element.
    """
    reader = _Reader(Path(path), tuple(Path(p) for p in model_path))
    world = reader.read()
    strange = sorted(reader.skipped - _WITHOUT_MEANING)
    if strange:
        log.warning("%s: skipped elements not simulated here: %s", path, ", ".join(strange))
    return world


@dataclass
class _Reader:
    path: Path
    model_path: tuple[Path, ...]
    skipped: set[str] = field(default_factory=set)
    bodies: list[Body] = field(default_factory=list)
    actors: list[ActorPlace] = field(default_factory=list)

    def read(self) -> World:
        root = self._parse(self.path)
        world = root.find("world")
        if world is None:
            raise WorldError(self.path, "has no <world> element")
        state = _read_state(world, self.path)
        for child in world:
            if child.tag == "model":
                self._model(child, self.path, state)
            elif child.tag == "include":
                self._include(child, state)
            elif child.tag not in _KNOWN["world"]:
                self.skipped.add(f"<{child.tag}>")
        names = [b.name for b in self.bodies] + [a.name for a in self.actors]
        twice = next((n for n in names if names.count(n) > 1), None) if len(set(names)) < len(names) else None
        if twice:
            raise WorldError(self.path, f"the name '{twice}' is used twice")
        return World(name=world.get("name", "world"), bodies=tuple(self.bodies), actors=tuple(self.actors))

    def _parse(self, path: Path) -> ET.Element:
        try:
            root = ET.fromstring(path.read_bytes())
        except OSError as err:
            raise WorldError(path, f"cannot be read: {err.strerror}") from err
        except ET.ParseError as err:
            raise WorldError(path, f"is not XML: {err}") from err
        if root.tag != "sdf":
            raise WorldError(path, f"is no SDF file, its first element is <{root.tag}>")
        if root.get("version") not in VERSIONS:
            log.warning("%s: SDF version %s, read as 1.6", path, root.get("version", "is not named"))
        return root

    def _include(self, element: ET.Element, state: dict[str, Matrix]) -> None:
        uri = (element.findtext("uri") or "").strip()
        model = uri.removeprefix("model://").strip("/")
        if not model:
            raise WorldError(self.path, "an <include> has no <uri>")
        name = (element.findtext("name") or model).strip()
        pose = state.get(name, _pose(element, self.path, f"<include> of {uri}"))
        if model == "sun":
            self.skipped.add("<include> of model://sun")
            return
        if self._is_actor(name, model, pose):
            return
        file = self._find_model(model)
        if file is None and model == "ground_plane":
            self.bodies.append(_floor(name))
            return
        if file is None:
            where = ", ".join(map(str, self.model_path)) or "no folder is given"
            raise WorldError(self.path, f"<include> of {uri}: no such model (looked in: {where})")
        found = self._parse(file).find("model")
        if found is None:
            raise WorldError(file, "has no <model> element")
        placed = {**state, name: pose} if element.find("pose") is not None or name in state else state
        found.set("name", name)
        self._model(found, file, placed)

    def _find_model(self, model: str) -> Path | None:
        for folder in self.model_path:
            for name in ("model.sdf", "model-1_4.sdf", "model-1_5.sdf"):
                if (folder / model / name).is_file():
                    return folder / model / name
        return None

    def _is_actor(self, name: str, model: str, pose: Matrix) -> bool:
        text = f"{name} {model}".lower()
        kind = next((kind for word, kind in _ACTOR_WORDS.items() if word in text), None)
        if kind is None:
            return False
        self.actors.append(ActorPlace(name=name, model=kind, pose=to_pose2d(pose)))
        return True

    def _model(self, element: ET.Element, path: Path, state: dict[str, Matrix]) -> None:
        name = element.get("name")
        if not name:
            raise WorldError(path, "a <model> has no name")
        pose = state.get(name, _pose(element, path, f"model '{name}'"))
        if self._is_actor(name, "", pose):
            return
        self._note_skipped(element, "model")
        links = element.findall("link")
        for link in links:
            label = link.get("name") or "link"
            where = f"model '{name}', link '{label}'"
            self._note_skipped(link, "link")
            body_name = name if len(links) == 1 else f"{name}/{label}"
            world_from_link = state.get(f"{name}/{label}", pose @ _pose(link, path, where))
            visuals = [self._visual(v, path, f"{where}, visual '{v.get('name')}'") for v in link.findall("visual")]
            shapes = link.findall("collision")
            solid = [self._collision(c, path, f"{where}, collision '{c.get('name')}'") for c in shapes]
            collisions = [c for c in solid if c is not None]
            self.bodies.append(
                Body(
                    name=body_name,
                    kind=_kind_of(name, label, collisions),
                    pose=world_from_link,
                    visuals=tuple(v for v in visuals if v is not None),
                    collisions=tuple(collisions),
                )
            )

    def _note_skipped(self, element: ET.Element, tag: str) -> None:
        self.skipped.update(f"<{c.tag}> of a {tag}" for c in element if c.tag not in _KNOWN[tag])

    def _visual(self, element: ET.Element, path: Path, where: str) -> Visual | None:
        shape = self._shape(element, path, where)
        if shape is None:
            return None
        return Visual(shape=shape, pose=_pose(element, path, where), material=_material(element, path, where))

    def _collision(self, element: ET.Element, path: Path, where: str) -> Collision | None:
        shape = self._shape(element, path, where)
        return None if shape is None else Collision(shape=shape, pose=_pose(element, path, where))

    def _shape(self, element: ET.Element, path: Path, where: str) -> Shape | None:
        geometry = element.find("geometry")
        children = list(geometry) if geometry is not None else []
        found = next((c for c in children if c.tag in _SHAPES), None)
        if found is None:
            if not children:
                raise WorldError(path, f"{where}: has no geometry")
            self.skipped.add(f"<{children[0].tag}> geometry")
            return None
        if found.tag == "box":
            return Shape(kind="box", size=_sizes(found, "size", 3, path, where))
        if found.tag == "cylinder":
            size = _sizes(found, "radius", 1, path, where) + _sizes(found, "length", 1, path, where)
            return Shape(kind="cylinder", size=size)
        if found.tag == "sphere":
            return Shape(kind="sphere", size=_sizes(found, "radius", 1, path, where))
        if found.tag == "plane":
            return Shape(kind="plane", size=_sizes(found, "size", 2, path, where))
        return self._mesh(found, path, where)

    def _mesh(self, element: ET.Element, path: Path, where: str) -> Shape:
        uri = (element.findtext("uri") or "").strip()
        plain = uri.removeprefix("file://")
        if uri.startswith("model://"):
            places = [folder / uri.removeprefix("model://") for folder in self.model_path]
        else:
            places = [path.parent / plain]
        file = next((p for p in places if p.is_file()), None)
        if not uri or file is None:
            looked = ", ".join(map(str, places)) or "no folder for model:// is given"
            raise WorldError(path, f"{where}: the mesh '{uri}' is missing (looked for {looked})")
        scale = _floats(element.findtext("scale") or "1 1 1", 3, path, f"{where}, <scale>")
        return Shape(kind="mesh", size=scale, mesh=file)


def _read_state(world: ET.Element, path: Path) -> dict[str, Matrix]:
    """Poses that <state> gives: model name -> world_from_model, "model/link" -> world_from_link."""
    poses: dict[str, Matrix] = {}
    for model in world.findall("state/model"):
        name = model.get("name", "")
        if model.find("pose") is not None:
            poses[name] = _pose(model, path, f"state of model '{name}'")
        for link in model.findall("link"):
            if link.find("pose") is not None:
                label = link.get("name", "")
                poses[f"{name}/{label}"] = _pose(link, path, f"state of link '{name}/{label}'")
    return poses


def _kind_of(model: str, link: str, collisions: list[Collision]) -> BodyKind:
    text = f"{model} {link}".lower()
    if "ground_plane" in text or any(c.shape.kind == "plane" for c in collisions):
        return "floor"
    if "wall" in text:
        return "wall"
    if "door" in text:
        return "door"
    return "furniture"


def _floor(name: str) -> Body:
    shape = Shape(kind="plane", size=(100.0, 100.0))
    look = Material(rgba=(0.55, 0.55, 0.55, 1.0))
    return Body(
        name=name, kind="floor", visuals=(Visual(shape=shape, material=look),), collisions=(Collision(shape=shape),)
    )


def _pose(element: ET.Element, path: Path, where: str) -> Matrix:
    pose = element.find("pose")
    if pose is None or not (pose.text or "").strip():
        return identity()
    if pose.get("relative_to") or pose.get("frame"):
        log.warning("%s: %s: a pose relative to another frame is read as relative to its parent", path, where)
    v = _floats(pose.text or "", 6, path, f"{where}, <pose>")
    return from_xyz_rpy(v[:3], v[3:])


def _material(element: ET.Element, path: Path, where: str) -> Material:
    colour = element.findtext("material/diffuse") or element.findtext("material/ambient")
    if not colour:
        return Material(rgba=_named_colour(element.findtext("material/script/name") or ""))
    values = [float(v) for v in colour.split()] if _all_numbers(colour) else []
    if len(values) not in (3, 4):
        raise WorldError(path, f"{where}, <diffuse>: expected 3 or 4 numbers, got '{colour}'")
    rgba = [*values, 1.0][:4]
    return Material(rgba=(rgba[0], rgba[1], rgba[2], rgba[3]))


def _named_colour(script: str) -> tuple[float, float, float, float]:
    names = {
        "White": (0.95, 0.95, 0.95),
        "Black": (0.05, 0.05, 0.05),
        "Red": (0.8, 0.1, 0.1),
        "Green": (0.1, 0.6, 0.15),
        "Blue": (0.1, 0.2, 0.8),
        "Yellow": (0.85, 0.8, 0.1),
        "Orange": (0.9, 0.5, 0.1),
        "Wood": (0.55, 0.40, 0.25),
        "WoodFloor": (0.55, 0.43, 0.31),
        "Bricks": (0.60, 0.33, 0.26),
        "Grey": (0.6, 0.6, 0.6),
        "DarkGrey": (0.3, 0.3, 0.3),
    }
    rgb = names.get(script.strip().removeprefix("Gazebo/"), (0.7, 0.7, 0.7))
    return (*rgb, 1.0)


def _all_numbers(text: str) -> bool:
    try:
        return all(np.isfinite(float(word)) for word in text.split())
    except ValueError:
        return False


def _floats(text: str, count: int, path: Path, where: str) -> tuple[float, ...]:
    words = text.split()
    if len(words) != count or not _all_numbers(text):
        raise WorldError(path, f"{where}: expected {count} numbers, got '{text.strip()}'")
    return tuple(float(w) for w in words)


def _sizes(shape: ET.Element, tag: str, count: int, path: Path, where: str) -> tuple[float, ...]:
    text = shape.findtext(tag)
    if text is None:
        if shape.tag == "plane":
            return (100.0, 100.0)
        raise WorldError(path, f"{where}: <{shape.tag}> has no <{tag}>")
    values = _floats(text, count, path, f"{where}, <{tag}>")
    if min(values) <= 0.0:
        raise WorldError(path, f"{where}, <{tag}>: expected positive numbers, got '{text.strip()}'")
    return values
