"""The folders of incidents: one each, for the record, pictures and reports. A file is whole or not there."""

from __future__ import annotations

import hashlib
import json
import os
import re
import shutil
import time
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from rosbot_patrol.alerts.records import chain
from rosbot_patrol.alerts.records.disk_errors import errors_of
from rosbot_patrol.alerts.records.incident import (
    Incident,
    StoredFile,
    incident_from_plain,
    incident_to_plain,
    is_name,
)
from rosbot_patrol.errors import StoreError
from rosbot_patrol.files import sync_folder, write_whole

FOLDER = "incidents"
CHAIN = "chain.jsonl"
RECORD = "record.json"
REPORT = "report.html"  # made of the record, not part of it

_OWN = re.compile(r"record\.json.*|amendment-\d+\.json|report\.html")  # files that no record names
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
        self._write(incident_id, {file.name: file.data for file in files})

    def write_record(self, incident: Incident, files: Iterable[NewFile] = ()) -> str:
        """Replace the record of an incident, after some of its files.

        Returns:
            The text of the record, the one that is hashed.

        Raises:
            StoreError: the disk does not take it; then some of the files may be there.
        """
        text = chain.canonical(incident_to_plain(incident))
        self._write(incident.id, {file.name: file.data for file in files} | {RECORD: text.encode("utf-8")})
        return text

    def write_amendment(self, incident_id: str, n: int, text: str) -> None:
        """Keep the body of an amendment, link `n` of the chain. Raises StoreError."""
        self._write(incident_id, {amendment_name(n): text.encode("utf-8")})

    def _write(self, incident_id: str, files: Mapping[str, bytes]) -> None:
        folder = self.path(incident_id)
        paths = [(self.path(incident_id, name), data) for name, data in files.items()]
        with errors_of(folder):
            is_new = not folder.exists()
            folder.mkdir(parents=True, exist_ok=True)
            for path, data in paths:
                write_whole(path, data)
            sync_folder(folder)
            if is_new:
                sync_folder(self.root)

    def text(self, incident_id: str, name: str = RECORD) -> str | None:
        """The text of a record or an amendment; None if there is none.

        Raises:
            StoreError: it cannot be read; `is_corrupt` if it is no text.
        """
        path = self.path(incident_id, name)
        with errors_of(path):
            try:
                return path.read_bytes().decode("utf-8")
            except FileNotFoundError:
                return None
            except UnicodeDecodeError as err:
                raise _senseless(path, err) from err

    def record(self, incident_id: str) -> Incident | None:
        """The record of an incident; None if there is none.

        Raises:
            StoreError: it cannot be read; `is_corrupt` if it makes no sense or belongs to another incident.
        """
        text = self.text(incident_id)
        return None if text is None else self.parse(incident_id, text)

    def parse(self, incident_id: str, text: str) -> Incident:
        """The record of a text. Raises StoreError, `is_corrupt`."""
        path = self.path(incident_id, RECORD)
        try:
            incident = incident_from_plain(json.loads(text))
        except (ValueError, TypeError, KeyError, AttributeError, RecursionError) as err:
            raise _senseless(path, err) from err
        if incident.id != incident_id:
            raise StoreError(path, f"holds the record of {incident.id!r}; see 'incidents verify'", is_corrupt=True)
        return incident

    def set_aside(self, incident_id: str, wall: float) -> str:
        """Rename a damaged record, so that a new one can take its place; returns the new name. Raises StoreError."""
        path = self.path(incident_id, RECORD)
        with errors_of(path):
            aside = free_name(path, f"broken-{time_stamp(wall)}")
            path.rename(aside)
            sync_folder(path.parent)
        return aside.name

    def names(self, incident_id: str) -> Iterator[str]:
        """The pictures that are there, without those that a crash left half written (they are removed)."""
        folder = self.path(incident_id)
        with errors_of(folder):
            if not folder.is_dir():
                return
            for entry in sorted(folder.iterdir()):
                if _SCRATCH.fullmatch(entry.name):
                    entry.unlink(missing_ok=True)
                elif entry.is_file() and is_name(entry.name) and not is_own(entry.name):
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


def amendment_name(n: int) -> str:
    """The file with the body of an amendment, link `n` of the chain."""
    return f"amendment-{n}.json"


def is_own(name: str) -> bool:
    """Whether the store itself keeps a file of this name in an incident's folder."""
    return bool(_OWN.fullmatch(name))


def time_stamp(wall: float) -> str:
    """A time [s since 1970] for the name of a file."""
    return time.strftime("%Y%m%dT%H%M%SZ", time.gmtime(wall))


def free_name(path: Path, ending: str) -> Path:
    """A name beside a file that nothing has yet."""
    names = (path.with_name(f"{path.name}.{ending}{more}") for more in ("", *(f"-{i}" for i in range(2, 1000))))
    return next(name for name in names if not name.exists())


def _senseless(path: Path, err: Exception) -> StoreError:
    return StoreError(path, f"makes no sense: {err!r}; see 'incidents verify'", is_corrupt=True)
