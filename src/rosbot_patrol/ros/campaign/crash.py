"""One life of a house in a crash campaign: patrols with an intruder and killed programs, until all end."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import rospy

from rosbot_patrol.campaign.cast import plain_place
from rosbot_patrol.campaign.crash_ledger import Journal, next_patrol, open_call
from rosbot_patrol.campaign.crash_plan import ALL, ENDS_LIFE, MASTER, Kill, plan_crashes
from rosbot_patrol.campaign.floor import Floor
from rosbot_patrol.campaign.houses.files import house_files, load_house
from rosbot_patrol.campaign.plan import CONFIRMED
from rosbot_patrol.host import orphans
from rosbot_patrol.host.serve import GONE
from rosbot_patrol.msg import PatrolState
from rosbot_patrol.ros.campaign.house import House, HouseError, Master, child_pids
from rosbot_patrol.ros.campaign.mail_sink import MailSink

HOUSE = "flat"  # its rooms are close together: short patrols
PATROLS = 4  # number per life
READY, ENDS, MOMENT, DELIVERED = 120.0, 240.0, 60.0, 40.0  # longest waits [s]
FORGOTTEN = 20.0  # time at rest after which a patrol has forgotten a call [s]
JOURNAL = "journal.jsonl"


class CrashLife:
    """A house from its start until everything or the master is killed, or its patrols are over.

    Args:
        folder: folder of the journal, the guard's state and the mails, including those of earlier lives.
        root: folder of the package.
        seed: seed of the campaign.
        kills: number of kills in the whole campaign.
    """

    def __init__(self, folder: Path, root: Path, seed: int, kills: int) -> None:
        self._folder = folder
        self._journal = Journal(folder / JOURNAL)
        lines = self._journal.read()
        self._open = open_call(lines)
        self._patrols = plan_crashes(seed, kills)[next_patrol(lines) :][:PATROLS]
        life = sum(line["kind"] == "life" for line in lines)
        house = load_house(house_files(HOUSE, root))
        rooms = [room.id for room in house.rooms if room.id != house.rooms.base.id]
        self._room = rooms[life % len(rooms)]
        self._place = plain_place(Floor(house.bodies, house.rooms), self._room, np.random.default_rng([seed, life, 13]))
        self._by_smtp = life % 2 == 1
        self._journal.add("life", number=life, room=self._room, transport="smtp" if self._by_smtp else "maildir")
        self._states: list[PatrolState] = []

    def run(self) -> None:
        """Run it. Raises HouseError if the house does not start or hangs."""
        os.environ["ROS_HOME"] = os.environ["ROS_LOG_DIR"] = str(self._folder / "ros")
        self._master = Master(self._folder / "roscore.log")
        sink = MailSink(self._folder / "smtp")
        settings = {"mail_interval": 0.0, "smtp_host": "localhost", "smtp_port": sink.port, "smtp_security": "none"}
        for node in ("patrolling_node", "sensor_watch"):
            for name, value in settings.items():
                rospy.set_param(f"/{node}/{name}", value)
        arguments: dict[str, Any] = {"house": HOUSE, "rate": 0, "teleop": "false", "respawn_delay": 1}
        if self._by_smtp:
            arguments |= {"transport": "smtp", "email_to": "owner@localhost"}
        self._house = House(self._folder, **arguments)
        rospy.Subscriber("/patrol/state", PatrolState, self._states.append, queue_size=100)
        self._house.start()
        try:
            self._play()
        finally:
            self._house.stop()

    def _play(self) -> None:
        self._house.wait_ready(READY)
        if self._place is not None:
            self._house.spawn("intruder", *self._place)
        if self._open is not None:
            self._finish(self._open, 0)
        for patrol in self._patrols:
            self._house.wait(self._is_at_rest, ENDS, "the patrol on guard again")
            since = len(self._states)
            call = {"call": f"p{patrol.number}", "patrol": patrol.number, "room": self._room}
            self._journal.add("call", **call, wall=time.time())
            self._house.trigger(self._room)
            for kill in patrol.kills:
                self._kill(kill, call, since)
            self._finish(call, since)
        self._house.wait(self._is_at_rest, ENDS, "the patrol on guard at the end")
        deadline = time.monotonic() + DELIVERED
        while waiting(self._folder / "state") and time.monotonic() < deadline:
            time.sleep(0.2)

    def _is_at_rest(self) -> bool:
        state = self._house.state
        return state is not None and state.state == PatrolState.IDLE and not state.queue

    def _finish(self, call: Mapping[str, Any], since: int) -> None:
        """Wait for the verdict of a call, and record it."""
        until, rested = time.monotonic() + ENDS, time.monotonic()
        while not self._verdict(call["room"], since):
            self._house.wait(lambda: True, 1.0, "a verdict")  # raises if the launch has ended
            if not self._is_at_rest():
                rested = time.monotonic()
            if time.monotonic() > until or time.monotonic() - rested > FORGOTTEN:
                state = self._house.state
                self._journal.add("given_up", call=call["call"], why=state.why if state else "no state")
                return
            time.sleep(0.05)
        verdict = self._verdict(call["room"], since)
        there = self._place is not None and call["room"] == self._room
        self._journal.add("verdict", call=call["call"], verdict=verdict, there=there, wall=time.time())

    def _verdict(self, room: int, since: int) -> str:
        """Verdict of a mission to a room that ended after a state, "" before that.

        It is not enough that the patrol is at rest: a mission forgotten in a restart has ended without a verdict.
        """
        states = self._states[since:]
        own = [i for i, s in enumerate(states) if s.mission and s.room_id == room]
        verdicts = [states[i].verdict for i in own if states[i].verdict]
        ended = bool(own) and any(s.state == PatrolState.IDLE for s in states[own[-1] :])
        return str(verdicts[-1]) if verdicts and ended else ""

    def _kill(self, kill: Kill, call: Mapping[str, Any], since: int) -> None:
        with suppress(HouseError):
            self._house.wait(lambda: self._has_come(kill.moment, call["room"], since), MOMENT, kill.moment)
        time.sleep(kill.delay)
        state = self._house.state
        facts = {"call": call["call"], "number": kill.number, "victim": kill.victim, "moment": kill.moment}
        facts |= {"delay": kill.delay, "state": state.state if state else "", "wall": time.time()}
        pids = self._pids()
        if kill.victim not in (*ENDS_LIFE, *pids):
            self._journal.add("missing", **facts)
            return
        self._journal.add("kill", **facts)
        if kill.victim == ALL:
            self._kill_all()
        if kill.victim == MASTER:
            self._kill_master()
        with suppress(ProcessLookupError):
            os.kill(pids[kill.victim], signal.SIGKILL)

    def _has_come(self, moment: str, room: int, since: int) -> bool:
        states = [s for s in self._states[since:] if s.mission and s.room_id == room]
        known: dict[str, Callable[[], bool]] = {
            "called": lambda: True,
            "driving": lambda: bool(states),
            "seen": lambda: any(s.verdict == CONFIRMED for s in states) or self._verdict(room, since) != "",
            "looking": lambda: any(s.state in (PatrolState.LOOKING, PatrolState.RETURNING) for s in states),
            "returning": lambda: any(s.state == PatrolState.RETURNING for s in states),
        }
        return known[moment]() or self._verdict(room, since) != ""

    def _pids(self) -> dict[str, int]:
        """Process of each node in the launch, by name."""
        found = {}
        for pid in child_pids(self._house.pid):
            with suppress(OSError):
                for word in Path(f"/proc/{pid}/cmdline").read_bytes().split(b"\0"):
                    if word.startswith(b"__name:="):
                        found[word.removeprefix(b"__name:=").decode()] = pid
        return found

    def _kill_all(self) -> None:
        """Kill launch, nodes, master and this program at once, as in a power cut."""
        self._house.kill()
        self._master.kill()
        os._exit(0)

    def _kill_master(self) -> None:
        """Kill the ROS master; then end launch and nodes as late and in the same way as the service does."""
        master = os.environ["ROS_MASTER_URI"]
        os.kill(next(pid for pid, name in orphans.find(master).items() if name == orphans.MASTER), signal.SIGKILL)
        time.sleep(GONE)
        with suppress(ProcessLookupError):
            os.kill(self._house.pid, signal.SIGKILL)
        orphans.end(orphans.find(master))
        os._exit(0)


def waiting(state_dir: Path) -> int:
    """Notices not yet accepted by a transport."""
    return sum(1 for _ in (state_dir / "outbox").glob("[0-9]*.notice"))
