"""Incidents marked as seen from a notification, by the token that its address holds."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest

from rosbot_patrol.alerts.records.incident import Incident
from rosbot_patrol.alerts.records.store import IncidentStore
from rosbot_patrol.console.access.secret import seen_token
from rosbot_patrol.console.live.acknowledge import Acknowledgements
from rosbot_patrol.console.live.incident_desk import SEEN, IncidentDesk

SECRET = b"s" * 32
ID = "20261129T044627Z-1"


@pytest.fixture
def desk(tmp_path: Path) -> IncidentDesk:
    with IncidentStore(tmp_path) as store:
        store.begin(Incident(id=ID, wall=1.5e9, room_id=3, room_name="kitchen"))
    return IncidentDesk(tmp_path, lambda: 1.6e9)


def marks(desk: IncidentDesk) -> frozenset[str]:
    details = desk.get(ID)
    assert details is not None
    return details.marks


def test_a_wrong_token_does_nothing(desk: IncidentDesk) -> None:
    status, text = asyncio.run(Acknowledgements(desk, SECRET).take(ID, "0" * 32))
    assert (status, text) == (403, "This address is not one of a notice.")


def test_a_closed_incident_is_marked_at_once_and_once(desk: IncidentDesk, tmp_path: Path) -> None:
    with IncidentStore(tmp_path) as store:
        store.close(ID, wall=1.5e9 + 30, verdict="confirmed", object_class="person")
    seen = Acknowledgements(desk, SECRET)
    for _ in range(2):
        assert asyncio.run(seen.take(ID, seen_token(SECRET, ID)))[0] == 200
    details = desk.get(ID)
    assert details is not None
    assert [each.text for each in details.amendments] == ["somebody, on a notification, marked it as seen"]


def test_one_whose_mission_still_runs_is_marked_afterwards(desk: IncidentDesk, tmp_path: Path) -> None:
    async def acknowledge() -> None:
        seen = Acknowledgements(desk, SECRET, period=0.05)
        assert (await seen.take(ID, seen_token(SECRET, ID)))[0] == 202
        await asyncio.sleep(0.15)
        assert marks(desk) == frozenset()
        with IncidentStore(tmp_path) as store:
            store.close(ID, wall=1.5e9 + 30, verdict="confirmed", object_class="person")
        for _ in range(100):
            await asyncio.sleep(0.05)
            if marks(desk):
                break

    asyncio.run(acknowledge())
    assert marks(desk) == {SEEN}
