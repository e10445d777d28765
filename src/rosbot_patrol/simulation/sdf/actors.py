"""Actors and populations of a world: its <actor>s, models of a person or a fire hydrant, and <population>s.

A <population> is many copies of one model, spread over a box or a cylinder.

It is read in the form of SDF 1.5 (<box>, <cylinder>, <distribution><type>) or 1.4 (<region>). Gazebo draws random
places; here the name is the seed, so the places are the same each time. "uniform" is an even, but not a regular spread.
"""

from __future__ import annotations

import itertools
import logging
import math
import re
import zlib
from collections.abc import Iterable
from dataclasses import dataclass
from xml.etree import ElementTree as ET

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.geometry import Pose2D, distance
from rosbot_patrol.simulation.actors.walkers import FASTEST
from rosbot_patrol.simulation.scene.matrices import from_xyz_rpy, to_pose2d
from rosbot_patrol.simulation.scene.scene import Matrix
from rosbot_patrol.simulation.sdf.values import Place, floats, is_true, pose_of, sizes

log = logging.getLogger(__name__)

_WORDS = {"person": "person", "pedestrian": "person", "hydrant": "fire_hydrant"}
_WALK_SPEED = 0.8  # speed of an actor with waypoints without times [m/s]


@dataclass(frozen=True, kw_only=True)
class ActorPlace:
    """An actor of a world file.

    Attributes:
        name: unique in the world.
        model: person or fire_hydrant.
        pose: initial pose.
        path: points of its walk, () if it stands.
        speed: walking speed [m/s].
        loop: whether it repeats the walk.
    """

    name: str
    model: str
    pose: Pose2D
    path: tuple[Pose2D, ...] = ()
    speed: float = 0.0
    loop: bool = False


def actor_kind(words: Iterable[str]) -> str | None:
    """The actor that a model's names indicate, None for a thing."""
    text = set(re.split(r"[^a-z]+", " ".join(words).lower()))
    return next((kind for word, kind in _WORDS.items() if word in text), None)


def read_actor(element: ET.Element, place: Place, name: str, pose: Matrix) -> ActorPlace:
    """Read one of Gazebo's <actor>s: the trajectories of its script in sequence, at their mean speed.

    Args:
        element: the <actor>.
        place: position of the element in the file.
        name: its name here.
        pose: world_from_actor, used without a trajectory; waypoints are in the world frame.

    Raises:
        WorldError: a number is invalid.
    """
    points: list[Pose2D] = []
    lasts = 0.0
    script = element.find("script")
    trajectories = script.findall("trajectory") if script is not None else []
    for trajectory in sorted(trajectories, key=lambda t: int(t.get("id", "0")) if t.get("id", "0").isdigit() else 0):
        times = []
        for i, waypoint in enumerate(trajectory.findall("waypoint")):
            here = place.inside(f"waypoint {i}")
            points.append(to_pose2d(pose_of(waypoint, here)))
            times.append(floats(waypoint.findtext("time") or "0", 1, here.inside("<time>"))[0])
        lasts += times[-1] - times[0] if times else 0.0
    way = sum(distance(a, b) for a, b in itertools.pairwise(points))
    if not points or way == 0.0:
        return ActorPlace(name=name, model="person", pose=points[0] if points else to_pose2d(pose))
    speed = way / lasts if lasts > 0.0 else _WALK_SPEED
    if speed > FASTEST:
        log.warning("%s: %s runs at %.1f m/s, here at %.1f", place.path, place.where, speed, FASTEST)
    loop = script is None or is_true(script.findtext("loop") or "true")
    return ActorPlace(
        name=name, model="person", pose=points[0], path=tuple(points), speed=min(speed, FASTEST), loop=loop
    )


_MOST = 5000  # limit of copies
_STEPS = np.array([0.7548776662466927, 0.5698402909980532])  # from the plastic number: a low-discrepancy sequence
_AXES = {"linear-x": 0, "linear-y": 1, "linear-z": 2}


