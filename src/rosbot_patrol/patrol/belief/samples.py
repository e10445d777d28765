"""Samples for the fit: of recorded turns, and of photographs with boxes."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from rosbot_patrol.geometry import angle_difference
from rosbot_patrol.patrol.belief.calibration import Condition
from rosbot_patrol.patrol.belief.fitting import Samples
from rosbot_patrol.patrol.belief.likelihoods import possibility
from rosbot_patrol.patrol.belief.params import BeliefParams
from rosbot_patrol.patrol.belief.recorded import PETS, Scene
from rosbot_patrol.patrol.records.inputs import Box, Eye

Corners = tuple[float, float, float, float]

_EDGE = 3.0  # [px] distance from the image border at which a box counts as cut
_SHOWN = 0.3  # share of a person's columns that must be in the picture
_SAME = 0.5  # share of the narrower one's columns that a box and its person have in common
_SECTOR = 0.2  # [rad] width of a part of the view that is one place
_INSIDE = 0.45  # [rad] half the view in which a sector lies


def add_scene(samples: Samples, scene: Scene, network: str) -> None:
    """Take the pictures of a recorded scene.

    Boxes that size or depth exclude are left out: they are judged by that, not by their score.
    """
    params = BeliefParams()
    for number, look in enumerate(scene.looks):
        for frame in look.frames.get(network, ()):
            assert frame.eye is not None
            truth = scene.box_of(look, frame.eye)
            person = truth if scene.has_person else None
            boxes = [box for box in frame.boxes if (possibility(box, params) or (1.0,))[0] >= 0.5]
            side = (scene.number, number)
            _add_picture(samples, person, boxes, (scene.columns, scene.rows), is_dark=scene.is_dark, side=side)
            if scene.kind in PETS and truth is not None and _is_shown(truth, scene.columns):
                scores = [box.probability for box in frame.boxes if _is_of(box, truth)]
                samples.pets[side].append(max(scores, default=0.0))
            free = [box for box in boxes if truth is None or not _overlap(_corners(box), truth)]
            _add_nobody(samples, free, frame.eye, scene, side)


def add_photograph(
    samples: Samples, persons: Sequence[Corners], boxes: Sequence[Box], size: tuple[int, int], *, is_dark: bool = False
) -> None:
    """Take a photograph: persons in it, boxes of a network, width and height [px]."""
    key = sum(samples.pictures), "photograph"
    for k, person in enumerate(persons):
        _add_picture(samples, person, boxes, size, is_dark=is_dark, side=(key, k))
    free = [box for box in boxes if not any(_overlap(_corners(box), person) for person in persons)]
    samples.pictures[is_dark] += 1
    for k, box in enumerate(free):
        samples.false[key, "false", k].append((_condition(_corners(box), size, is_dark), box.probability))


def _add_picture(
    samples: Samples,
    person: Corners | None,
    boxes: Iterable[Box],
    size: tuple[int, int],
    *,
    is_dark: bool,
    side: object,
) -> None:
    if person is None:
        return
    if not _is_shown(person, size[0]):
        return
    scores = [box.probability for box in boxes if _is_of(box, person)]
    samples.persons[side].append((_condition(person, size, is_dark), max(scores, default=0.0)))


def _is_shown(subject: Corners, columns: int) -> bool:
    """Whether enough of a subject's columns are in the picture."""
    left, _, right, _ = subject
    return min(right, columns) - max(left, 0.0) >= _SHOWN * (right - left)


def _add_nobody(samples: Samples, boxes: Sequence[Box], eye: Eye, scene: Scene, side: object) -> None:
    samples.pictures[scene.is_dark] += 1
    size = scene.columns, scene.rows
    by_sector: dict[int, Box] = {}
    for box in boxes:
        sector = round((eye.pose.yaw + eye.bearing((box.xmin + box.xmax) / 2.0)) / _SECTOR)
        if sector not in by_sector or by_sector[sector].probability < box.probability:
            by_sector[sector] = box
    first = math.ceil((eye.pose.yaw - _INSIDE) / _SECTOR)
    for sector in range(first, first + int(2.0 * _INSIDE / _SECTOR)):
        if abs(angle_difference(sector * _SECTOR, eye.pose.yaw)) <= _INSIDE and sector not in by_sector:
            samples.silent[side, sector] += 1
    for sector, box in by_sector.items():
        at = _condition(_corners(box), size, scene.is_dark)
        samples.false[side, sector].append((at, box.probability))


def _corners(box: Box) -> Corners:
    return float(box.xmin), float(box.ymin), float(box.xmax), float(box.ymax)


def _condition(corners: Corners, size: tuple[int, int], is_dark: bool) -> Condition:
    left, top, right, bottom = corners
    return Condition((bottom - top) / max(size), left <= _EDGE or right >= size[0] - _EDGE, is_dark)


def _overlap(a: Corners, b: Corners) -> bool:
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]


def _is_of(box: Box, person: Corners) -> bool:
    """Whether a box is drawn around a person: it shares half the columns of the narrower, and half the rows."""
    x0, y0, x1, y1 = _corners(box)
    wide, high = min(x1, person[2]) - max(x0, person[0]), min(y1, person[3]) - max(y0, person[1])
    return wide > _SAME * min(x1 - x0, person[2] - person[0]) and high > _SAME * min(y1 - y0, person[3] - person[1])
