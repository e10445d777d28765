"""Whether what a box shows may be an intruder: as large as a person, no picture, inside the house, nothing known.

A doubt is no reason to refuse a person: what was not measured is not held against a box.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from rosbot_patrol.params import param
from rosbot_patrol.patrol.house.floor import Floor
from rosbot_patrol.patrol.records.inputs import Box, Measured


@dataclass(frozen=True, kw_only=True)
class JudgeParams:
    """Sizes and places that a person can have."""

    person_top_min: float = param(
        0.9,
        unit="m",
        lo=0.0,
        doc="minimum height of a person's top; anything lower counts as a pet unless it is `lying_length` long",
    )
    person_top_max: float = param(2.3, unit="m", lo=0.5, doc="maximum height of a person's top")
    person_height_min: float = param(0.3, unit="m", lo=0.0, doc="minimum visible height of a person")
    lying_length: float = param(
        1.25, unit="m", lo=0.3, doc="minimum width at which something low may be a person who lies or crawls"
    )
    person_width_max: float = param(2.2, unit="m", lo=0.5, doc="maximum width of a person")
    outside_after: float = param(
        1.0, unit="m", lo=0.0, doc="distance from the map's free floor beyond which a sighting is outside the house"
    )


@dataclass(frozen=True, kw_only=True)
class Known:
    """Something that stands in the house and looks like somebody: place in map [m], reach [m], what it is."""

    x: float
    y: float
    radius: float = 0.5
    name: str = "a known object"
    label: str = ""

    def is_at(self, measured: Measured) -> bool:
        """Whether a place may be its own."""
        return math.hypot(measured.x - self.x, measured.y - self.y) <= self.radius + min(measured.error, 0.5)


PET = "it is as low as a pet"
_NEAR_ERROR = 0.35  # of a place by the floor that is good enough to tell the size: right before the camera [m]


class Judge:
    """Refuses what cannot be an intruder.

    Args:
        params: what a person may look like.
        known: what stands in the house.
        floor: of the map, where there is one.
    """

    def __init__(
        self, params: JudgeParams | None = None, known: tuple[Known, ...] = (), floor: Floor | None = None
    ) -> None:
        self.params, self.known, self.floor = params or JudgeParams(), known, floor

    def refusal(self, box: Box) -> str:
        """Why a box is no intruder, "" where it may be one."""
        m = box.measured
        if m is None:
            return "it is too far off to be measured" if box.doubt else ""
        return self._known(box, m) or self._outside(m) or self._picture(m) or self._size(box, m) or _part(box, m)

    def is_too_near(self, box: Box) -> bool:
        """Whether so little of it is in the picture that a person and a pet look alike: legs, or a part at its side."""
        m = box.measured
        if m is None or box.label != "person" or not _has_size(m) or not (goes_on(box, m) or m.is_cut_aside):
            return False
        return m.top < self.params.person_top_min and m.width < self.params.lying_length

    def _known(self, box: Box, m: Measured) -> str:
        found = next((k for k in self.known if k.is_at(m) and k.label in ("", box.label)), None)
        return f"it is {found.name} at ({found.x:.1f}, {found.y:.1f})" if found else ""

    def _outside(self, m: Measured) -> str:
        if self.floor is None or m.source == "floor":
            return ""
        within = self.params.outside_after + m.error
        if self.floor.nearest(self.floor.free, m.x, m.y, within) is not None:
            return ""
        return "it is outside of the floor that the map shows"

    def _picture(self, m: Measured) -> str:
        return "it is flat, a picture or a screen" if m.is_flat else ""

    def _size(self, box: Box, m: Measured) -> str:
        p = self.params
        if box.label != "person" or not _has_size(m):
            return ""
        sure = max(1.0 - 0.5 * m.error, 0.6)  # of the bounds, as far as the distance is
        if m.top > p.person_top_max / sure or m.width > p.person_width_max / sure:
            return "it is too large for a person"
        if m.width >= p.lying_length * sure:
            return ""
        if goes_on(box, m) or m.is_cut_aside:  # the picture ends before it does
            return ""
        if m.top < p.person_top_min * sure:
            return PET
        return "it is too small for a person" if m.height < p.person_height_min * sure else ""


def _part(box: Box, m: Measured) -> str:
    """Half a chair at the picture's side may be half a hydrant; a thing stays, and is seen whole as the robot turns."""
    return "only a part of it is in the picture" if m.is_cut_aside and box.label != "person" else ""


def _has_size(m: Measured) -> bool:
    """Whether its distance is known so well that its size is."""
    return m.source != "floor" or m.error <= _NEAR_ERROR


def goes_on(box: Box, m: Measured) -> bool:
    """Whether there may be more of what a box shows above the picture."""
    return m.is_cut_above or (m.is_cut and box.ymin <= box.slack)
