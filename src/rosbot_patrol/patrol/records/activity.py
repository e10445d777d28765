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
    return why.startswith(f"{ON_GUARD}, {Whereabouts.AWAY.value}")
