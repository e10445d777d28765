"""Furniture that stands elsewhere than the world's file says, because somebody moved it since the map was made."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from rosbot_patrol.errors import WorldError
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.params import param
from rosbot_patrol.simulation.scene.matrices import from_pose2d
from rosbot_patrol.simulation.scene.scene import Body, Matrix


def _shift(by: Sequence[float]) -> str | None:
    return None if len(by) in (2, 3) else f"expected [x, y] or [x, y, yaw], got {list(by)}"


@dataclass(frozen=True, kw_only=True)
class MovedFurniture:
    """A model of the world that stands elsewhere from the beginning."""

    name: str = param(doc="name of the model in the world's file")
    by: list[float] = param(check=_shift, doc="[x, y] or [x, y, yaw]: shift in the map frame, and turn on the spot")


def model_of(body: Body) -> str:
    """Name of the model that a body is of: those of several links name them behind it."""
    return body.name.partition("/")[0].partition("::")[0]


def move_furniture(
    bodies: Sequence[Body], moved: Sequence[MovedFurniture], source: str = "the scenario"
) -> tuple[Body, ...]:
    """Move models with all their links; each turns about the origin of its first link.

    Args:
        bodies: of the world.
        moved: which models, and by how much.
        source: file that says so, for errors.

    Raises:
        WorldError: the world has no model of a name.
    """
    shifts: dict[str, Matrix] = {}
    for each in moved:
        first = next((body for body in bodies if model_of(body) == each.name), None)
        if first is None:
            raise WorldError(f"{source}: furniture '{each.name}'", "is no model of the world; its file names them")
        x, y, yaw = (*each.by, 0.0)[:3]
        at_x, at_y = (float(value) for value in first.pose[:2, 3])
        shifts[each.name] = from_pose2d(Pose2D(at_x + x, at_y + y, yaw)) @ from_pose2d(Pose2D(-at_x, -at_y, 0.0))
    return tuple(
        replace(body, pose=shifts[model_of(body)] @ body.pose) if model_of(body) in shifts else body for body in bodies
    )
