"""The report of an incident that is in the store."""

from __future__ import annotations

from pathlib import Path

from rosbot_patrol.alerts.incident import Incident
from rosbot_patrol.alerts.incident_files import REPORT, NewFile
from rosbot_patrol.alerts.incident_store import IncidentStore
from rosbot_patrol.alerts.report import Evidence, render_report
from rosbot_patrol.errors import StoreError


def make_report(store: IncidentStore, incident: Incident) -> str:
    """An incident's report as HTML. Raises StoreError."""

    def read(name: str) -> bytes | None:
        try:
            return store.folder.read(incident.id, name)
        except StoreError:
            return None  # the report says so

    evidence = Evidence(read=read, link=store.link(incident.id), amendments=store.amendments(incident.id))
    return render_report(incident, evidence)


def write_report(store: IncidentStore, incident: Incident) -> Path:
    """Write an incident's report into its folder; returns where it lies. Raises StoreError."""
    html = make_report(store, incident)
    store.folder.write(incident.id, [NewFile(name=REPORT, role="other", data=html.encode("utf-8"))])
    return store.folder.path(incident.id, REPORT)
