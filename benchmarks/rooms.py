#!/usr/bin/env python3
"""Every room of the house, without and with a person in it: does the robot get there, turn, mail, and come home?

    python3 benchmarks/rooms.py [--rooms 1 2 3] [--rate 1] [--profile tutorial]

The table uses ground truth: distance from the room's point at the start of the turn, degrees turned, distance from home
at the end, contacts with anything but the floor, and the mails in the Maildir.
"""

from __future__ import annotations

import in_workspace  # first: it finds the interpreter

# isort: split
import argparse
import math
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rosbot_patrol.ros.campaign.house import House

ROOT = Path(__file__).resolve().parents[1]


TITLES = (
    "room",
    "person",
    "verdict",
    "off the point [m]",
    "turned [deg]",
    "off home [m]",
    "contacts",
    "mails",
    "sim. [s]",
)


@dataclass(frozen=True)
class Row:
    """The result of one mission."""

    cells: tuple[str, ...]
    fault: str


def visit(house: House, room: int, place: tuple[float, float], at: tuple[float, float] | None, look: str) -> Row:
    """Send the robot to a room, with a person standing `at` a point or nobody."""
    before = len(house.mails())
    if at is not None:
        house.spawn(f"person{room}", *at, look=look)
    mission = house.mission(room, timeout=1800.0)
    if at is not None:
        house.remove(f"person{room}")
    if mission.verdict == "confirmed":
        house.wait(lambda: len(house.mails()) > before, 15.0, "the mail")
    mails = len(house.mails()) - before
    off = math.dist(mission.arrival[:2], place) if mission.arrival else math.nan
    home = math.hypot(*mission.end[:2]) if mission.end else math.nan
    turned = abs(math.degrees(mission.turned))
    good = mission.verdict == ("clear" if at is None else "confirmed") and mails == (at is not None)
    good = good and abs(turned - 360.0) <= 6.0 and off <= 0.2 and home <= 0.2 and not mission.contacts
    cells = (
        f"{room}",
        "no" if at is None else "yes",
        mission.verdict,
        f"{off:.2f}",
        f"{turned:.1f}",
        f"{home:.2f}",
        f"{len(mission.contacts)}",
        f"{mails}",
        f"{mission.sim_seconds:.0f}",
    )
    return Row(cells, "" if good else mission.why[-1])


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rooms", type=int, nargs="+", default=list(range(1, 8)), help="rooms to visit")
    parser.add_argument("--rate", type=float, default=1.0, help="real-time factor, 0: as fast as it goes")
    parser.add_argument("--look", default="", help="look of the person, empty: drawn by the simulator")
    parser.add_argument("--seed", type=int, default=1, help="of the simulator")
    parser.add_argument("--profile", choices=("tuned", "tutorial"), default="tuned", help="of amcl and move_base")
    parser.add_argument("--empty", action="store_true", help="only without a person")
    options = parser.parse_args()
    try:
        from rosbot_patrol.patrol.house.rooms import load_rooms
        from rosbot_patrol.ros.campaign.house import House, Master
        from rosbot_patrol.ros.simulator.demo_intruder_node import read_walk
    except ImportError as err:
        print(f"{err}: `. scripts/env` first", file=sys.stderr)
        return 1
    in_workspace.require_figures(options.rooms, "no room to visit")
    points = {room.id: room.pose for room in load_rooms(ROOT / "params" / "room_points.yaml")}
    print(f"| {' | '.join(TITLES)} |\n|{'---|' * len(TITLES)}", flush=True)
    faults = []
    with tempfile.TemporaryDirectory(prefix="rooms-") as name:
        master = Master(Path(name) / "roscore.log")
        try:
            with House(Path(name) / "house", rate=options.rate, seed=options.seed, profile=options.profile) as house:
                house.wait_ready(120.0)
                for room in options.rooms:
                    stands = tuple(read_walk(ROOT / "config" / "house_demo.yaml", room).path[-1])
                    for at in (None,) if options.empty else (None, stands):
                        row = visit(house, room, points[room][:2], at, options.look)
                        faults += [row.fault] if row.fault else []
                        print(f"| {' | '.join(row.cells)} |{' <-- ' + row.fault if row.fault else ''}", flush=True)
        finally:
            master.stop()
    print(f"\n{len(faults)} of {(1 if options.empty else 2) * len(options.rooms)} not as they should be")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
