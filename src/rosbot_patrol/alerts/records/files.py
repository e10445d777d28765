"""The folders of incidents: one each, for pictures and reports. A file is whole or not there."""

from __future__ import annotations

import hashlib
import os
import re
import shutil
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from rosbot_patrol.alerts.records.database import errors_of
from rosbot_patrol.alerts.records.incident import StoredFile, is_name
from rosbot_patrol.files import sync_folder, write_whole

REPORT = "report.html"  # made of the record, not part of it

_SCRATCH = re.compile(r"\..+\.tmp")


@dataclass(frozen=True, kw_only=True)
class NewFile:
    """A file to keep; see StoredFile."""

    name: str
    role: str
    data: bytes
    stamp: float | None = None
    caption: str = ""

    def stored(self) -> StoredFile:
        """As the record holds it."""
        return StoredFile(
            name=self.name,
            role=self.role,
            sha256=hashlib.sha256(self.data).hexdigest(),
            size=len(self.data),
            stamp=self.stamp,
            caption=self.caption,
        )


class IncidentFolder:
    """`root`/ID/NAME.

    Args:
        root: made with the first file if it is missing.
    """

    def __init__(self, root: Path) -> None:
        self.root = root

    def path(self, incident_id: str, name: str = "") -> Path:
        """The folder of an incident's files, or the path of one. Raises ValueError if that is no file name."""
        for part in (incident_id, name) if name else (incident_id,):
            if not is_name(part):
                raise ValueError(f"{part!r} is no name for a file")
        return self.root / incident_id / name if name else self.root / incident_id

    def write(self, incident_id: str, files: Iterable[NewFile]) -> None:
        """Bring files to the disk, all of them before it returns. Raises StoreError, then some may be there."""
        folder = self.path(incident_id)
        paths = [(self.path(incident_id, file.name), file.data) for file in files]
        with errors_of(folder):
            is_new = not folder.exists()
            folder.mkdir(parents=True, exist_ok=True)
            for path, data in paths:
                write_whole(path, data)
            sync_folder(folder)
            if is_new:
                sync_folder(self.root)

    def names(self, incident_id: str) -> Iterator[str]:
        """The files that are there, without those that a crash left half written (they are removed)."""
        folder = self.path(incident_id)
        with errors_of(folder):
            if not folder.is_dir():
                return
            for entry in sorted(folder.iterdir()):
                if _SCRATCH.fullmatch(entry.name):
                    entry.unlink(missing_ok=True)
                elif entry.is_file() and is_name(entry.name):
                    yield entry.name

    def ids(self) -> set[str]:
        """The incidents that have a folder."""
        with errors_of(self.root):
            if not self.root.is_dir():
                return set()
            return {entry.name for entry in os.scandir(self.root) if entry.is_dir() and is_name(entry.name)}

    def read(self, incident_id: str, name: str) -> bytes:
        """A file's bytes. Raises StoreError."""
        path = self.path(incident_id, name)
        with errors_of(path):
            return path.read_bytes()

    def remove(self, incident_id: str) -> None:
        """Remove an incident's folder, if there is one, with all files in it. Raises StoreError."""
        folder = self.path(incident_id)
        with errors_of(folder):
            if folder.is_dir():
                shutil.rmtree(folder)

    def problem(self, incident_id: str, file: StoredFile) -> str:
        """What is wrong with a file of a record; "" if it is unchanged."""
        path = self.path(incident_id, file.name)
        try:
            data = path.read_bytes()
        except OSError as err:
            return f"the file {file.name} cannot be read: {err.strerror or err}"
        if hashlib.sha256(data).hexdigest() != file.sha256:
            return f"the file {file.name} is not the one that was kept: it was changed"
        return ""
