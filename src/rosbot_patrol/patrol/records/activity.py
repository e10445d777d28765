"""What the robot does within a phase, and where a mission leaves it: the words that begin the sentences about it.

PatrolState carries one sentence (`why`) and no code. The words live here once: the patrol writes its sentences with
them, and the narrator, which sees the message only, reads them back by `activity_of` and `is_away`.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

ON_GUARD = "on guard"


class Activity(Enum):
    """What the robot does; the value begins the sentence, "" stands for anything else."""

    OTHER = ""
    WAITING_FOR_NAVIGATION = "waiting for move_base"
    WAITING_FOR_BATTERY = "waiting for the battery"
    WAITING_TO_TURN = "waiting before the turn"
    WAITING_FOR_PICTURES = "waiting for the detector's last pictures"
    TURNING = "turning to look around"
    TO_VIEWPOINT = "driving to a further viewpoint"
    FOLLOWING = "keeping the camera on somebody"

    @property
    def is_waiting(self) -> bool:
        """Whether it waits for something that may not come."""
        return self in _WAITING


_WAITING = (Activity.WAITING_FOR_NAVIGATION, Activity.WAITING_FOR_BATTERY, Activity.WAITING_TO_TURN)
_FULL_TURN = 360.0  # [deg]


def turning(turned_deg: float, whole_deg: float) -> str:
    """The sentence about a turn, in steps of 30 degrees."""
    return f"{Activity.TURNING.value}, {max(turned_deg, 0.0) // 30 * 30:.0f} of {whole_deg:.0f} degrees"


def is_full_turn(why: str) -> bool:
    """Whether a sentence of `turning` is about a full turn."""
    return f" of {_FULL_TURN:.0f} degrees" in why


def activity_of(why: str) -> Activity:
    """The activity that a sentence tells."""
    return next((each for each in Activity if each.value and why.startswith(each.value)), Activity.OTHER)


class Whereabouts(Enum):
    """Where the robot is when a mission is over."""

    HOME = "at home again"
    AWAY = "not at home"
    ON_ITS_WAY = "going on to"
    STOPPED = "where it was stopped"
    LEFT = "where it is"


@dataclass(frozen=True)
class Place:
    """Whereabouts, and what is to be added in words."""

    kind: Whereabouts
    detail: str = ""

    @property
    def text(self) -> str:
        """For people."""
        return f"{self.kind.value}{self.detail}"


def is_away(why: str) -> bool:
    """Whether the sentence of an idle patrol says that it did not come home."""
    return why.removeprefix(f"{ON_GUARD}, ").startswith(Whereabouts.AWAY.value)
