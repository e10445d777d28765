"""Recorded turns (benchmarks/record_turns.py) as frames with their truth, for the fit and for comparisons."""

from __future__ import annotations

import gzip
import json
import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from rosbot_patrol.errors import BagError
from rosbot_patrol.geometry import Pose2D, angle_difference
from rosbot_patrol.patrol.records.inputs import Box, Eye, Frame, Measured
from rosbot_patrol.patrol.visibility.coverage import Sight

PERSONS = ("person", "hidden", "dark")
"""Kinds of scenes with a person."""
PETS = ("dog", "cat")
"""Kinds of scenes with a pet."""


@dataclass(frozen=True)
class Shown:
    """What shows of a subject: bearings in map [rad], slopes of top and bottom, pixels."""

    left: float
    right: float
    top: float
    bottom: float
    pixels: float


@dataclass
class Look:
    """Pictures from one place.

    Attributes:
        is_turn: the full turn, else a look at `target` (x, y in map [m]) from elsewhere.
        shown: what shows of the subject from there, None for nothing.
        sight: free way around the camera.
        frames: of each network, by name.
    """

    is_turn: bool
    target: tuple[float, float] | None
    shown: Shown | None
    sight: Sight
    frames: dict[str, list[Frame]] = field(default_factory=dict)


@dataclass
class Scene:
    """One place of the robot and one subject.

    Attributes:
        number, world, kind: of it; subject: its place in map, None for nobody.
        columns, rows: size of the pictures [px]; focal: length [px].
        is_dark: little light.
        looks: the turn first.
    """

    number: int
    world: str
    kind: str
    subject: Pose2D | None
    columns: int
    rows: int
    focal: float
    is_dark: bool
    looks: list[Look] = field(default_factory=list)

    @property
    def has_person(self) -> bool:
        """Whether the subject is a person."""
        return self.kind in PERSONS

    def box_of(self, look: Look, eye: Eye) -> tuple[float, float, float, float] | None:
        """Columns and rows of what shows of the subject in a picture, in part beyond its borders; None for nothing."""
        shown = look.shown
        if shown is None:
            return None
        ahead = [angle_difference(bearing, eye.pose.yaw) for bearing in (shown.left, shown.right)]
        if max(map(abs, ahead)) > 1.2:
            return None
        left, right = (self.columns / 2.0 - self.focal * math.tan(each) for each in ahead)
        stretch = 1.0 / math.cos(sum(ahead) / 2.0)
        top, bottom = (self.rows / 2.0 - self.focal * slope * stretch for slope in (shown.top, shown.bottom))
        if right <= 0.0 or left >= self.columns:
            return None
        return left, max(top, 0.0), right, min(bottom, float(self.rows))


def read_scenes(path: Path) -> Iterator[Scene]:
    """Read recorded scenes; raises BagError if the file cannot be read."""
    scene: Scene | None = None
    try:
        with gzip.open(path, "rt", encoding="utf-8") as file:
            for text in file:
                line = json.loads(text)
                if "scene" in line:
                    if scene is not None:
                        yield scene
                    scene = _scene(line)
                elif scene is None:
                    raise ValueError("it begins with no scene")
                elif "stage" in line:
                    scene.looks.append(_look(line))
                else:
                    _add_picture(scene, line)
    except (OSError, ValueError, KeyError, TypeError, EOFError) as err:
        raise BagError(path, f"holds no recorded turns ({err}); make it with benchmarks/record_turns.py") from err
    if scene is not None:
        yield scene


def _scene(line: dict[str, Any]) -> Scene:
    subject = Pose2D(*line["subject"]) if line["subject"] else None
    return Scene(
        number=line["scene"],
        world=line["world"],
        kind=line["kind"],
        subject=subject,
        columns=line["columns"],
        rows=line["rows"],
        focal=line["fx"],
        is_dark=line["light"] < 1.0,
    )


def _look(line: dict[str, Any]) -> Look:
    s = line["sight"]
    sight = Sight(s["x"], s["y"], s["first"], s["step"], np.array(s["lengths"]))
    target = tuple(line["target"]) if line["target"] else None
    return Look(line["stage"] == "turn", target, Shown(*line["truth"]) if line["truth"] else None, sight)


def _add_picture(scene: Scene, line: dict[str, Any]) -> None:
    width = 2.0 * math.atan(0.5 * scene.columns / scene.focal)
    eye = Eye(pose=Pose2D(*line["eye"]), width=width, columns=scene.columns)
    for network, boxes in line["boxes"].items():
        frame = Frame(stamp=line["stamp"], eye=eye, boxes=tuple(map(_box, boxes)))
        scene.looks[-1].frames.setdefault(network, []).append(frame)


def _box(plain: dict[str, Any]) -> Box:
    measured = Measured(**plain["measured"]) if "measured" in plain else None
    return Box(label="person", measured=measured, **{k: v for k, v in plain.items() if k != "measured"})
