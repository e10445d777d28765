"""Which incidents go when they are old, too many, or the disk is full: clear ones first, confirmed ones last.

A record that goes leaves its digest in the chain. A clock that jumps far ahead makes nothing vanish: the newest of each
kind always stay, whatever their age.
"""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from enum import Enum
from pathlib import Path

from rosbot_patrol.alerts.disk_reserve import DiskReserve
from rosbot_patrol.alerts.records.disk_errors import errors_of
from rosbot_patrol.alerts.records.store import IncidentStore
from rosbot_patrol.counts import count_of
from rosbot_patrol.errors import StoreError
from rosbot_patrol.params import param

MB = 1_000_000
DAY = 86_400.0
ALWAYS_KEPT = 100  # the newest of each verdict stay, however old
AT_ONCE = 200  # removals in one go, so that other work is not held up
_ORDER = (("clear",), ("unreachable", "unverified", ""), ("confirmed",))
_BYTES = "bytes + record_bytes"  # of the pictures and of the record
_RESERVE_BYTES = 2 * MB  # the chain and the index need it to write down a removal


@dataclass(frozen=True, kw_only=True)
class RetentionParams:
    """How long incidents are kept, and how much of the disk they may use."""

    keep_clear_days: float = param(30.0, unit="d", lo=0.0, doc="maximum age of incidents with the verdict clear")
    keep_days: float = param(365.0, unit="d", lo=0.0, doc="maximum age of all other incidents")
    keep_mb: float = param(
        2000.0,
        unit="MB",
        lo=10.0,
        doc="maximum size of all incidents with their pictures; the oldest are removed first",
    )
    keep_free_mb: float = param(
        200.0, unit="MB", lo=0.0, doc="free disk space to keep; below it the oldest incidents go, except confirmed ones"
    )


class PruneReason(Enum):
    """Why incidents were removed."""

    AGE = "age"
    BUDGET = "budget"  # all incidents together take more room than they may
    DISK_LOW = "disk low"
    DISK_FULL = "disk full"

    @property
    def is_of_disk(self) -> bool:
        """Whether the disk lacks room, so that the owner has to look after it."""
        return self in (PruneReason.DISK_LOW, PruneReason.DISK_FULL)


@dataclass(frozen=True, kw_only=True)
class Pruned:
    """Removed incidents.

    Attributes:
        ids: in order of removal.
        bytes: size of their files [bytes].
        reason: None if nothing had to go.
        why: the reason for people.
        is_done: nothing more has to go.
    """

    ids: tuple[str, ...] = ()
    bytes: int = 0
    reason: PruneReason | None = None
    why: str = ""
    is_done: bool = True

    @property
    def sentence(self) -> str:
        """For people."""
        count = len(self.ids)
        return f"{count_of(count, 'old incident')} ({self.bytes / MB:.1f} MB) removed: {self.why}"


def prune(store: IncidentStore, params: RetentionParams, *, wall: float) -> Pruned:
    """Remove incidents that are too old or too many, AT_ONCE at most.

    Args:
        store: of the incidents.
        params: limits.
        wall: now, seconds since 1970.

    Raises:
        StoreError: the disk does not take it.
    """
    expired = _Cut(PruneReason.AGE, "they are older than they are kept")
    found = _remove(store, _expired(store, params, wall), AT_ONCE, expired, wall)
    if found.ids:
        return found
    over = used_bytes(store) - params.keep_mb * MB
    if over > 0.0:
        cut = _Cut(PruneReason.BUDGET, f"all take more than {params.keep_mb:g} MB", wanted=over)
        return _remove(store, _oldest(store, _ORDER), AT_ONCE, cut, wall)
    lacking = params.keep_free_mb * MB - free_bytes(store.state_dir)
    if lacking > 0.0:
        why = f"less than {params.keep_free_mb:g} MB were free on the disk"
        cut = _Cut(PruneReason.DISK_LOW, why, wanted=lacking)
        return _remove(store, _oldest(store, _ORDER[:2]), AT_ONCE, cut, wall)
    return Pruned()


