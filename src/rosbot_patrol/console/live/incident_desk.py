"""The incidents on record, for the pages: lists, one record, its files, and what people say of it.

Each call opens the store anew: another program writes it, and may make its index anew at any time. What people say of
an incident becomes a part of the chain, as an amendment.
"""

from __future__ import annotations

import io
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from rosbot_patrol.alerts.records.incident import Event, Incident, StoredFile, is_name
from rosbot_patrol.alerts.records.query import Found, Query, find_incidents
from rosbot_patrol.alerts.records.store import IncidentStore, has_incidents
from rosbot_patrol.alerts.report.export import export_incident
from rosbot_patrol.errors import AccessError, StoreError

SEEN, FALSE_ALARM = "seen", "false_alarm"
_ROLES = ("detection", "best", "map", "look", "before", "after")  # the first one there is stands for the incident
_ENDINGS = (".jpg", ".jpeg", ".png")


@dataclass(frozen=True, kw_only=True)
class Card:
    """One incident of a list.

    Attributes:
        found: its row.
        picture: name of the file that shows it, "" for none.
        marks: what people said of it: SEEN, FALSE_ALARM.
    """

    found: Found
    picture: str
    marks: frozenset[str]


@dataclass(frozen=True, kw_only=True)
class Details:
    """One incident with what was added later."""

    incident: Incident
    amendments: tuple[Event, ...]

    @property
    def marks(self) -> frozenset[str]:
        """What people said of it."""
        return _marks(self.amendments)


class IncidentDesk:
    """The incidents of one state folder.

    Args:
        state_dir: the folder.
        wall: seconds since 1970.
    """

    def __init__(self, state_dir: Path, wall: Callable[[], float]) -> None:
        self._state_dir, self._wall = state_dir, wall

    def find(self, query: Query) -> list[Card]:
        """The incidents that fit, the newest first. Raises StoreError."""
        if not has_incidents(self._state_dir):
            return []
        with IncidentStore(self._state_dir, read_only=True) as store:
            return [_card(store, row) for row in find_incidents(store.connection, store.path, query)]

    def get(self, incident_id: str) -> Details | None:
        """One incident, None if there is none of that id. Raises StoreError."""
        if not is_name(incident_id) or not has_incidents(self._state_dir):
            return None
        with IncidentStore(self._state_dir, read_only=True) as store:
            incident = store.get(incident_id)
            return Details(incident=incident, amendments=store.amendments(incident_id)) if incident else None

    def file(self, incident_id: str, name: str) -> bytes | None:
        """A file of an incident's record, None if the record names no such file. Raises StoreError."""
        details = self.get(incident_id)
        if details is None or not any(each.name == name for each in details.incident.files):
            return None
        with IncidentStore(self._state_dir, read_only=True) as store:
            return store.folder.read(incident_id, name)

    def export(self, incident_id: str) -> bytes | None:
        """The zip file of an incident, None if there is none of that id. Raises StoreError."""
        details = self.get(incident_id)
        if details is None:
            return None
        target = io.BytesIO()
        with IncidentStore(self._state_dir, read_only=True) as store:
            export_incident(store, details.incident, target)
        return target.getvalue()

    def mark(self, incident_id: str, mark: str, who: str) -> None:
        """Add what somebody says of a closed incident. Raises StoreError."""
        said = {SEEN: "seen", FALSE_ALARM: "a false alarm"}[mark]
        with IncidentStore(self._state_dir) as store:
            store.amend(incident_id, wall=self._wall(), text=f"{who} marked it as {said}", data={"mark": mark})

    def remove(self, incident_id: str, why: str, who: str) -> None:
        """Delete a closed incident. Raises StoreError, AccessError where no reason is given."""
        if not why.strip():
            raise AccessError("the reason", "is missing")
        with IncidentStore(self._state_dir) as store:
            store.remove(incident_id, wall=self._wall(), why=f"{who}: {why.strip()[:200]}")


def pictures_of(incident: Incident) -> list[StoredFile]:
    """Pictures of an incident, the most telling first."""
    found = [file for file in incident.files if file.name.endswith(_ENDINGS)]
    return sorted(found, key=lambda file: _ROLES.index(file.role) if file.role in _ROLES else len(_ROLES))


def _card(store: IncidentStore, row: Found) -> Card:
    try:
        incident = store.get(row.id)
        marks = _marks(store.amendments(row.id)) if incident is not None and row.closed is not None else frozenset()
    except StoreError:  # a damaged record costs its picture only; `incidents verify` names it
        incident, marks = None, frozenset()
    pictures = pictures_of(incident) if incident is not None else []
    return Card(found=row, picture=pictures[0].name if pictures else "", marks=marks)


def _marks(amendments: tuple[Event, ...]) -> frozenset[str]:
    return frozenset(str(each.data.get("mark", "")) for each in amendments) & {SEEN, FALSE_ALARM}
