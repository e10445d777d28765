"""Where the object of a box stands, and how large it is: by depth, by the lidar, or by where its box meets the floor.

Distances are taken in this order. Depth tells the nearest thing in the middle of the box, and whether all of it lies
in one plane, as a picture on a wall does. The lidar tells what stands in the box's bearings that the map does not show:
legs. Where neither tells, the lower edge of the box is taken for the feet. The error of that distance is a few per
cent near the camera and tens of per cent farther off, because the camera is low. A box that ends at the picture's lower
edge has no feet.

A depth camera that knows the depth of little of a box sees furniture before one who stands beyond its range, where the
lidar sees legs farther off; so it does where the upper part of the box is as far off as the lidar's legs.

Nothing in a box is farther off than the floor beneath its lower edge. Depth that says so is of what shows between the
legs or beside them, as of dark clothes or of one nearer than a depth camera can measure, and is not taken.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.geometry import angle_difference, wrap_angles
from rosbot_patrol.patrol.intruder.legs import go_straight_up
from rosbot_patrol.patrol.intruder.measure_depth import (
    ASIDE,
    DEEP,
    GRID,
    UP,
    is_beyond,
    is_flat,
    nearest_within,
    object_distance,
    upper_part_is_at,
    upright_distance,
)
from rosbot_patrol.patrol.records.inputs import Box, Measured

Array = NDArray[np.float64]

_EDGE = 3  # a box that ends so near to the picture's lower or outer edges may go on beyond them [px]
_HEADROOM = 0.06  # with less between a box and the picture's upper edge there may be more above it [m]
_THICK = 0.12  # from the front of a person to the middle [m]
_ABOUT = 1.25  # so far off a row of the picture tells the floor's distance to within that
_LEGS = 2  # beams, at least


@dataclass(frozen=True)
class Lens:
    """A pinhole camera: focal lengths and middle [px], size of the picture [px]."""

    fx: float
    fy: float
    cx: float
    cy: float
    width: int
    height: int

    @property
    def view_width(self) -> float:
        """Angle that a picture spans from left to right [rad]."""
        return math.atan2(self.cx, self.fx) + math.atan2(self.width - self.cx, self.fx)


@dataclass(frozen=True)
class View:
    """From where a picture was taken.

    Attributes:
        lens: of the colour picture.
        map_from_optical: pose of the camera (z ahead, x right, y down), z from the floor, shape (4, 4).
    """

    lens: Lens
    map_from_optical: Array

    def ray(self, u: float, v: float) -> Array:
        """Direction of a pixel in map, of length 1 along the optical axis, shape (3,)."""
        lens = self.lens
        along = np.array([(u - lens.cx) / lens.fx, (v - lens.cy) / lens.fy, 1.0])
        return np.asarray(self.map_from_optical[:3, :3] @ along)

    @property
    def eye(self) -> Array:
        """Place of the camera [m], shape (3,)."""
        return np.asarray(self.map_from_optical[:3, 3])

    @property
    def yaw(self) -> float:
        """Heading of the camera in map [rad]."""
        ahead = self.map_from_optical[:3, 2]
        return math.atan2(ahead[1], ahead[0])


@dataclass(frozen=True)
class Depth:
    """A depth picture: metres along the optical axis, NaN where unknown, shape (H, W), and its lens."""

    metres: NDArray[np.float32]
    lens: Lens


def measure(box: Box, view: View, depth: Depth | None = None, unmapped: Array | None = None) -> Box:
    """A box with its place and size.

    Args:
        box: in the colour picture.
        view: of the colour picture.
        depth: taken at the same time by a camera beside it.
        unmapped: what the lidar hits where the map shows nothing, in map [m], shape (N, 2).
    """
    if box.width <= 0 or box.height <= 0:
        return box
    flat: bool | None = None
    most, is_behind = _farthest(box, view), False
    found = _by_lidar(box, view, unmapped) if unmapped is not None else None
    if depth is not None:
        samples = _samples(box, view.lens, depth)
        along, is_before = object_distance(samples)
        if found is not None and found <= _ABOUT * most and _are_legs_behind(found, along, samples):
            return replace(box, measured=_at(box, view, found, source="lidar", error=0.15 + 0.02 * found, flat=None))
        is_behind = along is not None and along > most
        is_borne_out = found is not None and along is not None and abs(found - along) < DEEP
        leg = None if along is None or is_borne_out else _leg_before(along, samples, box, view)
        if leg is not None:
            along = leg
        elif is_behind:
            along = nearest_within(samples, most)
        else:
            around = _samples(box, view.lens, depth, ASIDE, UP) if is_before.any() else None
            flat = is_flat(samples, is_before, around)
        if along is not None:
            measured = _at(box, view, along, source="depth", error=0.1 + 0.02 * along, flat=flat)
            # aside: one foreleg of a large dog goes straight up, too
            is_cut = measured.is_cut_above and not measured.is_cut_aside
            if is_cut and found is not None and abs(found - along) < DEEP:
                measured = replace(measured, has_legs=_has_legs(samples, box, view, along))
            return replace(box, measured=measured)
    if found is not None and found <= most:
        return replace(box, measured=_at(box, view, found, source="lidar", error=0.15 + 0.02 * found, flat=flat))
    told = _by_floor(box, view, is_behind=is_behind)
    if told is None:
        return box
    found, error = told
    return replace(box, measured=_at(box, view, found, source="floor", error=error, flat=flat))


def _at(box: Box, view: View, along: float, *, source: str, error: float, flat: bool | None) -> Measured:
    """The record of an object with its front this far along the optical axis [m]."""
    lens, middle = view.lens, (box.xmin + box.xmax) / 2.0
    place = view.eye + view.ray(middle, lens.cy) * (along + _THICK)
    top = view.eye + view.ray(middle, box.ymin) * along
    away = math.hypot(*(place - view.eye)[:2])
    is_cut_above = box.ymin <= box.slack or box.ymin / lens.fy * along < _HEADROOM
    return Measured(
        x=float(place[0]),
        y=float(place[1]),
        error=error,
        away=away,
        top=float(top[2]),
        height=box.height / lens.fy * along,
        width=box.width / lens.fx * along,
        is_cut=is_cut_above or box.ymax >= lens.height - _EDGE,
        is_cut_above=is_cut_above,
        is_cut_aside=box.xmin <= _EDGE or box.xmax >= lens.width - _EDGE,
        is_flat=flat,
        source=source,
    )


def _samples(box: Box, lens: Lens, depth: Depth, aside: int = 0, up: int = 0) -> Array:
    """Depths over a box, on a grid of GRID by GRID, shape (rows, columns); both cameras look the same way.

    Args:
        box: in the colour picture.
        lens: of that.
        depth: the other picture.
        aside: so many samples more to either side, NaN beyond the picture.
        up: and above.
    """
    other, (high, wide) = depth.lens, depth.metres.shape
    columns = (_middles(box.xmin, box.xmax, aside, aside) - lens.cx) / lens.fx * other.fx + other.cx
    rows = (_middles(box.ymin, box.ymax, up) - lens.cy) / lens.fy * other.fy + other.cy
    found = depth.metres[
        np.ix_(np.clip(np.rint(rows), 0, high - 1).astype(int), np.clip(np.rint(columns), 0, wide - 1).astype(int))
    ].astype(np.float64)
    if aside or up:
        found[(rows < 0) | (rows > high - 1)] = np.nan
        found[:, (columns < 0) | (columns > wide - 1)] = np.nan
    return np.asarray(found)


def _middles(first: float, last: float, before: int = 0, after: int = 0) -> Array:
    """Middles of the rows or columns of the grid over a span, and of so many more before and after it."""
    step = (last - first) / GRID
    return np.asarray(first + step * (np.arange(-before, GRID + after) + 0.5))


def _are_legs_behind(found: float, along: float | None, samples: Array) -> bool:
    """Whether the lidar's legs are of the one in the box, and what depth tells is of something before [m]."""
    if is_beyond(samples):
        return found > (along or 0.0)
    return along is not None and found > along + DEEP and upper_part_is_at(samples, along, found)


