"""What a mission found: a confirmed intruder, and the persons that it met."""

from __future__ import annotations

from dataclasses import dataclass

from rosbot_patrol.patrol.records.inputs import Box, Measured


@dataclass(frozen=True, kw_only=True)
class Confirmation:
    """An intruder, as far as the detector can tell.

    Attributes:
        label: its class.
        probability: median over the pictures that show it.
        stamp: the camera's, of the picture that shows it best [s].
        boxes: alarm boxes in that picture, the best first.
        pictures: how many showed it.
        measured: its place and size as they were last measured well, None where nothing tells.
    """

    label: str
    probability: float
    stamp: float
    boxes: tuple[Box, ...]
    pictures: int
    measured: Measured | None = None


@dataclass(kw_only=True)
class Person:
    """One who was met.

    Attributes:
        number: from 1 on.
        x: last place in map [m]; y: likewise; error: of it [m]; at: when [s].
        sightings: how often confirmed; label: class of object; room: where, for people.
    """

    number: int
    x: float | None
    y: float | None
    error: float
    at: float
    sightings: int = 0
    label: str = ""
    room: str = ""
