"""Shapes of SDF: <geometry> of a <collision> or <visual>, with meshes from their files."""

from __future__ import annotations

import logging
from dataclasses import dataclass, field, replace
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.errors import WorldError
from rosbot_patrol.simulation.meshes.colours import Rgba
from rosbot_patrol.simulation.meshes.files import MeshPart, load_parts, merged
from rosbot_patrol.simulation.scene.scene import Body, Collision, Matrix, Shape, ShapeKind, Visual
from rosbot_patrol.simulation.scene.shapes import sphere
from rosbot_patrol.simulation.sdf.files import LostFiles, ModelPath, Part
from rosbot_patrol.simulation.sdf.looks import Looks, is_unseen
from rosbot_patrol.simulation.sdf.polylines import polyline_triangles
from rosbot_patrol.simulation.sdf.roads import read_road
from rosbot_patrol.simulation.sdf.state import Scale
from rosbot_patrol.simulation.sdf.values import Place, box_sizes, floats, is_true, sizes, turned_to

log = logging.getLogger(__name__)

PLANE = (100.0, 100.0)  # default size of a plane [m]

_READ = {"box", "cylinder", "sphere", "capsule", "ellipsoid", "plane", "polyline", "mesh"}
_KNOWN = {
    "visual": {"pose", "geometry", "material", "transparency", "cast_shadows", "meta", "laser_retro"},
    "collision": {"pose", "geometry", "surface", "laser_retro", "max_contacts", "bounce", "friction"},
}

_INSTEAD = {"heightmap": " (make it a mesh)", "image": " (make it boxes or a mesh)"}

_Found = tuple[Shape, Rgba | None, Matrix]


