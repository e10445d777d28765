"""What of the patrol outlives the program, and how it goes on from there."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from rosbot_patrol.patrol.intake import Intake
from rosbot_patrol.patrol.mission import Mission, Verdict, mission_from_plain, mission_to_plain
from rosbot_patrol.patrol.queueing import MissionQueue
from rosbot_patrol.patrol.request import Request, request_from_plain, request_to_plain
from rosbot_patrol.patrol.rooms import Rooms

if TYPE_CHECKING:
    from rosbot_patrol.patrol.manager import PatrolManager

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
