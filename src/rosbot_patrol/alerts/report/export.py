"""An incident as one zip file: record, proof, page and pictures."""

from __future__ import annotations

import json
import zipfile
from typing import IO

from rosbot_patrol.alerts.records.files import REPORT
from rosbot_patrol.alerts.records.incident import Incident, incident_to_plain
from rosbot_patrol.alerts.records.store import IncidentStore
from rosbot_patrol.alerts.report.page import make_report


def export_incident(store: IncidentStore, incident: Incident, target: IO[bytes]) -> None:
    """Write the zip file of an incident. Raises StoreError, OSError."""
    link = store.link(incident.id)
    record = incident_to_plain(incident) if link is None or link.body is None else json.loads(link.body)
    proof = {key: value for key, value in vars(link).items() if key != "body"} if link else None
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("record.json", json.dumps(record, ensure_ascii=False, indent=1))
        archive.writestr("link.json", json.dumps(proof, indent=1))
        if link is not None and link.body is not None:
            archive.writestr("record.canonical.json", link.body)  # the digest covers these bytes
        archive.writestr(REPORT, make_report(store, incident))
        for file in incident.files:
            archive.writestr(file.name, store.folder.read(incident.id, file.name))
