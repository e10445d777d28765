"""Incidents as they were kept before there was a database: a folder each, with incident.json and picture.jpg."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

from rosbot_patrol.alerts.records.incident import VERDICTS, Incident
from rosbot_patrol.files import write_atomic

NAME = "incident.json"


def load_incident(folder: Path, incident_id: str) -> Incident | None:
    """The record of an id, None where there is none that makes sense."""
    try:
        tree = json.loads((folder / incident_id / NAME).read_text(encoding="utf-8"))
        pose = tree["pose"]
        confirmed = tree["verdict"] == "confirmed"
        return Incident(
            id=incident_id,
            wall=float(tree["wall"]),
            ros_time=float(tree["ros_time"]),
            room_id=int(tree["room_id"]),
            room_name=str(tree["room_name"]),
            phase=str(tree["phase"]),
            object_class=str(tree["object_class"]),
            probability=float(tree["probability"]),
            pictures=int(tree["pictures"]),
            verdict=tree["verdict"] if tree["verdict"] in VERDICTS else "unverified",
            reason=str(tree["reason"]),
            confirmed=float(tree["wall"]) if confirmed else None,
            sightings=int(tree.get("sightings", 0)),
            pose=(float(pose[0]), float(pose[1]), float(pose[2])) if pose else None,
        )
    except (OSError, ValueError, TypeError, KeyError, AttributeError, IndexError):
        return None


def save_incident(folder: Path, incident: Incident, picture: bytes | None = None) -> Path:
    """Write the record (and its picture) into `folder`/ID; returns that folder. Raises OSError."""
    home = folder / incident.id
    if picture is not None:
        write_atomic(home / "picture.jpg", picture)
    text = json.dumps(dataclasses.asdict(incident), indent=1, ensure_ascii=False)
    write_atomic(home / NAME, text.encode("utf-8"))
    return home
