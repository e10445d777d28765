#!/usr/bin/env python3
"""Each node of the house killed, or hung and restarted, during a patrol: notices to the owner, and time to recovery.

    python3 benchmarks/broken_nodes.py [--json FILE] [--nodes amcl ...] [--hung 15]

Somebody stands in the room; a trigger starts a mission. The node gets SIGKILL, or SIGSTOP and then SIGKILL after
`--hung` seconds of wall time, during the drive. For the detector, the camera's republish and the sensors' bridge it
comes when the robot begins to look. roslaunch restarts the node after `--respawn-delay` (except the keyboard's node).
Told: new warnings of /diagnostics, mails, the mission's sentence. Well: on guard again, and /diagnostics as before.
Times are simulated seconds from the fault on.
"""

from __future__ import annotations

import in_workspace  # first: it finds the interpreter

# isort: split
import argparse
import contextlib
import email
import email.policy
import json
import os
import signal
import tempfile
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from pathlib import Path

import rospy
from diagnostic_msgs.msg import DiagnosticArray
from rosbot_patrol.msg import PatrolState

from rosbot_patrol.ros.campaign.house import House, HouseError, Master

ROOM, INTRUDER = 5, (4.8, 7.8)
LOOKING = ("darknet_ros", "rgb_compress", "esp_client1", "esp_client2", "esp_client3")
LEFT_OUT = ("rosout", "simulator")  # the log, and the world itself
NOT_ROS = ("house_watch",)


@dataclass
class Row:
    """The result of one fault.

    Attributes:
        node: name of the node; how: "killed" or "hung".
        verdict: of the mission, "" if it did not end; sentence: its last one.
        told: parts of /diagnostics that got worse, with their first message, and after how many seconds.
        mails: their subjects.
        over: the mission's end [s]; well: on guard and all parts as before [s]; None: not within the time.
        touched: contacts of the robot.
    """

    node: str
    how: str
    verdict: str = ""
    sentence: str = ""
    told: dict[str, tuple[float, str]] = field(default_factory=dict)
    mails: list[str] = field(default_factory=list)
    over: float | None = None
    well: float | None = None
    touched: list[str] = field(default_factory=list)


class Diagnostics:
    """The newest level and message of each part."""

    def __init__(self) -> None:
        self.parts: dict[str, tuple[int, str]] = {}
        self._subscriber = rospy.Subscriber("/diagnostics", DiagnosticArray, self._hear, queue_size=100)

    def bad(self) -> dict[str, tuple[int, str]]:
        """Parts with problems, except the world's report that it is slower than requested."""
        parts = list(self.parts.items())
        return {name: value for name, value in parts if value[0] > 0 and not name.startswith("simulator")}

    def _hear(self, message: DiagnosticArray) -> None:
        self.parts.update({status.name: (int(status.level), status.message) for status in message.status})


def subjects(house: House) -> list[str]:
    """Subjects of the mails so far."""
    messages = [email.message_from_bytes(p.read_bytes(), policy=email.policy.default) for p in house.mails()]
    return [f"{m['Subject']}: {(m.get_body(('plain',)).get_content().splitlines() or [''])[0]}" for m in messages]


def until(condition, seconds: float, each=lambda: None) -> bool:
    end = time.monotonic() + seconds
    while not condition():
        each()
        if time.monotonic() > end:
            return False
        time.sleep(0.05)
    return True


def break_node(house: House, diagnostics: Diagnostics, node: str, how: str, hung: float) -> Row:
    """Run one mission in which a node is killed, or hangs until roslaunch starts another."""
    pids: list[int] = []

    def hit() -> None:
        pids.append(house.pids()[f"/{node}"])
        os.kill(pids[0], signal.SIGKILL if how == "killed" else signal.SIGSTOP)

    def heal() -> None:
        for pid in pids:
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)

    return mission_with(house, diagnostics, Row(node, how), Fault(hit, heal, hung, is_late=node in LOOKING))


@dataclass(frozen=True)
class Fault:
    """What breaks in a mission.

    Attributes:
        hit: breaks it; heal: mends it, or lets it be started again.
        lasts: time between the two [s].
        is_late: it comes as the robot begins to look, else in mid-drive.
    """

    hit: Callable[[], None]
    heal: Callable[[], None]
    lasts: float
    is_late: bool = False