def _has_legs(samples: Array, box: Box, view: View, along: float) -> bool | None:
    """Whether what is so far along the optical axis [m] stands as a person does."""
    lens, eye = view.lens, float(view.eye[2])
    heights = eye - (_middles(box.ymin, box.ymax) - lens.cy) / lens.fy * along
    return go_straight_up(samples, along, heights, eye, box.width / GRID / lens.fx * along)


def _by_lidar(box: Box, view: View, unmapped: Array) -> float | None:
    """Distance along the optical axis of what the lidar sees in a box and the map does not show [m]."""
    if not len(unmapped):
        return None
    away = unmapped - view.eye[:2]
    distances, bearings = np.hypot(*away.T), np.arctan2(away[:, 1], away[:, 0])
    inner = 0.1 * box.width
    left, right = (view.ray(u, view.lens.cy) for u in (box.xmin + inner, box.xmax - inner))
    first = math.atan2(right[1], right[0])
    half = angle_difference(math.atan2(left[1], left[0]), first) / 2.0
    middle = first + half
    inside = np.abs(wrap_angles(bearings - middle)) <= abs(half)
    if inside.sum() < _LEGS:
        return None
    near = np.sort(distances[inside])
    legs = near[near < near[_LEGS - 1] + DEEP]
    ahead = math.cos(middle - view.yaw)
    return float(np.median(legs)) * ahead if ahead > 0.1 else None


