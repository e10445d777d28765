"""A simulated world: the bodies of an SDF file (1.4 to 1.7, as Gazebo classic writes them), and its actors.

Read: models (also nested), links, poses and their frames, <include> on a search path, the <state> that overrides poses
and sizes, populations, box, cylinder, sphere, capsule, ellipsoid, plane, polyline and mesh geometry, materials as
colours. An <actor> becomes an actor, and so does a model if its name, uri or mesh indicates a person or a fire hydrant.

Differs:
- Every model is static; Gazebo would push some aside.
- Joints are fixed, except a door's hinge (`sdf.doors`), which a service moves.
- Lights, plugins, sensors and physics settings are skipped. A warning names each unsupported element once.
- As in Gazebo, a missing or broken model or mesh is reported and left out; a visual without its mesh shows its
  collision shapes.
- A world on a raised floor is lowered onto the ground (`sdf.bodies`).
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree as ET

from rosbot_patrol.counts import count_of
from rosbot_patrol.errors import WorldError
from rosbot_patrol.simulation.actors.doors import DoorPlace
from rosbot_patrol.simulation.scene.scene import Body
from rosbot_patrol.simulation.sdf.actors import ActorPlace
from rosbot_patrol.simulation.sdf.bodies import let_down, raised_floor
from rosbot_patrol.simulation.sdf.files import ModelPath
from rosbot_patrol.simulation.sdf.reader import Reader
from rosbot_patrol.simulation.sdf.values import VERSIONS
from rosbot_patrol.simulation.sdf.xml import parse_sdf

__all__ = ["ActorPlace", "World", "load_world", "parse_model"]

log = logging.getLogger(__name__)


@dataclass(frozen=True, kw_only=True)
class World:
    """The contents of a world: its bodies, its initial actors, and its doors on hinges.

    Attributes:
        lost: one sentence per missing or broken file that the world names.
    """

    name: str = "empty"
    bodies: tuple[Body, ...] = ()
    actors: tuple[ActorPlace, ...] = ()
    doors: tuple[DoorPlace, ...] = ()
    lost: tuple[str, ...] = ()


def parse_model(
    text: str,
    name: str,
    pose: tuple[float, ...],
    *,
    source: str = "",
    model_path: Iterable[str | Path] = (),
    find_package: Callable[[str], Path | None] | None = None,
) -> World:
    """Read one model of SDF, as a world with nothing else.

    Args:
        text: the SDF, with a <model>.
        name: of the model.
        pose: x, y, z [m] and roll, pitch, yaw [rad]; takes the place of the model's own.
        source: file of the text, for messages and relative names.
        model_path: as for `load_world`.
        find_package: as for `load_world`.

    Raises:
        WorldError: as for `load_world`.
    """
    path = Path(source or name)
    found = parse_sdf(text.encode(), path)
    model = found.find("model") if found.find("model") is not None else found.find("world/model")
    if model is None:
        raise WorldError(path, "has no <model> element")
    for old in model.findall("pose"):
        model.remove(old)
    model.set("name", name)
    ET.SubElement(model, "pose").text = " ".join(map(str, pose))
    root = ET.Element("sdf", version=found.get("version", VERSIONS[-1]))
    ET.SubElement(root, "world", name=name).append(model)
    reader = Reader(path, ModelPath(tuple(map(Path, model_path)), find_package))
    reader.read(root)
    _tell(reader)
    lost = reader.lost.sentences()
    return World(
        name=name, bodies=tuple(reader.bodies), actors=tuple(reader.actors), doors=tuple(reader.doors), lost=lost
    )


def load_world(
    path: str | Path,
    model_path: Iterable[str | Path] = (),
    find_package: Callable[[str], Path | None] | None = None,
) -> World:
    """Read an SDF world.

    Args:
        path: the file.
        model_path: folders searched for `model://NAME`, before `models` beside the file or its folders.
        find_package: folder of a ROS package by name, used last.

    Raises:
        WorldError: the file cannot be read, is not SDF, or an element is invalid; the text names file and element.
    """
    path = Path(path)
    beside = [folder / "models" for folder in list(path.resolve().parents)[:3]]
    reader = Reader(path, ModelPath((*map(Path, model_path), *beside), find_package))
    name = reader.read()
    bodies, doors = tuple(reader.bodies), tuple(reader.doors)
    _tell(reader)
    height = raised_floor(bodies)
    if height:
        log.info("%s: stands on a floor of %.3f m, which is let down to the height 0", path, height)
        bodies, doors = let_down(bodies, doors, height)
    return World(name=name, bodies=bodies, actors=tuple(reader.actors), doors=doors, lost=reader.lost.sentences())


def _tell(reader: Reader) -> None:
    """Log what was left out, one line per kind."""
    if reader.lights:
        lights = count_of(reader.lights, "light is", "lights are")
        log.info("%s: %s not simulated, the camera has its own", reader.path, lights)
    for version, file in reader.versions.items():
        log.warning("%s: SDF version %s, read as %s", file, version, VERSIONS[-1])
    if reader.skipped:
        log.warning("%s: skipped, not simulated here: %s", reader.path, ", ".join(sorted(reader.skipped)))
    if reader.renamed:
        log.warning("%s: names used twice, the later one is called: %s", reader.path, ", ".join(reader.renamed))
    for sentence in reader.lost.sentences():
        log.warning("%s", sentence)
    if reader.lost:
        log.warning("%s: %s", reader.path, reader.lost.summary())
