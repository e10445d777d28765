"""What happened: the record of one confirmed intruder, as plain values."""

from __future__ import annotations

import dataclasses
import json
from dataclasses import dataclass
from pathlib import Path

from rosbot_patrol.files import write_atomic


@dataclass(frozen=True, kw_only=True)
class Incident:
    """One intruder of one mission.

    Attributes:
        id: that of its mission.
        wall: when it was confirmed, seconds since 1970; ros_time: by the robot's clock [s].
        room_id, room_name: of the mission.
        phase: what the robot was doing: driving, looking, returning.
        object_class, probability: of the detector, mean over `pictures`.
        verdict: of the mission so far; reason: in one sentence.
        pose: x [m], y [m], yaw [rad] of the robot in map, None where it was not known.
        sightings: how many pictures confirmed it in the whole mission, known when that is over.
        final: the mission is over.
    """

    id: str
    wall: float
    ros_time: float
    room_id: int
    room_name: str
    phase: str
    object_class: str
    probability: float
    pictures: int
    verdict: str
    reason: str
    pose: tuple[float, float, float] | None = None
    sightings: int = 0
    final: bool = False

    @property
    def sentence(self) -> str:
        """For people."""
        return (
            f"{self.object_class} seen while {_DOING.get(self.phase, self.phase)} room {self.room_id}"
            f" ({self.room_name}), probability {self.probability:.2f}"
        )


_DOING = {"driving": "driving to", "looking": "looking around in", "returning": "coming home from"}


def save_incident(folder: Path, incident: Incident, picture: bytes | None = None) -> Path:
    """Write the record (and its picture) into `folder`/ID; returns that folder. Raises OSError."""
    home = folder / incident.id
    if picture is not None:
        write_atomic(home / "picture.jpg", picture)
    text = json.dumps(dataclasses.asdict(incident), indent=1, ensure_ascii=False)
    write_atomic(home / "incident.json", text.encode("utf-8"))
    return home


def load_incident(folder: Path, incident_id: str) -> Incident | None:
    """The record of an id, None where there is none that makes sense."""
    try:
        tree = json.loads((folder / incident_id / "incident.json").read_text(encoding="utf-8"))
        pose = tree.pop("pose")
        return Incident(**tree, pose=tuple(pose) if pose else None)
    except (OSError, ValueError, TypeError, KeyError, AttributeError):
        return None
