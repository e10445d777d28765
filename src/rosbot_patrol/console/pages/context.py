"""What every page is given."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from rosbot_patrol.console.access.door import Door
from rosbot_patrol.console.house.files import HouseFiles
from rosbot_patrol.console.live.acknowledge import Acknowledgements
from rosbot_patrol.console.live.day_log import DayLog
from rosbot_patrol.console.live.guide import Guide
from rosbot_patrol.console.live.hub import Hub
from rosbot_patrol.console.live.incident_desk import IncidentDesk
from rosbot_patrol.console.live.orders import Answer, Desk


@dataclass(frozen=True, kw_only=True)
class Context:
    """Parts of the console.

    Attributes:
        hub: the newest values.
        door: who may do what.
        desk: takes orders.
        incidents: what is on record.
        seen: marks incidents as seen from notices.
        state_dir: of the guard.
        house: files of the house.
        follow_house: shows what has changed in them.
        day_log: of the last day.
        report: makes the zip file of a bug report; may block for some seconds.
        guide: for a new house, None once it is set up.
        channels: the ways to the owner, by name: where each leads; raises ParamError.
        try_channel: sends a test notice by one of them.
    """

    hub: Hub
    door: Door
    desk: Desk
    incidents: IncidentDesk
    seen: Acknowledgements
    state_dir: Path
    house: HouseFiles
    follow_house: Callable[[], None]
    day_log: DayLog
    report: Callable[[], bytes]
    channels: Callable[[], Mapping[str, str]]
    try_channel: Callable[[str], Answer]
    guide: Guide | None = None
