"""What a mission asks of the look at its room: what was seen, and from where to see the rest."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol

from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.patrol.belief.belief import Belief
from rosbot_patrol.patrol.house.rooms import Room
from rosbot_patrol.patrol.intruder.lidar_motion import LidarTrack
from rosbot_patrol.patrol.records.inputs import Inputs
from rosbot_patrol.patrol.records.mission import Mission
from rosbot_patrol.patrol.visibility.viewpoints import Viewpoint

Viewpoints = Callable[[Room, Inputs], Sequence[Pose2D]]
"""Further poses that show a room whose own point cannot be reached, the best first."""


class Views(Protocol):
    """What has been seen of a room, and from where to see the rest."""

    def start(self, mission: Mission, belief: Belief) -> None:
        """Begin a mission, or go on with one after a restart: `mission.views_done` lists the viewpoints done.

        Args:
            mission: whose room.
            belief: of it; what it leaves open is looked at again.
        """

    def see(self, now: float, inputs: Inputs) -> None:
        """Take in one step of the drive to the room or of the look."""

    def tracks(self) -> Sequence[LidarTrack]:
        """What the lidar follows."""

    def next(self, inputs: Inputs) -> Viewpoint | None:
        """The next viewpoint, None if the room is seen well enough or no viewpoint is left."""

    def turn_from(self, pose: Pose2D | None, view: Viewpoint) -> float:
        """Angle to turn to the left at a viewpoint, from where the robot stands now [rad]."""

    def share(self) -> float | None:
        """Share of the room's floor that was seen, None if nobody measures it."""

    def blind(self) -> str:
        """Reason why the room cannot be called clear, "" if it can."""

    def is_seen(self) -> bool:
        """Whether as much of the floor was seen as is wanted."""

    def moved(self) -> str:
        """What the lidar saw move in the room, "" if nothing did."""


class OneTurn:
    """`Views` of a look that ends with its one turn."""

    def __init__(self) -> None:
        self._belief: Belief | None = None

    def start(self, mission: Mission, belief: Belief) -> None:
        """Only what the belief leaves open can be told."""
        self._belief = belief

    def see(self, now: float, inputs: Inputs) -> None:
        """Nothing to see."""

    def tracks(self) -> Sequence[LidarTrack]:
        """Nothing is followed."""
        return ()

    def next(self, inputs: Inputs) -> Viewpoint | None:
        """One turn is enough."""
        return None

    def turn_from(self, pose: Pose2D | None, view: Viewpoint) -> float:
        """As planned."""
        return view.turn

    def share(self) -> float | None:
        """Nobody measures."""
        return None

    def blind(self) -> str:
        """The floor is not measured: only what may be somebody keeps the room from being clear."""
        doubts = self._belief.open if self._belief is not None else ()
        return self._belief.why(doubts[0]) if self._belief is not None and doubts else ""

    def is_seen(self) -> bool:
        """Nobody measures."""
        return False

    def moved(self) -> str:
        """Nobody watches."""
        return ""
