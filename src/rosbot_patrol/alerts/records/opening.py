"""Opening of the incidents in any state: a database of version 1.0 is taken over, a chain that is none is set aside."""

from __future__ import annotations

from pathlib import Path

from rosbot_patrol.alerts.records.disk_errors import errors_of
from rosbot_patrol.alerts.records.files import CHAIN, FOLDER, free_name, time_stamp
from rosbot_patrol.alerts.records.import_1_0 import take_over_records, take_over_whole
from rosbot_patrol.alerts.records.store import IncidentStore
from rosbot_patrol.errors import StoreError
from rosbot_patrol.files import sync_folder


def open_store(state_dir: Path, *, wall: float) -> tuple[IncidentStore, list[str]]:
    """The incidents of a folder, and what the owner has to know about it.

    Args:
        state_dir: holds the folder with the incidents.
        wall: now, seconds since 1970.

    Raises:
        StoreError: the folder cannot be used at all.
    """
    said = take_over_whole(state_dir)
    try:
        store = IncidentStore(state_dir, wall=wall)
    except StoreError as err:
        if not err.is_corrupt:
            raise
        store, sentence = _begin_anew(state_dir, err, wall)
        said.append(sentence)
    said += store.found.said
    return store, said + take_over_records(store, wall=wall)


def _begin_anew(state_dir: Path, problem: StoreError, wall: float) -> tuple[IncidentStore, str]:
    path = state_dir / FOLDER / CHAIN
    with errors_of(path):
        aside = free_name(path, f"broken-{time_stamp(wall)}")
        path.rename(aside)
        sync_folder(path.parent)
    sentence = f"{path} {problem.problem}; it was set aside as {aside.name}, and a new one begun"
    return IncidentStore(state_dir, wall=wall, why=f"{aside.name} {problem.problem}"), sentence
