"""Findings of a mission: a confirmed intruder, and the persons met."""

from __future__ import annotations

from dataclasses import dataclass

from rosbot_patrol.patrol.records.inputs import Box, Measured


@dataclass(frozen=True, kw_only=True)
class Confirmation:
    """A confirmed intruder, as far as the detector can tell.

    Attributes:
        label: its class.
        probability: median over the pictures with the intruder.
        stamp: the camera's stamp of the best picture [s].
        boxes: alarm boxes in that picture, the best first.
        pictures: number of pictures with the intruder.
        measured: its last good measurement of place and size, None if there is none.
    """

    label: str
    probability: float
    stamp: float
    boxes: tuple[Box, ...]
    pictures: int
    measured: Measured | None = None


@dataclass(kw_only=True)
class Person:
    """A person met on a mission.

    Attributes:
        number: from 1 on.
        x: last place in map [m]; y: likewise; error: of it [m]; at: when [s].
        sightings: number of confirmations; label: object class; room: its name, for people.
        stays: the lidar, which sees, has not seen them move.
    """

    number: int
    x: float | None
    y: float | None
    error: float
    at: float
    sightings: int = 0
    label: str = ""
    room: str = ""
    stays: bool = False
