"""A program, not a test: drive from the base to each room and back, on the pure navigator.

Usage: drive_house.py WALLS.csv [ROOM...]
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

from house import ROOMS, house_map
from loop import Loop, tuned

from rosbot_patrol.geometry import Pose2D


def main() -> None:
    walls = Path(sys.argv[1])
    grid = house_map(walls)
    rooms = [int(a) for a in sys.argv[2:]] or list(range(1, 8))
    loop = Loop(known=grid, world=grid, tree=tuned())
    for room in rooms:
        for goal in (Pose2D(*ROOMS[room], 0.8), Pose2D(0.0, 0.0, 0.0)):
            start, clock, contacts = loop.now, time.perf_counter(), loop.contacts
            outcome = loop.drive(goal, 300.0)
            spent = time.perf_counter() - clock
            steps = round((loop.now - start) / loop.dt)
            print(
                f"room {room} -> ({goal.x:.1f}, {goal.y:.1f}): {outcome.text if outcome else 'timed out'} "
                f"{loop.now - start:.1f} s, contacts {loop.contacts - contacts}, recoveries {loop.recoveries}, "
                f"{1e3 * spent / max(steps, 1):.1f} ms a step, {loop.stack.navigator.text}"
            )


if __name__ == "__main__":
    main()