def make_room(store: IncidentStore, *, wall: float, wanted: float = 10.0 * MB) -> Pruned:
    """Remove the oldest incidents but confirmed ones, because the disk takes nothing more. Raises StoreError."""
    release_reserve(store.state_dir)
    cut = _Cut(PruneReason.DISK_FULL, "the disk is full", wanted=wanted)
    try:
        return _remove(store, _oldest(store, _ORDER[:2]), 20, cut, wall)
    finally:
        with suppress(StoreError):  # the disk is full, which is why we are here
            keep_reserve(store.state_dir)


def keep_reserve(state_dir: Path) -> None:
    """Hold some room on the disk that `make_room` can use. Raises StoreError."""
    reserve = _reserve(state_dir)
    with errors_of(reserve.path):
        reserve.fill()


def release_reserve(state_dir: Path) -> None:
    """Give up the room that is held. Raises StoreError."""
    reserve = _reserve(state_dir)
    with errors_of(reserve.path):
        reserve.give(_RESERVE_BYTES)


def _reserve(state_dir: Path) -> DiskReserve:
    return DiskReserve(state_dir / "incidents.reserve", _RESERVE_BYTES)


def used_bytes(store: IncidentStore) -> int:
    """What all incidents take on the disk. Raises StoreError."""
    with errors_of(store.path):
        files = store.connection.execute(f"SELECT total({_BYTES}) FROM incidents").fetchone()[0]
        pages, free, size = (
            int(store.connection.execute(f"PRAGMA {name}").fetchone()[0])
            for name in ("page_count", "freelist_count", "page_size")
        )
        return int(files) + store.chain.size + (pages - free) * size


def free_bytes(folder: Path) -> int:
    """What the disk has left. Raises StoreError."""
    with errors_of(folder):
        return shutil.disk_usage(folder).free


@dataclass(frozen=True)
class _Cut:
    """Why incidents go, and how many bytes of room are wanted; 0: all of them go."""

    reason: PruneReason
    why: str
    wanted: float = 0.0


def _remove(store: IncidentStore, victims: Iterator[tuple[str, int]], most: int, cut: _Cut, wall: float) -> Pruned:
    ids: list[str] = []
    freed = 0
    for incident_id, size in victims:
        if len(ids) == most or (cut.wanted and freed >= cut.wanted):
            break
        store.remove(incident_id, wall=wall, why=cut.why)
        ids.append(incident_id)
        freed += size
    return Pruned(ids=tuple(ids), bytes=freed, reason=cut.reason, why=cut.why, is_done=len(ids) < most)


def _expired(store: IncidentStore, params: RetentionParams, wall: float) -> Iterator[tuple[str, int]]:
    for group in _ORDER:
        for verdict in group:
            days = params.keep_clear_days if verdict == "clear" else params.keep_days
            yield from _closed(store, verdict, before=wall - days * DAY, spare=ALWAYS_KEPT)


def _oldest(store: IncidentStore, order: tuple[tuple[str, ...], ...]) -> Iterator[tuple[str, int]]:
    for group in order:
        while True:
            heads = [row for verdict in group for row in _closed_rows(store, verdict, float("inf"), 0, 1)]
            if not heads:
                break
            _, incident_id, size = min(heads)
            yield incident_id, size


def _closed(store: IncidentStore, verdict: str, before: float, spare: int) -> Iterator[tuple[str, int]]:
    for _, incident_id, size in _closed_rows(store, verdict, before, spare, AT_ONCE):
        yield incident_id, size


def _closed_rows(
    store: IncidentStore, verdict: str, before: float, spare: int, most: int
) -> list[tuple[float, str, int]]:
    """(wall, id, bytes) of the oldest closed ones that began before a time, without the `spare` newest."""
    with errors_of(store.path):
        count = store.connection.execute(
            "SELECT count(*) FROM incidents WHERE verdict=? AND closed IS NOT NULL", (verdict,)
        ).fetchone()[0]
        rows = store.connection.execute(
            f"SELECT wall, id, {_BYTES} AS bytes FROM incidents WHERE verdict=? AND closed IS NOT NULL AND wall < ?"
            " ORDER BY wall LIMIT ?",
            (verdict, before, max(min(most, count - spare), 0)),
        )
        return [(row["wall"], row["id"], row["bytes"]) for row in rows]
