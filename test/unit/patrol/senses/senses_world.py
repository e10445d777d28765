"""Stand-ins for what the senses are given: a robot's transforms, and diagnostics that keep what was told."""

from __future__ import annotations

from rosbot_patrol.errors import TransformError
from rosbot_patrol.geometry import Pose2D, Transform
from rosbot_patrol.patrol.house.rooms import Room, Rooms
from rosbot_patrol.tf.tree import Edge, TransformTree

ROOMS = Rooms((Room(id=0, name="home", pose=Pose2D()), Room(id=1, name="hall", pose=Pose2D(3.0))), source="rooms")
OPTICAL = (-0.5, 0.5, -0.5, 0.5)  # z ahead, x right, y down


class Health:
    """Keeps what was told."""

    def __init__(self) -> None:
        self.parts: dict[str, tuple[int, str]] = {}
        self.told: list[tuple[str, int, str]] = []

    def set(self, part: str, level: int, message: str) -> None:
        self.parts[part] = level, message
        self.told.append((part, level, message))

    def drop(self, part: str) -> None:
        self.parts.pop(part)


class LaserFrames:
    """The robot stands at (1, 2) in map; the laser is turned on it."""

    def __init__(self, laser: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 1.0)) -> None:
        self.laser, self.is_known = laser, True

    def transform(self, target: str, source: str, stamp: float | None = None) -> Transform:
        del stamp
        if not self.is_known:
            raise TransformError(target, source, "not yet")
        return Transform(1.0, 2.0, 0.2, *self.laser)

    def lookup(self, target: str, source: str, stamp: float | None = None) -> Pose2D:
        return self.transform(target, source, stamp).pose

    def lookup_stamped(self, target: str, source: str) -> tuple[Pose2D, float]:
        return self.lookup(target, source), 10.0


def robot_tree(*, known_until: float = 10.0) -> TransformTree:
    """A robot at (1, 0) that looks along x, with a camera half a metre over the floor."""
    tree = TransformTree()
    tree.add(Edge("base_link", "camera", 0.0, 0.0, 0.0, 0.5, *OPTICAL), is_static=True)
    tree.add(Edge("map", "odom", 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0), is_static=True)
    for stamp in (9.0, known_until):
        tree.add(Edge("odom", "base_link", stamp, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0))
    return tree