def mission_with(house: House, diagnostics: Diagnostics, row: Row, fault: Fault) -> Row:
    """Run one mission with somebody in the room and a fault; fills in the row."""
    before, mails, met = set(diagnostics.bad()), len(subjects(house)), len(house.contacts)
    house.spawn("burglar", *INTRUDER)
    house.trigger(ROOM)
    phase = PatrolState.LOOKING if fault.is_late else PatrolState.DRIVING
    house.wait(lambda: house.state.state == phase, 120.0, phase)
    if phase == PatrolState.DRIVING:
        start = house.pose
        house.wait(lambda: abs(house.pose.x - start.x) + abs(house.pose.y - start.y) > 1.0, 60.0, "the drive")
    began, wall = house.pose_stamp, time.monotonic()
    fault.hit()
    waiting = [fault.heal]

    def watch() -> None:
        for name, (_, message) in diagnostics.bad().items():
            if name not in before and name not in row.told:
                row.told[name] = round(house.pose_stamp - began, 1), message
        if waiting and time.monotonic() - wall > fault.lasts:
            waiting.pop()()
        if row.over is None and house.state.state == PatrolState.IDLE:
            row.over = round(house.pose_stamp - began, 1)

    is_over = until(lambda: row.over is not None, 240.0, watch)
    is_well = until(lambda: not waiting and set(diagnostics.bad()) <= before, 90.0, watch)
    row.well = round(house.pose_stamp - began, 1) if is_over and is_well else None
    row.verdict, row.sentence = house.state.last_verdict, house.state.why
    row.mails = subjects(house)[mails:]
    row.touched = sorted({other for kind, other in house.contacts[met:] if kind != "floor"})
    with contextlib.suppress(rospy.ServiceException):  # a new master does not know the service
        house.remove("burglar")
    return row


def table(rows: list[Row]) -> str:
    """Markdown table of the results."""
    lines = [
        "| what | | verdict | told | mails | mission over [s] | well [s] | met |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for row in rows:
        told = "; ".join(f"{at:.0f} s {name}: {text}" for name, (at, text) in row.told.items()) or "-"
        times = " | ".join("not" if value is None else f"{value:.0f}" for value in (row.over, row.well))
        mails = "; ".join(row.mails) or "-"
        verdict, met = row.verdict or row.sentence, ", ".join(row.touched) or "-"
        lines.append(f"| {row.node} | {row.how} | {verdict} | {told} | {mails} | {times} | {met} |")
    return "\n".join(lines)


def report(rows: list[Row], file: Path | None) -> None:
    """Print the table, and write the figures as JSON where a file is given."""
    in_workspace.require_figures(rows, "nothing was broken")
    print(f"\n{table(rows)}")
    if file:
        figures = {f"{row.node} {row.how}": asdict(row) for row in rows}
        file.write_text(json.dumps(figures, indent=2) + "\n", encoding="utf-8")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", type=Path, metavar="FILE")
    parser.add_argument("--nodes", nargs="+", default=[], help="these only")
    parser.add_argument("--how", nargs="+", default=["killed", "hung"])
    parser.add_argument("--hung", type=float, default=15.0)
    parser.add_argument("--rate", type=float, default=2.0)
    parser.add_argument("--respawn-delay", type=float, default=5.0)
    options = parser.parse_args()
    folder = Path(tempfile.mkdtemp(prefix="broken_nodes_"))
    print(f"logs in {folder}; {os.cpu_count()} cores")
    master = Master(folder / "roscore.log")
    rows: list[Row] = []
    try:
        diagnostics = Diagnostics()
        given = {"rate": options.rate, "respawn_delay": options.respawn_delay}
        house = House(folder / "house", **given)
        house.start()
        house.wait_ready(90.0)
        time.sleep(5.0)
        names = sorted(name.lstrip("/") for name in house.pids())
        names = [n for n in names if n not in LEFT_OUT and not n.startswith(NOT_ROS)]
        for node in options.nodes or names:
            for how in options.how:
                if f"/{node}" not in house.pids():
                    print(f"{node} is not there: roslaunch does not start it again", flush=True)
                    continue
                try:
                    rows.append(break_node(house, diagnostics, node, how, options.hung))
                except HouseError as err:
                    rows.append(Row(node, how, sentence=str(err).splitlines()[0]))
                print(table(rows[-1:]).splitlines()[-1], flush=True)
                if not house.is_running or house.state.state != PatrolState.IDLE:
                    house.stop()
                    house = House(folder / f"house{len(rows)}", **given)
                    house.start()
                    house.wait_ready(90.0)
                    time.sleep(5.0)
        house.stop()
    finally:
        master.stop()
    report(rows, options.json)


if __name__ == "__main__":
    main()
