"""A simulated world: bodies and actors of an SDF file (1.4 to 1.7, as written by Gazebo classic).

Read: models, nested ones too, links, poses and the frames they are relative to, <include> on a search path, the
<state> that overrides poses and sizes, populations, box, cylinder, sphere, capsule, ellipsoid, plane, polyline and mesh
geometry, materials as colours. A model whose name, uri or mesh speaks of a person or a fire hydrant becomes an actor,
and so does an <actor>.

Differs: every model is static (what Gazebo would push aside stands fast here); joints hold, but for a door's hinge
(`sdf_doors`), which a service moves; lights, plugins, sensors and physics settings are skipped. What is not read is
named once in a warning. As in Gazebo, a model or mesh that is missing or broken is reported and left out; a visual
without its mesh is shown as its collision shapes. A world on a raised floor is let down onto the ground (`sdf_floors`).
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

from rosbot_patrol.counts import count_of
from rosbot_patrol.simulation.actors.doors import DoorPlace
from rosbot_patrol.simulation.scene.scene import Body
from rosbot_patrol.simulation.sdf.actors import ActorPlace
from rosbot_patrol.simulation.sdf.bodies import let_down, raised_floor
from rosbot_patrol.simulation.sdf.files import ModelPath
from rosbot_patrol.simulation.sdf.reader import Reader
from rosbot_patrol.simulation.sdf.values import VERSIONS

__all__ = ["ActorPlace", "World", "load_world"]

log = logging.getLogger(__name__)


@dataclass(frozen=True, kw_only=True)
class World:
    """Everything that stands in a world, the actors it begins with, and its doors on hinges.

    Attributes:
        lost: a sentence for each file that the world names and that cannot be used.
    """

    name: str = "empty"
    bodies: tuple[Body, ...] = ()
    actors: tuple[ActorPlace, ...] = ()
    doors: tuple[DoorPlace, ...] = ()
    lost: tuple[str, ...] = ()


def load_world(
    path: str | Path,
    model_path: Iterable[str | Path] = (),
    find_package: Callable[[str], Path | None] | None = None,
) -> World:
    """Read an SDF world.

    Args:
        path: the file.
        model_path: folders in which `model://NAME` is looked up, before `models` beside the file or its folders.
        find_package: the folder of a ROS package by name, where no folder has it.

    Raises:
        WorldError: the file cannot be read, is not SDF, or an element makes no sense; names file and element.
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
    """What was left out, in one line of each kind."""
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
