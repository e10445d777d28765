"""Room points marked on a map: can the robot stand, turn and get there?"""

from __future__ import annotations

from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.patrol.house.floor import Floor
from rosbot_patrol.patrol.house.rooms import MAX_ROOMS, Room, Rooms, bad_name
from rosbot_patrol.patrol.visibility.coverage import CoverageParams
from rosbot_patrol.patrol.visibility.viewpoints import ViewpointParams, ViewpointPlanner

TURN_CLEARANCE = 0.2  # clearance that the robot needs to turn on the spot [m]
PASSAGE = 0.15  # half the width of the narrowest passage [m]
APART = 0.5  # two points closer than this are probably a mistake [m]


class Marks:
    """The points marked so far; the first is the base.

    Args:
        rooms: initial rooms.
    """

    def __init__(self, rooms: Rooms | None = None) -> None:
        self.rooms: list[Room] = list(rooms or ())

    @property
    def is_full(self) -> bool:
        """Whether there is no number for another room."""
        return len(self.rooms) >= MAX_ROOMS

    def problem(self, floor: Floor, x: float, y: float) -> str:
        """Reason why a place cannot be a room's point, with an alternative; "" if it can.

        Args:
            floor: of the map.
            x: in map [m].
            y: in map [m].
        """
        if not floor.is_free(x, y):
            return f"the map shows no floor there{self._instead(floor, x, y)}"
        ix, iy = floor.info.cell_of(x, y)
        gap = float(floor.clearance[iy, ix])
        if gap < TURN_CLEARANCE:
            needed = f"the robot needs {TURN_CLEARANCE:.2f} m to turn"
            return f"it is {gap:.2f} m from the nearest thing, and {needed}{self._instead(floor, x, y)}"
        if self.rooms and not self._leads_to(floor, ix, iy):
            return f"no way leads there from {self.rooms[0].title} on this map"
        near = [room for room in self.rooms if abs(room.pose.x - x) < APART and abs(room.pose.y - y) < APART]
        return f"{near[0].title} is there already" if near else ""

    def name_problem(self, name: str) -> str:
        """Reason why a name cannot be used, "" if it can."""
        bad = bad_name(name)
        if bad is not None:
            return f"the name {bad}"
        same = next((room for room in self.rooms if room.name.casefold() == name.strip().casefold()), None)
        return f"{same.title} has that name" if same else ""

    def add(self, name: str, x: float, y: float) -> Room:
        """Add a point with the next number and heading 0."""
        room = Room(id=len(self.rooms), name=name.strip(), pose=Pose2D(x, y, 0.0))
        self.rooms.append(room)
        return room

    def _instead(self, floor: Floor, x: float, y: float) -> str:
        cell = floor.nearest(floor.clearance >= TURN_CLEARANCE, x, y, 2.0)
        if cell is None:
            return ""
        at = floor.info.centre_of(*cell)
        return f"; the nearest place for it is ({at[0]:.2f}, {at[1]:.2f})"

    def _leads_to(self, floor: Floor, ix: int, iy: int) -> bool:
        planner = ViewpointPlanner(floor, ViewpointParams(passage_clearance=PASSAGE), CoverageParams())
        return bool(planner.reached(self.rooms[0].pose)[iy, ix])
