"""Incidents for the pages: lists with pictures and marks, files that the record names, what people say of one."""

from __future__ import annotations

import io
import zipfile
from pathlib import Path

import pytest

from rosbot_patrol.alerts.records.files import NewFile
from rosbot_patrol.alerts.records.incident import Incident
from rosbot_patrol.alerts.records.query import Query
from rosbot_patrol.alerts.records.store import IncidentStore
from rosbot_patrol.alerts.records.verify import verify
from rosbot_patrol.console.live.incident_desk import FALSE_ALARM, SEEN, IncidentDesk
from rosbot_patrol.errors import AccessError

ID = "20261129T044627Z-1"
JPEG = b"\xff\xd8\xff\xe0 not looked at"


@pytest.fixture
def desk(tmp_path: Path) -> IncidentDesk:
    with IncidentStore(tmp_path) as store:
        for k in range(3):
            name = f"{ID[:-1]}{k + 1}"
            store.begin(Incident(id=name, wall=1.5e9 + 60 * k, room_id=3, room_name="kitchen"))
            store.add_files(
                name,
                [
                    NewFile(name="look1.jpg", role="look", data=JPEG),
                    NewFile(name="room3.jpg", role="detection", data=JPEG + b"2"),
                ],
            )
            if k < 2:
                verdict = "confirmed" if k == 0 else "clear"
                store.close(name, wall=1.5e9 + 60 * k + 30, verdict=verdict, object_class="person" if k == 0 else "")
    return IncidentDesk(tmp_path, lambda: 1.6e9)


def test_without_incidents_lists_are_empty(tmp_path: Path) -> None:
    desk = IncidentDesk(tmp_path / "nothing", lambda: 0.0)
    assert desk.find(Query()) == []
    assert desk.get(ID) is None
    assert desk.file(ID, "room3.jpg") is None
    assert desk.export(ID) is None


def test_cards_show_the_most_telling_picture_and_the_marks(desk: IncidentDesk) -> None:
    desk.mark(ID, SEEN, "Ada")
    desk.mark(ID, FALSE_ALARM, "Ada")
    cards = desk.find(Query())
    assert [card.found.id[-1] for card in cards] == ["3", "2", "1"]
    assert {card.picture for card in cards} == {"room3.jpg"}
    assert cards[2].marks == {SEEN, FALSE_ALARM}
    assert cards[1].marks == frozenset()
    assert [card.found.id for card in desk.find(Query(verdict="confirmed"))] == [ID]


def test_what_people_say_stands_in_the_chain(desk: IncidentDesk, tmp_path: Path) -> None:
    desk.mark(ID, FALSE_ALARM, "Ada")
    details = desk.get(ID)
    assert details is not None
    assert [event.text for event in details.amendments] == ["Ada marked it as a false alarm"]
    with IncidentStore(tmp_path, read_only=True) as store:
        assert verify(store).fits


@pytest.mark.parametrize("name", ["record.json", "../../accounts.json", "other.jpg", "", "..", "/etc/passwd"])
def test_only_files_of_the_record_are_given(desk: IncidentDesk, name: str) -> None:
    assert desk.file(ID, "room3.jpg") == JPEG + b"2"
    assert desk.file(ID, name) is None
    assert desk.file("..", "room3.jpg") is None


def test_an_export_holds_record_proof_page_and_pictures(desk: IncidentDesk) -> None:
    data = desk.export(ID)
    assert data is not None
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        assert {"record.json", "link.json", "report.html", "room3.jpg", "look1.jpg"} <= set(archive.namelist())


def test_deleting_needs_a_reason_that_stays(desk: IncidentDesk, tmp_path: Path) -> None:
    with pytest.raises(AccessError, match="the reason is missing"):
        desk.remove(ID, "  ", "Ada")
    desk.remove(ID, "only the cat", "Ada")
    assert desk.get(ID) is None
    assert "Ada: only the cat" in (tmp_path / "incidents" / "chain.jsonl").read_text("utf-8")
