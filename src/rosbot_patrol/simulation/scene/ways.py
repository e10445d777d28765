"""Free paths of actors: sections through the world at a few heights show the obstacles."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from rosbot_patrol.errors import WorldError
from rosbot_patrol.geometry import Pose2D, distance
from rosbot_patrol.simulation.scene.scene import Body
from rosbot_patrol.simulation.scene.sight import Sight
from rosbot_patrol.simulation.scene.slices import EMPTY, Slice, slice_bodies

EYE_LEVEL = 1.3  # obstacles as high as this count as walls [m]
LEVELS = (0.15, 0.75, EYE_LEVEL)  # a wandering actor avoids obstacles at these heights [m]


class Ways:
    """The free paths through a world of static bodies.

    Args:
        bodies: the static bodies.
    """

    def __init__(self, bodies: Sequence[Body]) -> None:
        self._set(bodies)

    @property
    def bodies(self) -> tuple[Body, ...]:
        """The static bodies."""
        return self._bodies

    def add(self, body: Body) -> None:
        """Add a static body."""
        self._set((*self._bodies, body))

    def remove(self, name: str) -> None:
        """Remove the body of that name."""
        self._set([body for body in self._bodies if body.name != name])

    def _set(self, bodies: Sequence[Body]) -> None:
        self._bodies = tuple(bodies)
        self._cuts: dict[float, Slice] = {}
        self.sight = Sight(bodies)

    @property
    def names(self) -> set[str]:
        """Names of the static bodies."""
        return {body.name for body in self._bodies}

    def cut(self, height: float) -> Slice:
        """Section at a height [m]; cached."""
        if height not in self._cuts:
            self._cuts[height] = slice_bodies(self._bodies, height)
        return self._cuts[height]

    def check(self, actor: str, points: Sequence[Pose2D]) -> None:
        """Refuse a path through a wall; furniture below eye level is ignored.

        Raises:
            WorldError: a wall crosses the path; the text names it, and the points around it.
        """
        for a, b in pairwise(points):
            if self.cut(EYE_LEVEL).is_blocked((a.x, a.y), (b.x, b.y)):
                line = f"from ({a.x:.2f}, {a.y:.2f}) to ({b.x:.2f}, {b.y:.2f})"
                raise WorldError(f"actor '{actor}'", f"cannot walk {line}: '{self._first_between(a, b)}' is there")

    def is_free(self, start: Pose2D, goal: Pose2D, radius: float, doors: Sequence[Slice] = ()) -> bool:
        """Whether a vertical cylinder can go straight from one place to another and stand there.

        Args:
            start: its present place.
            goal: its next place.
            radius: radius of the cylinder [m].
            doors: sections through moving bodies, one for each of LEVELS.
        """
        away = distance(start, goal)
        if away == 0.0:
            return True
        dx, dy = (goal.x - start.x) / away, (goal.y - start.y) / away
        for cut in (*map(self.cut, LEVELS), *doors):
            for side in (-radius, 0.0, radius):
                x, y = start.x - side * dy, start.y + side * dx
                reach = away + math.sqrt(max(radius**2 - side**2, 0.0))
                if cut.is_blocked((x, y), (x + reach * dx, y + reach * dy)):
                    return False
        return True

    def _first_between(self, a: Pose2D, b: Pose2D) -> str:
        for body in self._bodies:
            if slice_bodies([body], EYE_LEVEL).is_blocked((a.x, a.y), (b.x, b.y)):
                return body.name
        return "something"


def together(cuts: Sequence[Slice]) -> Slice:
    """Combine several sections."""
    segments = [cut.segments for cut in cuts if len(cut.segments)]
    circles = [cut.circles for cut in cuts if len(cut.circles)]
    return Slice(
        np.concatenate(segments) if segments else EMPTY.segments,
        np.concatenate(circles) if circles else EMPTY.circles,
    )