def places_of(element: ET.Element, place: Place) -> list[Matrix]:
    """Poses of the copies, shapes (4, 4).

    Raises:
        WorldError: there is no region, the distribution is unknown, or a number is invalid.
    """
    outer = pose_of(element, place)
    spread = element.find("distribution")
    kind = ((spread.findtext("type") or spread.text or "") if spread is not None else "random").strip()
    if kind == "grid":
        offsets = _grid(element, place)
    else:
        count = floats(element.findtext("model_count") or "1", 1, place.inside("<model_count>"))[0]
        if not 0 <= count <= _MOST:
            raise place.inside("<model_count>").error(f"expected 0 to {_MOST}, got {count:g}")
        offsets = _spread(element, place, kind, int(count))
    return [from_xyz_rpy((outer @ (*offset, 1.0))[:3].tolist()) for offset in offsets]  # without rotation


def _grid(element: ET.Element, place: Place) -> NDArray[np.float64]:
    form = element.find("region/cuboid")
    form = element.find("distribution") if form is None else form
    if form is None or form.find("rows") is None:
        raise place.error("a grid has no <rows>")
    rows, columns = (int(floats(form.findtext(tag) or "1", 1, place.inside(f"<{tag}>"))[0]) for tag in ("rows", "cols"))
    if not 0 <= rows * columns <= _MOST:
        raise place.error(f"expected at most {_MOST} copies, got {rows} x {columns}")
    step = floats(form.findtext("step") or "1 1 0", 3, place.inside("<step>"))
    row, column = np.divmod(np.arange(rows * columns), max(columns, 1))
    offsets = np.column_stack((column, row, np.zeros(rows * columns))) * step
    if form.find("min") is not None:
        return offsets + floats(form.findtext("min") or "", 3, place.inside("<min>"))
    return offsets - np.array([(columns - 1) / 2.0, (rows - 1) / 2.0, 0.0]) * step


def _spread(element: ET.Element, place: Place, kind: str, count: int) -> NDArray[np.float64]:
    middle, size, radius = _region(element, place)
    if kind in _AXES:
        axis = _AXES[kind]
        share = np.full((count, 3), 0.5)
        share[:, axis] = np.arange(count) / max(count, 1)
    elif kind in ("random", "uniform"):
        rng = np.random.default_rng(zlib.crc32((element.get("name") or "").encode()))
        share = rng.random((count, 3))
        if kind == "uniform":
            share[:, :2] = (0.5 + np.arange(1, count + 1)[:, None] * _STEPS) % 1.0
    else:
        raise place.error(f"the distribution '{kind}' is not known")
    if radius and kind in ("random", "uniform"):
        far, bearing = radius * np.sqrt(share[:, 0]), math.tau * share[:, 1]
        across = np.column_stack((far * np.cos(bearing), far * np.sin(bearing)))
        places: NDArray[np.float64] = middle + np.column_stack((across, (share[:, 2] - 0.5) * size[2]))
        return places
    return middle + (share - 0.5) * size


def _region(element: ET.Element, place: Place) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
    """Centre and size of the region [m], and the radius of a cylinder, 0 for a box."""
    old = element.find("region/cuboid")
    if old is not None:
        low, high = (floats(old.findtext(tag) or "0 0 0", 3, place.inside(f"<{tag}>")) for tag in ("min", "max"))
        return (np.array(low) + high) / 2.0, np.array(high) - low, 0.0
    box = element.find("box")
    if box is not None:
        return np.zeros(3), np.abs(floats(box.findtext("size") or "", 3, place.inside("<size>"))), 0.0
    round_one = element.find("cylinder")
    round_one = element.find("region/cylinder") if round_one is None else round_one
    if round_one is None:
        raise place.error("has neither <box> nor <cylinder>")
    radius = sizes(round_one, "radius", 1, place)[0]
    tag = "length" if round_one.find("length") is not None else "height"
    length = sizes(round_one, tag, 1, place)[0]
    middle = floats(round_one.findtext("center") or "0 0 0", 3, place.inside("<center>"))
    return np.array(middle), np.array([2.0 * radius, 2.0 * radius, length]), radius
