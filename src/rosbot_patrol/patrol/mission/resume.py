"""What of the patrol outlives the program, and how it goes on from there.

What of the patrol outlives the program: one JSON file.

A program that was killed, alone or with the whole launch, goes on where it stopped: every call gets its verdict. One
that was ended in order has nothing left to go on with. Latched triggers that were handled are known within one run of
the launch only, as in another one they are new. A file of another house (another points file) is none.
"""

from __future__ import annotations

import json
import logging
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rosbot_patrol.files import write_atomic
from rosbot_patrol.patrol.calls.call_filter import Intake
from rosbot_patrol.patrol.calls.queue import MissionQueue
from rosbot_patrol.patrol.house.rooms import Rooms
from rosbot_patrol.patrol.records.mission import Mission, Verdict, mission_from_plain, mission_to_plain
from rosbot_patrol.patrol.records.request import Request, request_from_plain, request_to_plain

if TYPE_CHECKING:
    from rosbot_patrol.patrol.mission.manager import PatrolManager


log = logging.getLogger(__name__)


def begin(request: Request, rooms: Rooms, wall: float) -> Mission:
    """The mission of a request whose turn has come, at `wall` seconds since 1970."""
    room = rooms.find(request.room_id)
    assert room is not None, "the queue holds rooms of the file only"
    waited = max(wall - request.wall, 0.0)
    return Mission(
        id=request.id,
        room=room,
        origin=request.origin,
        priority=request.priority,
        called=request.wall,
        note=request.note,
        wall=wall,
        triggers=request.triggers,
        times={"waiting": waited, **{name: s for name, s in request.times.items() if name != "waiting"}},
        began={"waiting": request.wall},
    )


def snapshot(manager: PatrolManager, intake: Intake) -> dict[str, Any]:
    """What has to outlive the program, for JSON."""
    return {
        "count": intake.count,
        "queue": [request_to_plain(request) for request in manager.queue],
        "mission": mission_to_plain(manager.mission) if manager.mission else None,
        "last_verdict": manager.last_verdict,
        "held": dict(manager.held),
    }


def recall(manager: PatrolManager, intake: Intake, memory: Mapping[str, Any]) -> None:
    """Give a manager back what `snapshot` took; what makes no sense is said and left out."""
    try:
        last = Verdict(memory["last_verdict"]).value if memory["last_verdict"] else ""
        requests = [request_from_plain(plain) for plain in memory["queue"]]
        mission = mission_from_plain(memory["mission"], manager.rooms) if memory["mission"] else None
        held = {str(name): float(until) for name, until in memory["held"].items()}
        intake.count = int(memory["count"])
    except (KeyError, TypeError, ValueError, AttributeError) as err:
        log.warning("what was kept of the last run makes no sense (%r), starting afresh", err)
        return
    manager.last_verdict, manager.held, manager.mission = last, held, mission
    _queue(manager.queue, requests, manager.rooms)
    if mission:
        log.info("going on with the mission to %s where the last run stopped", mission.room.title)


def confirm(mission: Mission, reason: str) -> None:
    """Its notice is on disk, and yet the memory knows of nobody: the program was killed between the two."""
    mission.verdict, mission.reason, mission.notified = Verdict.CONFIRMED, reason, True
    mission.sightings = max(mission.sightings, 1)
    log.warning("%s", reason)


def _queue(queue: MissionQueue, requests: list[Request], rooms: Rooms) -> None:
    for request in requests:
        if rooms.find(request.room_id):
            queue.add(request)
        else:
            log.warning("the call for room %d is dropped: %s", request.room_id, rooms.refusal(request.room_id))


VERSION = 2


class PatrolStore:
    """Keeps the manager's memory, the schedule's, and the latched triggers that were handled.

    Args:
        path: of the file.
        run_id: of the launch.
        house: which house it is of, such as its points file.

    Attributes:
        memory: what the manager kept, empty if nothing; schedule: what the schedule did.
        taken: number of the last line of the journal that the memory knows.
    """

    def __init__(self, path: Path, run_id: str, house: str = "") -> None:
        self.path = path
        self._run_id, self._house = run_id, house
        self._latched: dict[str, int] = {}
        self.memory: Mapping[str, Any] = {}
        self.schedule: Mapping[str, float] = {}
        self.taken = 0
        self._read()

    def is_handled(self, sender: str, room_id: int) -> bool:
        """Whether a latched trigger of this sender was taken before the program ended."""
        return self._latched.get(sender) == room_id

    def note_latched(self, sender: str, room_id: int) -> None:
        """Remember a latched trigger, the last 100 senders; `save` writes it."""
        self._latched.pop(sender, None)
        self._latched[sender] = room_id
        while len(self._latched) > 100:
            self._latched.pop(next(iter(self._latched)))

    def save(self, memory: Mapping[str, Any], *, taken: int = 0, schedule: Mapping[str, float] | None = None) -> None:
        """Write it all. Raises OSError."""
        tree = {
            "version": VERSION,
            "run_id": self._run_id,
            "house": self._house,
            "taken": taken,
            "latched": dict(self._latched),
            "schedule": dict(schedule or {}),
            "memory": dict(memory),
        }
        write_atomic(self.path, json.dumps(tree, indent=1).encode())

    def _read(self) -> None:
        try:
            tree = json.loads(self.path.read_text(encoding="utf-8"))
            if tree["version"] != VERSION:
                raise ValueError(f"version {tree['version']}, expected {VERSION}")
            latched = {str(k): int(v) for k, v in tree["latched"].items()}
            memory, taken, schedule = dict(tree["memory"]), int(tree["taken"]), dict(tree["schedule"])
            is_same = str(tree["house"]) == self._house
        except FileNotFoundError:
            return
        except (OSError, ValueError, KeyError, TypeError, AttributeError) as err:
            log.warning("%s cannot be used (%s), starting afresh", self.path, err)
            return
        self.taken = taken  # the journal goes on counting in any case
        if not is_same:
            log.warning("%s is of the house of %s, starting afresh", self.path, tree["house"])
            return
        self.memory, self.schedule = memory, schedule
        if tree["run_id"] == self._run_id:
            self._latched = latched
