import pytest

from rosbot_patrol.alerts.records.incident import Event
from rosbot_patrol.alerts.records.query import Query, find_incidents
from rosbot_patrol.alerts.records.store import IncidentStore


@pytest.fixture
def find(quick_disk, make_incident):
    rows = [("a", 1, "Küche – 台所", "clear"), ("b", 2, "hall", "confirmed"), ("c", 12, "hall", "clear")]
    with IncidentStore(quick_disk) as store:
        for i, (name, room, room_name, verdict) in enumerate(rows):
            given = {"room_id": room, "room_name": room_name, "verdict": "", "reason": "", "object_class": ""}
            store.begin(make_incident(id=name, wall=100.0 * (i + 1), **given))
            store.record(name, add=[Event(wall=1.0, kind="sensor", text=f"sensor {room} sees motion")])
            store.close(name, wall=1000.0, verdict=verdict, reason='somebody\'s "cat"' if name == "c" else "none")
        store.begin(make_incident(id="d", wall=50.0, room_id=2, room_name="hall", verdict=""))  # the clock went back
        yield lambda **given: [f.id for f in find_incidents(store.connection, store.path, Query(**given))]


@pytest.mark.parametrize(
    ("given", "found"),
    [
        ({}, "cbad"),
        ({"limit": 2}, "cb"),
        ({"room": 2}, "bd"),
        ({"room": 1}, "a"),
        ({"verdict": "clear"}, "ca"),
        ({"verdict": ""}, "d"),
        ({"verdict": "confirmed", "room": 2}, "b"),
        ({"since": 200.0}, "cb"),
        ({"until": 200.0}, "ad"),
        ({"since": 200.0, "until": 250.0}, "b"),
        ({"text": "kuche"}, "a"),
        ({"text": "KÜ"}, "a"),
        ({"text": "台所"}, "a"),
        ({"text": "hall"}, "dcb"),
        ({"text": "hall cat"}, "c"),
        ({"text": "hall", "verdict": "confirmed"}, "b"),
        ({"text": "hall", "room": 1}, ""),
        ({"text": "sensor", "room": 1}, "a"),
        ({"text": "hall", "since": 250.0}, "c"),
        ({"text": "hall", "since": 40.0, "until": 60.0}, "d"),
        ({"text": "hall", "until": 250.0}, "db"),
        ({"text": "hall", "until": 40.0}, ""),
        ({"text": "hall", "since": 400.0}, ""),
        ({"text": "h"}, ""),
        ({"text": "台"}, "a"),
        ({"text": '"cat"'}, "c"),
        ({"text": "room2"}, ""),
        ({"text": "NEAR( AND *"}, ""),
        ({"text": "–"}, ""),
        ({"text": "words:hall"}, ""),
        ({"text": "hall\0 \ud800"}, "dcb"),
    ],
)
def test_what_is_found(find, given, found):
    assert "".join(find(**given)) == found


def test_words_of_an_amendment_are_found(quick_disk, make_incident):
    with IncidentStore(quick_disk) as store:
        store.begin(make_incident())
        store.close("20261121T010203Z-1", wall=1.0)
        store.amend("20261121T010203Z-1", wall=2.0, text="the plumber")
        assert len(find_incidents(store.connection, store.path, Query(text="plumb"))) == 1
