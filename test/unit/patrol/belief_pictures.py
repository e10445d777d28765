"""Pictures for the tests of the belief: an eye, a free view, boxes with places."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.patrol.belief.belief import Belief, PictureView
from rosbot_patrol.patrol.belief.calibration import EDGES, SHAPE, Calibration
from rosbot_patrol.patrol.belief.hypothesis import Hypothesis
from rosbot_patrol.patrol.belief.networks import Network
from rosbot_patrol.patrol.records.inputs import Box, Eye, Frame, Measured
from rosbot_patrol.patrol.visibility.coverage import Sight

WIDTH, COLUMNS = 1.047, 640
FOCAL = 0.5 * COLUMNS / math.tan(0.5 * WIDTH)
WEST, SOUTH, EAST = Pose2D(-3.0, 0.0, 0.0), Pose2D(0.0, -3.0, math.pi / 2.0), Pose2D(3.0, 0.0, math.pi)


def calibration(*, rho_person: float = 0.6, rho_nobody: float = 0.3) -> Calibration:
    """A good network: a person is missed in 10 %, and one place in 1,000 has a false box."""
    person = np.array([0.1, 0.02, 0.03, 0.05, 0.1, 0.2, 0.3, 0.2])
    nobody = np.array([0.999, 0.0005, 0.0002, 0.0001, 0.00008, 0.00006, 0.00004, 0.00002])
    tables = [np.broadcast_to(row / row.sum(), SHAPE).copy() for row in (person, nobody)]
    assert len(person) == len(EDGES)
    return Calibration("test", "sum", rho_person, rho_nobody, *tables)


def good_network() -> Network:
    """A network that a manager may run with."""
    return Network(calibration(), 0.06)


def eye_at(pose: Pose2D) -> Eye:
    return Eye(pose=pose, width=WIDTH, columns=COLUMNS)


def open_view(eye: Pose2D, *, length: float = 12.0, is_dark: bool = False, has_scan: bool = False) -> PictureView:
    sight = Sight(eye.x, eye.y, 0.0, math.tau / 360, np.full(360, length))
    return PictureView(sight, is_dark, has_scan)


def box_of(
    eye: Pose2D,
    x: float = 0.0,
    y: float = 0.0,
    *,
    score: float = 0.9,
    tall: float = 1.7,
    wide: float = 0.5,
    **m: object,
) -> Box:
    """A box of a thing that stands at a place, measured by depth unless `source` says otherwise."""
    away = math.hypot(x - eye.x, y - eye.y)
    ahead = math.atan2(y - eye.y, x - eye.x) - eye.yaw
    column = COLUMNS / 2.0 - FOCAL * math.tan(ahead)
    half, high = 0.5 * FOCAL * wide / away, FOCAL * tall / away
    measured = Measured(x=x, y=y, error=0.15, away=away, top=tall, height=tall, width=wide, is_flat=False)
    bottom = 240 + FOCAL * 0.2 / away
    return Box(
        label="person",
        probability=score,
        xmin=round(max(column - half, 5)),
        xmax=round(min(column + half, COLUMNS - 5)),
        ymin=round(max(bottom - high, 0)),
        ymax=round(bottom),
        measured=replace(measured, **m),  # type: ignore[arg-type]
    )


class Seen:
    """A belief that gets pictures at ten a second."""

    def __init__(self, **given: object) -> None:
        given.setdefault("threshold", 0.06)
        self.belief = Belief(given.pop("calibration", None) or calibration(), **given)  # type: ignore[arg-type]
        self.belief.start(0.0)
        self.now = 0.0

    def see(self, eye: Pose2D, *boxes: Box, pictures: int = 1, **given: object) -> list[Hypothesis]:
        """Look from a place; whom that confirms."""
        found = []
        told = {key: given.pop(key) for key in ("length", "is_dark", "has_scan") if key in given}
        view = open_view(eye, **told)  # type: ignore[arg-type]
        for _ in range(pictures):
            self.now += 0.1
            frame = Frame(stamp=self.now, eye=eye_at(eye), boxes=boxes, **given)  # type: ignore[arg-type]
            before = [each for each in self.belief.hypotheses if each.is_confirmed]
            shown = self.belief.see(self.now, frame, view)
            found += [h for h in shown if h.is_confirmed and not any(h is each for each in before)]
        return found

    @property
    def only(self) -> Hypothesis:
        (found,) = self.belief.hypotheses
        return found

    @property
    def posterior(self) -> float:
        return self.belief.posterior(self.only)
