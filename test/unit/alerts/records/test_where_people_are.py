"""Where the person is stands first in every way that an incident is told; then who called."""

import json
from email.policy import SMTP

import pytest

from rosbot_patrol.alerts.channels.mail import build_mail
from rosbot_patrol.alerts.channels.mail_html import html_page
from rosbot_patrol.alerts.channels.transports.webhook import document
from rosbot_patrol.alerts.outbox.digest import merge
from rosbot_patrol.alerts.outbox.incident_notices import incident_notice
from rosbot_patrol.alerts.outbox.notice import Notice
from rosbot_patrol.alerts.records.incident import NO_ROOM, incident_from_plain, incident_to_plain
from rosbot_patrol.alerts.records.query import Query, find_incidents
from rosbot_patrol.alerts.records.store import IncidentStore
from rosbot_patrol.alerts.records.verify import verify
from rosbot_patrol.alerts.report.page import Evidence, render_report

KITCHEN = {"person": (4.0, 1.0), "person_room_id": 5, "person_room": "kitchen"}
STUDY = {"room_id": 7, "room_name": "study"}


@pytest.fixture
def elsewhere(make_incident):
    """Somebody in the kitchen; the study's sensor called."""
    return make_incident(**STUDY, **KITCHEN)


def page(incident):
    return render_report(incident, Evidence(read=lambda name: None))


def heading(html):
    return html[html.index("<h1>") + 4 : html.index("</h1>")]


def test_somebody_in_another_room(elsewhere):
    notice = incident_notice(elsewhere, b"\xff\xd8")
    assert notice.facts[:2] == (("Room", "5 (kitchen)"), ("Caller", "a motion sensor in room 7 (study)"))
    assert notice.picture_name == "room5-20261121T010203Z-1.jpg"
    assert notice.subject.startswith("Person in kitchen, ")
    assert notice.text.splitlines() == [
        "Person seen in room 5 (kitchen).",
        "Called by a motion sensor in room 7 (study).",
    ]
    assert elsewhere.sentence.startswith("person seen in room 5 (kitchen) while looking around in room 7 (study), prob")
    html = html_page(notice)
    assert html.index("kitchen") < html.index("study")
    assert "<title>kitchen</title>" in html
    tree = json.loads(document(notice))
    assert tree["room"] == {"id": 5, "name": "kitchen"}
    assert tree["called_by"] == {"id": 7, "name": "study"}
    assert heading(page(elsewhere)) == "Room 5 (kitchen)"
    assert "Room 7 (study)" in page(elsewhere)
    assert Notice.from_bytes(notice.to_bytes()) == notice


@pytest.mark.parametrize(
    "known", [{}, {"person": (4.0, 1.0)}, {"person": (4.0, 1.0), "person_room_id": 7, "person_room": "study"}]
)
@pytest.mark.parametrize("phase", ["looking", ""])
def test_in_the_room_of_the_call_nothing_is_told_otherwise(make_incident, known, phase):
    notice = incident_notice(make_incident(**STUDY, **known, phase=phase), None)
    assert notice.text == "Person seen in room 7 (study)."
    assert (notice.room_id, notice.room_name, notice.place, notice.called_id) == (7, "study", "", -1)
    assert notice.facts[0] == ("Room", "7 (study)")
    assert "Caller" not in dict(notice.facts)
    assert notice.picture_name == "room7-20261121T010203Z-1.jpg"
    assert "called_by" not in json.loads(document(notice))


@pytest.mark.parametrize(("phase", "way"), [("driving", "on the way to"), ("returning", "on the way back from")])
def test_on_the_way_without_a_place_no_room_is_claimed(make_incident, phase, way):
    incident = make_incident(**STUDY, phase=phase)
    notice = incident_notice(incident, b"\xff\xd8")
    assert notice.facts[0] == ("Room", f"{way} room 7 (study)")
    assert notice.picture_name == "person-20261121T010203Z-1.jpg"
    assert f"<title>{way} room 7 (study)</title>" in html_page(notice)
    assert json.loads(document(notice))["place"] == f"{way} room 7 (study)"
    assert notice.subject.startswith(f"Person {way} room 7 (study), ")
    assert heading(page(incident)) == f"{way[0].upper()}{way[1:]} room 7 (study)"


