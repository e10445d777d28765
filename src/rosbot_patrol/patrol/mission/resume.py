"""Memory of the patrol over restarts: one JSON file.

After the program or the whole launch was killed, the patrol continues where it stopped: every call gets its verdict.
After an orderly end there is nothing to continue. Handled latched triggers are remembered only within one run of the
launch: in another run they are new. A file of another house (another points file) is not used.
"""

from __future__ import annotations

import json
import logging
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from rosbot_patrol.files import write_atomic
from rosbot_patrol.patrol.house.rooms import Rooms
from rosbot_patrol.patrol.records.mission import Mission, Verdict, mission_from_plain, mission_to_plain
from rosbot_patrol.patrol.records.request import Request, request_from_plain, request_to_plain

log = logging.getLogger(__name__)


@dataclass(frozen=True, kw_only=True)
class Memory:
    """State of the missions that survives a restart.

    Attributes:
        count: missions so far; waiting: requests, the next first; mission: that ran.
        last_verdict: of the mission that ended last, "" before the first.
        held: latest time of sending of each held notice [s since 1970], by the id of its mission.
    """

    count: int = 0
    waiting: tuple[Request, ...] = ()
    mission: Mission | None = None
    last_verdict: str = ""
    held: Mapping[str, float] = field(default_factory=dict)


def memory_to_plain(memory: Memory) -> dict[str, Any]:
    """Contents for JSON."""
    return {
        "count": memory.count,
        "queue": [request_to_plain(request) for request in memory.waiting],
        "mission": mission_to_plain(memory.mission) if memory.mission else None,
        "last_verdict": memory.last_verdict,
        "held": dict(memory.held),
    }


def memory_from_plain(plain: Mapping[str, Any], rooms: Rooms) -> Memory:
    """Memory from the result of `memory_to_plain`; an empty one, with a warning, if it is invalid."""
    if not plain:
        return Memory()
    try:
        memory = Memory(
            last_verdict=Verdict(plain["last_verdict"]).value if plain["last_verdict"] else "",
            waiting=tuple(request_from_plain(request) for request in plain["queue"]),
            mission=mission_from_plain(plain["mission"], rooms) if plain["mission"] else None,
            held={str(name): float(until) for name, until in plain["held"].items()},
            count=int(plain["count"]),
        )
    except (KeyError, TypeError, ValueError, AttributeError) as err:
        log.warning("what was kept of the last run makes no sense (%r), starting afresh", err)
        return Memory()
    memory = replace(memory, waiting=tuple(_known(memory.waiting, rooms)))
    if memory.mission:
        log.info("going on with the mission to %s where the last run stopped", memory.mission.room.title)
    return memory


def _known(requests: Iterable[Request], rooms: Rooms) -> Iterator[Request]:
    for request in requests:
        if rooms.find(request.room_id):
            yield request
        else:
            log.warning("the call for room %d is dropped: %s", request.room_id, rooms.refusal(request.room_id))


VERSION = 2


class PatrolStore:
    """Stores the memories of the manager and the schedule, and the handled latched triggers.

    Args:
        path: of the file.
        run_id: of the launch.
        house: identity of the house, such as its points file.

    Attributes:
        memory: the manager's, empty if there is none; schedule: the schedule's.
        taken: number of the last line of the journal in the memory.
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
        """Whether a latched trigger of this sender was handled before the restart."""
        return self._latched.get(sender) == room_id

    def note_latched(self, sender: str, room_id: int) -> None:
        """Remember a latched trigger, for the last 100 senders; `save` writes it."""
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
        self.taken = taken  # the journal continues counting in any case
        if not is_same:
            log.warning("%s is of the house of %s, starting afresh", self.path, tree["house"])
            return
        self.memory, self.schedule = memory, schedule
        if tree["run_id"] == self._run_id:
            self._latched = latched
