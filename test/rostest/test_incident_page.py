"""One incident on its page: the clip plays, a false alarm becomes a known object, and the report for developers."""

import io
import json
import time
import zipfile

import pytest

pytest.importorskip("rospy", reason="needs ROS: source the workspace first")

from console_browser import DESK, Console
from PIL import Image

from rosbot_patrol.alerts.pictures.clip import CLIP, encode_clip
from rosbot_patrol.alerts.records.files import NewFile
from rosbot_patrol.alerts.records.incident import Incident
from rosbot_patrol.alerts.records.store import IncidentStore
from rosbot_patrol.console.access.secret import console_secret, seen_token
from rosbot_patrol.patrol.intruder.known_objects import load_known

ID = "20261129T044627Z-1"
FETCH = "fetch(arguments[0], arguments[1]).then(r => arguments[2](r.status), () => arguments[2](0))"


@pytest.fixture
def console(house):
    console = Console(house)
    yield console
    console.close()


def jpeg(shade):
    out = io.BytesIO()
    Image.new("RGB", (320, 240), (shade, 90, 90)).save(out, "JPEG")
    return out.getvalue()


def record(state):
    """An incident with a place, pictures and a clip."""
    clip = encode_clip([(0.2 * i, jpeg(40 + i)) for i in range(50)])
    with IncidentStore(state) as store:
        person = {"object_class": "person", "person": (2.5, 1.25), "probability": 0.97, "pictures": 9}
        store.begin(Incident(id=ID, wall=time.time() - 60, room_id=1, room_name="guest room", **person))
        files = [NewFile(name="seen.jpg", role="detection", data=jpeg(80), stamp=1.0, caption="sent with the notice")]
        store.add_files(ID, [*files, NewFile(name=CLIP, role="clip", data=clip, caption="clip")])
        store.close(ID, wall=time.time() - 30, verdict="confirmed")


def test_a_false_alarm_becomes_a_known_object(house, console):
    record(console.state)
    console.add("Ada", "correct horse")
    console.start()
    page = console.browser(f"/incidents/{ID}", size=DESK)
    page.sign_in("Ada", "correct horse")
    page.see("Person in guest room")
    video = page.find("//video")
    page.wait(lambda: page.driver.execute_script("return arguments[0].duration", video), "the clip")
    assert page.driver.execute_script("return arguments[0].duration", video) == pytest.approx(10.0, abs=0.3)
    page.driver.execute_script("arguments[0].muted = true; arguments[0].currentTime = 6; arguments[0].play()", video)
    page.wait(lambda: page.driver.execute_script("return arguments[0].currentTime > 6.3", video), "the clip to play")
    page.save("incident-clip")
    page.press("False alarm")
    page.click('//*[contains(@class, "q-checkbox")][.//*[contains(text(), "Something stands there")]]')
    page.type("What is it?", "coat stand")
    page.press("Save")
    page.see("Ada marked it as a false alarm")
    (thing,) = load_known(console.state / "known_objects.yaml")
    assert (thing.x, thing.y, thing.name) == (2.5, 1.25, "coat stand")

    seen = f"/seen/{ID}/{seen_token(console_secret(console.state), ID)}"
    assert page.driver.execute_async_script(FETCH, f"/seen/{ID}/{'0' * 32}", {"method": "POST"}) == 403
    assert page.driver.execute_async_script(FETCH, seen, {"method": "POST", "credentials": "omit"}) == 200
    page.open(f"/incidents/{ID}")
    page.see("somebody, on a notification, marked it as seen")
    assert not [each for each in page.problems() if "/seen/" not in each]


def test_the_report_for_developers_holds_no_secret(house, console):
    console.add("Ada", "correct horse")
    console.add("Mel", "battery staple", "member")
    import rospy

    rospy.set_param("/patrolling_node/smtp_user", "ada.lovelace")
    rospy.set_param("/patrolling_node/email_to", "ada@example.org")
    console.start()
    page = console.browser("/health", size=DESK)
    page.sign_in("Ada", "correct horse")
    page.see("Something is wrong?")
    page.save("health")
    read = (
        "fetch('/report.zip').then(r => r.arrayBuffer())"
        ".then(b => arguments[0](Array.from(new Uint8Array(b))), e => arguments[0](String(e)))"
    )
    with zipfile.ZipFile(io.BytesIO(bytes(page.driver.execute_async_script(read)))) as archive:
        names = set(archive.namelist())
        told = "".join(archive.read(name).decode("utf-8", "replace") for name in names)
    assert {"README.txt", "versions.txt", "parameters.yaml", "graph.txt", "state.json", "day.jsonl"} <= names
    assert "smtp_user: ***" in told
    for secret in ("ada@example.org", "ada.lovelace", "correct horse", json.dumps("Ada")):
        assert secret not in told
    other = console.browser("/health", size=DESK)
    other.sign_in("Mel", "battery staple")
    other.see("Last orders")
    assert "Bug report" not in other.text
    assert other.driver.execute_async_script(FETCH, "/report.zip", {}) == 403