def _by_floor(box: Box, view: View, *, is_behind: bool) -> tuple[float, float] | None:
    """Distance along the optical axis at which the lower edge of a box meets the floor, and about its error [m].

    Args:
        box: in the colour picture.
        view: of it.
        is_behind: depth says that it is right before the camera: so it is where the box goes on beneath the picture.
    """
    if box.ymax >= view.lens.height - _EDGE and not is_behind:
        return None
    found = _floor_at(box, view, float(box.ymax))
    if not 0.2 < found < 15.0:
        return None
    spread = _floor_at(box, view, box.ymax - box.slack) - _floor_at(box, view, box.ymax + box.slack)
    return found, min(0.3 + 0.25 * found, 0.1 + 0.25 * spread)


def _farthest(box: Box, view: View) -> float:
    """How far what a box shows can be at most, along the optical axis [m]: the floor ends its lower edge."""
    return _floor_at(box, view, box.ymax - box.slack)


def _about_floor(box: Box, view: View) -> tuple[float, float]:
    """Between which distances a thing stands that meets the floor at the lower edge of a box [m]; 0, 0: it does not."""
    if box.ymax >= view.lens.height - _EDGE:
        return 0.0, 0.0
    found = _floor_at(box, view, float(box.ymax))
    return 0.85 * _floor_at(box, view, box.ymax + box.slack), 1.1 * found if found < 15.0 else 0.0


def _leg_before(along: float, samples: Array, box: Box, view: View) -> float | None:
    """How far a leg is where the floor ends the box, before what depth tells and what is beyond that floor [m]."""
    least, most = _about_floor(box, view)
    leg = upright_distance(samples, least, most) if along > most else None
    return leg if leg is not None and leg < along - DEEP else None


def _floor_at(box: Box, view: View, row: float) -> float:
    """Where the floor is in a row of the picture below the middle of a box, along the optical axis [m]."""
    down = -float(view.ray((box.xmin + box.xmax) / 2.0, row)[2])
    return float(view.eye[2]) / down if down > 0.005 else math.inf
