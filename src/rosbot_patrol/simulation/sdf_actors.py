"""Who walks or stands in a world: its <actor>s, and the models that are a person or a fire hydrant."""

from __future__ import annotations

import itertools
import logging
import re
from collections.abc import Iterable
from dataclasses import dataclass
from xml.etree import ElementTree as ET

from rosbot_patrol.geometry import Pose2D, distance
from rosbot_patrol.simulation.matrices import to_pose2d
from rosbot_patrol.simulation.scene import Matrix
from rosbot_patrol.simulation.sdf_values import Place, floats, is_true, pose_of
from rosbot_patrol.simulation.walkers import FASTEST

log = logging.getLogger(__name__)

_WORDS = {"person": "person", "pedestrian": "person", "hydrant": "fire_hydrant"}
_WALK_SPEED = 0.8  # of an actor whose waypoints tell no time [m/s]


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


def actor_kind(words: Iterable[str]) -> str | None:
    """The actor that a model's names speak of, None where it is a thing."""
    text = set(re.split(r"[^a-z]+", " ".join(words).lower()))
    return next((kind for word, kind in _WORDS.items() if word in text), None)


def read_actor(element: ET.Element, place: Place, name: str, pose: Matrix) -> ActorPlace:
    """An <actor> of Gazebo's: the trajectories of its script one after the other, at their mean speed.

    Args:
        element: the <actor>.
        place: of the element.
        name: that it bears here.
        pose: world_from_actor, where it stands if it has no trajectory; waypoints are against the world.

    Raises:
        WorldError: numbers that make no sense.
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
