"""<polyline> geometry, as from Gazebo's model editor: outlines extruded to a height; an inner outline is a hole."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from xml.etree import ElementTree as ET

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.simulation.sdf.values import Place, floats, sizes

Ring = NDArray[np.float64]


def polyline_triangles(elements: Sequence[ET.Element], place: Place) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Vertices (V, 3) and outward triangles (F, 3) of the <polyline>s of one geometry.

    Raises:
        WorldError: fewer than three points, no height, or no area.
    """
    height = sizes(elements[0], "height", 1, place)[0]
    rings = [_ring(element, place.inside(f"polyline {i}")) for i, element in enumerate(elements)]
    corners = [*_walls(rings, height), *_lids(rings, height)]
    if len(corners) == 2 * sum(map(len, rings)):
        raise place.error("<polyline> encloses nothing")
    vertices = np.concatenate(corners)
    return vertices, np.arange(len(vertices)).reshape(-1, 3)


def _ring(element: ET.Element, place: Place) -> Ring:
    points = [floats(point.text or "", 2, place.inside("<point>")) for point in element.findall("point")]
    if len(points) > 1 and points[0] == points[-1]:
        points.pop()
    if len(points) < 3:
        raise place.error(f"expected at least 3 points, got {len(points)}")
    return np.array(points)


def _walls(rings: Sequence[Ring], height: float) -> list[NDArray[np.float64]]:
    """Two triangles for each wall, each of shape (3, 3)."""
    walls = []
    for i, ring in enumerate(rings):
        is_hole = sum(_holds(other, ring[0]) for k, other in enumerate(rings) if k != i) % 2 == 1
        if (_area(ring) > 0.0) == is_hole:
            ring = ring[::-1]
        for a, b in zip(ring, np.roll(ring, -1, axis=0), strict=True):
            low_a, low_b, high_b, high_a = (*a, 0.0), (*b, 0.0), (*b, height), (*a, height)
            walls += [np.array((low_a, low_b, high_b)), np.array((low_a, high_b, high_a))]
    return walls


def _lids(rings: Sequence[Ring], height: float) -> list[NDArray[np.float64]]:
    """Top and bottom, cut into strips between the y values of the corners; the even-odd rule decides what is inside."""
    begins = np.concatenate(rings)
    ends = np.concatenate([np.roll(ring, -1, axis=0) for ring in rings])
    lids = []
    levels = np.unique(begins[:, 1])
    for low, high in itertools.pairwise(levels):
        crossing = (np.minimum(begins[:, 1], ends[:, 1]) <= low) & (np.maximum(begins[:, 1], ends[:, 1]) >= high)
        a, b = begins[crossing], ends[crossing]
        slope = (b[:, 0] - a[:, 0]) / (b[:, 1] - a[:, 1])
        at_low, at_high = (a[:, 0] + (y - a[:, 1]) * slope for y in (low, high))
        order = np.argsort(at_low + at_high)
        for left, right in zip(order[::2], order[1::2], strict=False):
            quad = ((at_low[left], low), (at_low[right], low), (at_high[right], high), (at_high[left], high))
            for one, two, three in ((0, 1, 2), (0, 2, 3)):
                if quad[one] == quad[two] or quad[two] == quad[three] or quad[one] == quad[three]:
                    continue
                lids.append(np.array([(*quad[k], height) for k in (one, two, three)]))
                lids.append(np.array([(*quad[k], 0.0) for k in (one, three, two)]))
    return lids


def _area(ring: Ring) -> float:
    x, y = ring.T
    return float(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1))) / 2.0


def _holds(ring: Ring, point: NDArray[np.float64]) -> bool:
    a, b = ring, np.roll(ring, -1, axis=0)
    spans = (a[:, 1] > point[1]) != (b[:, 1] > point[1])
    x = a[spans, 0] + (point[1] - a[spans, 1]) / (b[spans, 1] - a[spans, 1]) * (b[spans, 0] - a[spans, 0])
    return bool(np.count_nonzero(x > point[0]) % 2)