@pytest.mark.parametrize("phase", ["driving", "looking", "returning"])
def test_in_no_room_of_the_map_no_room_is_claimed(make_incident, phase):
    incident = make_incident(**STUDY, phase=phase, person=(4.0, 1.0), person_room_id=NO_ROOM)
    notice = incident_notice(incident, b"\xff\xd8")
    assert notice.facts[0] == ("Room", "in no room of the map, near room 7 (study)")
    assert "person seen in no room of the map" in incident.sentence
    assert notice.subject.startswith("Person in no room of the map, near room 7 (study), ")
    assert notice.picture_name == "person-20261121T010203Z-1.jpg"
    assert heading(page(incident)).startswith("In no room of the map")


def test_a_room_without_a_number(make_incident):
    notice = incident_notice(make_incident(**STUDY, person_room="hall"), b"\xff\xd8")
    assert notice.facts[0] == ("Room", "hall")
    assert notice.picture_name.startswith("person-")
    tree = json.loads(document(notice))
    assert ("room" in tree, tree["place"]) == (False, "hall")


@pytest.mark.parametrize(
    ("origin", "said"),
    [
        ("trigger", "a motion sensor in room 7 (study)"),
        ("silent_sensor", "the silent motion sensor of room 7 (study)"),
        ("schedule", "the schedule, for room 7 (study)"),
    ],
)
def test_who_called(elsewhere, make_incident, origin, said):
    assert dict(incident_notice(make_incident(**STUDY, **KITCHEN, origin=origin), None).facts)["Caller"] == said


@pytest.mark.parametrize("evil", ["a\nBcc: evil@x.org", "a\r\n\r\nnew body", "a\x00b", "\n.\n", "<b>"])
def test_the_other_rooms_name_can_inject_nothing(make_incident, envelope, evil):
    incident = make_incident(**STUDY, **{**KITCHEN, "person_room": evil})
    notice = incident_notice(incident, b"\xff\xd8")
    mail = build_mail(notice, envelope).as_bytes(policy=SMTP).decode()
    assert not any(line.startswith(("Bcc", "new body")) for line in mail.splitlines())
    assert len(notice.text.splitlines()) == 2
    assert "<b>" not in page(incident)
    assert "<b>" not in html_page(notice)


def test_a_digest_tells_it_too(elsewhere):
    told = merge([incident_notice(elsewhere, None)] * 3)
    assert "Person seen in room 5 (kitchen)." in told.text


def test_a_record_of_an_earlier_version_has_no_number(elsewhere):
    plain = incident_to_plain(elsewhere)
    del plain["person_room_id"]
    plain["person_room"] = ""
    assert incident_from_plain(plain).where == "room 7 (study)"


def test_lists_find_it_by_either_room(tmp_path, elsewhere, make_incident):
    with IncidentStore(tmp_path, wall=1.0) as store:
        for number, incident in enumerate([elsewhere, make_incident(room_id=5, room_name="kitchen"), make_incident()]):
            plain = incident_to_plain(incident) | {"id": f"m{number}", "wall": 1.79e9 + number}
            store.begin(incident_from_plain(plain))
            store.close(f"m{number}", wall=1.79e9 + 60.0)

        def found(**given):
            return [row.id for row in find_incidents(store.connection, store.path, Query(**given))]

        assert found(room=5) == ["m1", "m0"]
        assert found(room=7) == ["m0"]
        assert found(room=5, limit=1) == ["m1"]
        assert found(room=5, text="person") == ["m1", "m0"]
        assert found(room=5, verdict="confirmed", until=1.79e9 + 0.5) == ["m0"]
        assert found(room=50) == []
        assert verify(store).fits
