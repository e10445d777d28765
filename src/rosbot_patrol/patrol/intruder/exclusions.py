"""Whether what a box shows may be an intruder: as large as a person, no picture, inside the house, nothing known.

A doubt is no reason to refuse a person: what was not measured is not held against a box.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

from rosbot_patrol.params import param
from rosbot_patrol.patrol.house.floor import Floor
from rosbot_patrol.patrol.records.inputs import Box, Measured


@dataclass(frozen=True, kw_only=True)
class ExclusionParams:
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
class KnownObject:
    """Something that stands in the house and looks like somebody: place in map [m], reach [m], what it is."""

    x: float
    y: float
    radius: float = 0.5
    name: str = "a known object"
    label: str = ""

    def is_at(self, measured: Measured) -> bool:
        """Whether a place may be its own."""
        return math.hypot(measured.x - self.x, measured.y - self.y) <= self.radius + min(measured.error, 0.5)


class Reason(Enum):
    """Why a box shows no intruder; the value is the sentence."""

    FAR = "it is too far off to be measured"
    KNOWN = "it is a known object"
    OUTSIDE = "it is outside of the floor that the map shows"
    FLAT = "it is flat, a picture or a screen"
    LARGE = "it is too large for a person"
    PET = "it is as low as a pet"
    SMALL = "it is too small for a person"
    PART = "only a part of it is in the picture"


@dataclass(frozen=True)
class Exclusion:
    """A reason, and a more exact sentence if there is one."""

    reason: Reason
    detail: str = ""

    @property
    def text(self) -> str:
        """For people."""
        return self.detail or self.reason.value


_NEAR_ERROR = 0.35  # of a place by the floor that is good enough to tell the size: right before the camera [m]


class Exclusions:
    """Refuses what cannot be an intruder.

    Args:
        params: what a person may look like.
        known: what stands in the house.
        floor: of the map, where there is one.
    """

    def __init__(
        self, params: ExclusionParams | None = None, known: tuple[KnownObject, ...] = (), floor: Floor | None = None
    ) -> None:
        self.params, self.known, self.floor = params or ExclusionParams(), known, floor

    def exclusion(self, box: Box) -> Exclusion | None:
        """Why a box is no intruder, None if it may be one."""
        m = box.measured
        if m is None:
            return Exclusion(Reason.FAR) if box.doubt else None
        known = self._known(box, m)
        if known is not None:
            return known
        reason = self._outside(m) or (Reason.FLAT if m.is_flat else None) or self._size(box, m) or _part(box, m)
        return Exclusion(reason) if reason else None

    def refusal(self, box: Box) -> str:
        """The sentence of `exclusion`, "" if the box may be an intruder."""
        found = self.exclusion(box)
        return found.text if found else ""

    def is_too_near(self, box: Box) -> bool:
        """Whether so little of it is in the picture that a person and a pet look alike: legs, or a part at its side."""
        m = box.measured
        if m is None or box.label != "person" or not _has_size(m) or not (goes_on(box, m) or m.is_cut_aside):
            return False
        return m.top < self.params.person_top_min and m.width < self.params.lying_length

    def _known(self, box: Box, m: Measured) -> Exclusion | None:
        found = next((k for k in self.known if k.is_at(m) and k.label in ("", box.label)), None)
        return Exclusion(Reason.KNOWN, f"it is {found.name} at ({found.x:.1f}, {found.y:.1f})") if found else None

    def _outside(self, m: Measured) -> Reason | None:
        if self.floor is None or m.source == "floor":
            return None
        within = self.params.outside_after + m.error
        is_inside = self.floor.nearest(self.floor.free, m.x, m.y, within) is not None
        return None if is_inside else Reason.OUTSIDE

    def _size(self, box: Box, m: Measured) -> Reason | None:
        p = self.params
        if box.label != "person" or not _has_size(m):
            return None
        sure = max(1.0 - 0.5 * m.error, 0.6)  # the bounds are relaxed as the distance is uncertain
        if m.top > p.person_top_max / sure or m.width > p.person_width_max / sure:
            return Reason.LARGE
        if m.width >= p.lying_length * sure:
            return None
        if goes_on(box, m) or m.is_cut_aside:  # the picture ends before it does
            return None
        if m.top < p.person_top_min * sure:
            return Reason.PET
        return Reason.SMALL if m.height < p.person_height_min * sure else None


def _part(box: Box, m: Measured) -> Reason | None:
    """Half a chair at the picture's side may be half a hydrant; a thing stays, and is seen whole as the robot turns."""
    return Reason.PART if m.is_cut_aside and box.label != "person" else None


def _has_size(m: Measured) -> bool:
    """Whether its distance is known so well that its size is."""
    return m.source != "floor" or m.error <= _NEAR_ERROR


def goes_on(box: Box, m: Measured) -> bool:
    """Whether there may be more of what a box shows above the picture."""
    return m.is_cut_above or (m.is_cut and box.ymin <= box.slack)