@dataclass
class ShapeReader:
    """Reader of shapes; it reads each mesh file once.

    Attributes:
        model_path: search path of model://.
        skipped: collects the names of unsupported elements.
        lost: collects the meshes that cannot be used.
    """

    model_path: ModelPath
    skipped: set[str]
    lost: LostFiles = field(default_factory=LostFiles)
    _looks: Looks = field(init=False)
    _meshes: dict[Path, tuple[MeshPart, ...] | WorldError] = field(default_factory=dict)
    _merged: dict[tuple[Path, str, bool], tuple[MeshPart, ...]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._looks = Looks(self.model_path, self.skipped)

    def visuals(self, element: ET.Element, pose: Matrix, place: Place, scale: Scale) -> list[Visual] | None:
        """Read the visuals of a <visual>: one per colour of its mesh, none if it is transparent or of an unknown shape.

        Returns:
            None if its mesh is missing or broken, which is recorded in `lost`.

        Raises:
            WorldError: an element is invalid.
        """
        self._note(element)
        if is_unseen(element, place):
            return []
        found = self._found(element, place, scale, "visual")
        if found is None:
            return None
        return [
            Visual(shape=shape, pose=pose @ turn, material=self._looks.material(element, own, place))
            for shape, own, turn in found
        ]

    def collisions(self, element: ET.Element, pose: Matrix, place: Place, scale: Scale) -> list[Collision]:
        """Read the shape of a <collision>, none if it is of an unknown shape, or its mesh is missing or broken.

        Raises:
            WorldError: an element is invalid.
        """
        self._note(element)
        found = self._found(element, place, scale, "collision") or []
        return [Collision(shape=shape, pose=pose @ turn) for shape, _, turn in found]

    def road(self, element: ET.Element, place: Place, name: str) -> Body:
        """Read a <road> with its material. Raises WorldError."""
        named = element.find("material") is not None
        return read_road(element, place, name, self._looks.material(element, None, place) if named else None)

    def _note(self, element: ET.Element) -> None:
        self.skipped.update(f"<{c.tag}> of a {element.tag}" for c in element if c.tag not in _KNOWN[element.tag])

    def _found(self, element: ET.Element, place: Place, scale: Scale, part: Part) -> list[_Found] | None:
        """The shapes of an element, None if its mesh cannot be used; this is recorded in `lost`."""
        mesh = element.find("geometry/mesh")
        try:
            return self._shapes(element, place, scale, apart=part == "visual")
        except WorldError as err:
            if mesh is None:
                raise
            self.lost.add(_uri(mesh) or f"{place.where}, <mesh>", part, place, err)
            return None

    def _shapes(self, element: ET.Element, place: Place, scale: Scale, *, apart: bool) -> list[_Found]:
        """(shape, colour from its file, rotation) of an element, with a mesh's parts separate or merged."""
        geometry = element.find("geometry")
        children = list(geometry) if geometry is not None else []
        if not children:
            raise place.error("has no geometry")
        found = next((c for c in children if c.tag in _READ), None)
        if found is None:
            if children[0].tag != "empty":
                self.skipped.add(f"<{children[0].tag}> geometry{_INSTEAD.get(children[0].tag, '')}")
            return []
        if found.tag == "mesh":
            return [(shape, own, np.eye(4)) for shape, own in self._mesh(found, place, scale, apart=apart)]
        if found.tag == "plane":
            return self._plane(found, place, scale, is_solid=element.tag == "collision")
        if found.tag == "polyline":
            vertices, faces = polyline_triangles([c for c in children if c.tag == "polyline"], place)
            return [(_free(vertices, faces, scale, place), None, np.eye(4))]
        if found.tag == "ellipsoid":
            ball = sphere(1.0, 0.0)
            size = floats(found.findtext("radii") or "1 1 1", 3, place.inside("<radii>"))
            return [(_free(ball.positions * size, ball.faces, scale, place), None, np.eye(4))]
        return [(_scaled(_primitive(found, place), scale), None, np.eye(4))]

    def _plane(self, element: ET.Element, place: Place, scale: Scale, *, is_solid: bool) -> list[_Found]:
        size = sizes(element, "size", 2, place) if element.find("size") is not None else PLANE
        normal = floats(element.findtext("normal") or "0 0 1", 3, place.inside("<normal>"))
        if max(map(abs, normal)) == 0.0:
            raise place.inside("<normal>").error("expected a direction, got '0 0 0'")
        if is_solid and abs(turned_to(normal)[2, 2]) < 0.99:
            self.skipped.add("<collision> with a <plane> that does not lie flat")
        turn = turned_to(normal) if normal[:2] != (0.0, 0.0) else np.eye(4)
        return [(Shape(kind="plane", size=(size[0] * scale[0], size[1] * scale[1])), None, turn)]

    def _mesh(self, element: ET.Element, place: Place, scale: Scale, *, apart: bool) -> list[tuple[Shape, Rgba | None]]:
        uri = _uri(element)
        if not uri:
            raise place.error("<mesh> has no <uri>")
        file = self.model_path.find(uri, place.path.parent, place.inside("mesh"))
        text = element.findtext("scale") or "1 1 1"
        own = floats(text if len(text.split()) != 1 else " ".join([text] * 3), 3, place.inside("<scale>"))
        if 0.0 in own:
            raise place.inside("<scale>").error("expected numbers other than 0, got '" + " ".join(map(str, own)) + "'")
        size = tuple(a * b for a, b in zip(own, scale, strict=True))
        name = (element.findtext("submesh/name") or "").strip()
        centred = is_true(element.findtext("submesh/center"))
        parts = self._parts(file, name, centred, place)
        if not apart:
            key = (file, name, centred)
            if key not in self._merged:
                self._merged[key] = (MeshPart(name, *merged(parts)),)
            parts = self._merged[key]
        return [(Shape(kind="mesh", size=size, mesh=file, vertices=p.vertices, faces=p.faces), p.rgba) for p in parts]

    def _parts(self, file: Path, submesh: str, centred: bool, place: Place) -> tuple[MeshPart, ...]:
        parts = self._load(file)
        if not submesh:
            return parts
        chosen = tuple(part for part in parts if part.name == submesh)
        if not chosen:
            there = ", ".join(sorted({f"'{part.name}'" for part in parts}))
            raise place.inside("<submesh>").error(f"{file} has no part '{submesh}' (there: {there})")
        if centred:
            every = np.vstack([part.vertices for part in chosen])
            middle = (every.min(axis=0) + every.max(axis=0)) / 2.0
            chosen = tuple(replace(part, vertices=part.vertices - middle) for part in chosen)
        return chosen

    def _load(self, file: Path) -> tuple[MeshPart, ...]:
        """The parts of a mesh file, read once, even if it is broken. Raises WorldError."""
        if file not in self._meshes:
            try:
                self._meshes[file] = load_parts(file)
            except WorldError as err:
                self._meshes[file] = err
        found = self._meshes[file]
        if isinstance(found, WorldError):
            raise found
        return found


def _uri(mesh: ET.Element) -> str:
    return (mesh.findtext("uri") or mesh.findtext("filename") or "").strip()


def _primitive(element: ET.Element, place: Place) -> Shape:
    if element.tag == "box":
        return Shape(kind="box", size=box_sizes(element, place))
    radius = sizes(element, "radius", 1, place)
    if element.tag == "sphere":
        return Shape(kind="sphere", size=radius)
    kind: ShapeKind = "capsule" if element.tag == "capsule" else "cylinder"
    return Shape(kind=kind, size=radius + sizes(element, "length", 1, place))


def _free(vertices: NDArray[np.float64], faces: NDArray[np.int64], scale: Scale, place: Place) -> Shape:
    """Triangles as a mesh with sharp edges, because the file lists them."""
    return Shape(kind="mesh", size=scale, mesh=place.path, vertices=vertices, faces=faces)


def _scaled(shape: Shape, scale: Scale) -> Shape:
    """Scale a primitive as Gazebo's <state> does: round ones by the larger of x and y."""
    if scale == (1.0, 1.0, 1.0):
        return shape
    if shape.kind == "box":
        return replace(shape, size=tuple(a * b for a, b in zip(shape.size, scale, strict=True)))
    wide = max(scale) if shape.kind == "sphere" else max(scale[:2])
    return replace(shape, size=(shape.size[0] * wide, *(length * scale[2] for length in shape.size[1:])))
