"""Faults in the patrols of a campaign, and the verdicts that they excuse.

Every second or third patrol has one fault of the simulator (docs/scenarios.md) that begins while the robot drives or
looks; most last for some seconds. A guard with a failed camera may say `unverified`, but never `clear` with somebody
there. With failed lidar or wheels it may also say that the room was not reached. A fault of a motion sensor changes no
verdict.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from rosbot_patrol.patrol.records.mission import Verdict

UNSURE = (Verdict.UNVERIFIED.value,)
STRANDED = (Verdict.UNVERIFIED.value, Verdict.UNREACHABLE.value)


@dataclass(frozen=True, kw_only=True)
class Mishap:
    """One fault of a patrol.

    Attributes:
        text: the fault in words.
        fault: its entry in the scenario.
        allowed: verdicts accepted besides the expected one.
    """

    text: str
    fault: dict[str, Any]
    allowed: tuple[str, ...] = ()


def mishap_of(seed: int, number: int, room: int, rooms: Sequence[int], *, every: int = 2) -> Mishap | None:
    """Mishap of a patrol, None if it has none.

    Args:
        seed: of the campaign.
        number: of the patrol.
        room: that is triggered.
        rooms: all but the base.
        every: every how many patrols one has a fault.
    """
    if (number + seed) % every:
        return None
    rng = np.random.default_rng([seed, number // every // len(MISHAPS), 4])
    make = MISHAPS[int(rng.permutation(len(MISHAPS))[number // every % len(MISHAPS)])]
    own = np.random.default_rng([seed, number, 3])
    others = [other for other in rooms if other != room] or [room]
    return make(own, room, int(own.choice(others)))


def _camera(kind: str, text: str) -> Callable[[np.random.Generator, int, int], Mishap]:
    def make(rng: np.random.Generator, room: int, other: int) -> Mishap:
        after = str(rng.choice(["driving", "looking"]))
        fault = {"kind": kind, "after": after, "at": _drawn(rng, 0.0, 8.0), "duration": _drawn(rng, 5.0, 40.0)}
        return Mishap(text=f"{text} for {fault['duration']:g} s", fault=fault, allowed=UNSURE)

    return make


def _driving(kind: str, text: str, longest: float, **keys: Any) -> Callable[[np.random.Generator, int, int], Mishap]:
    def make(rng: np.random.Generator, room: int, other: int) -> Mishap:
        lasts = _drawn(rng, 2.0, longest)
        fault = {"kind": kind, "after": "driving", "at": _drawn(rng, 0.0, 10.0), "duration": lasts, **keys}
        return Mishap(text=f"{text} for {lasts:g} s", fault=fault, allowed=STRANDED)

    return make


def _sensor(kind: str, text: str, *, own: bool, **keys: Any) -> Callable[[np.random.Generator, int, int], Mishap]:
    def make(rng: np.random.Generator, room: int, other: int) -> Mishap:
        target = room if own else other
        fault = {"kind": kind, "target": target, "after": "driving", "at": _drawn(rng, 0.0, 5.0), **keys}
        return Mishap(text=f"motion sensor {target} {text}", fault=fault)

    return make


def _drawn(rng: np.random.Generator, low: float, high: float) -> float:
    return round(float(rng.uniform(low, high)), 1)


MISHAPS: tuple[Callable[[np.random.Generator, int, int], Mishap], ...] = (
    _camera("camera_frozen", "the camera freezes"),
    _camera("camera_black", "the camera is covered"),
    _camera("camera_silent", "the camera is gone"),
    _driving("lidar_silent", "the lidar is gone", 10.0),
    _driving("odometry_slip", "the wheels slip", 6.0, factor=0.6),
    _driving("wheel_stuck", "the left wheels are stuck", 4.0, target="left"),
    _sensor("motion_stuck", "calls once and not again", own=True),
    _sensor("motion_rebooting", "starts anew", own=True),
    _sensor("motion_silent", "is silent on its link", own=False),
    _sensor("link_poor", "has a poor link", own=True, loss=0.2, delay=0.3, jitter=0.2),
)
