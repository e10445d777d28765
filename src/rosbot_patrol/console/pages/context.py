"""What every page is given."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from rosbot_patrol.console.access.door import Door
from rosbot_patrol.console.live.hub import Hub
from rosbot_patrol.console.live.incident_desk import IncidentDesk
from rosbot_patrol.console.live.orders import Desk
from rosbot_patrol.patrol.intruder.known_objects import KnownObject


@dataclass(frozen=True, kw_only=True)
class Context:
    """Parts of the console.

    Attributes:
        hub: the newest values.
        door: who may do what.
        desk: takes orders.
        incidents: what is on record.
        know: adds an object that looks like somebody to the file of the known ones; raises ParamError, OSError.
        state_dir: of the guard.
    """

    hub: Hub
    door: Door
    desk: Desk
    incidents: IncidentDesk
    know: Callable[[KnownObject], None]
    state_dir: Path
