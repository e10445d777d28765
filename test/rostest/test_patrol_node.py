"""patrol_robot as a process, before a real master, a real action server and real topics; needs the built workspace.

The camera and the detector are this test: it publishes pictures with stamps, and boxes that name them.
"""

import json
import os
import signal
import subprocess
import time
from pathlib import Path

import pytest
from patrol_house import ROOT, stop, wait_until
from ros_processes import free_port

from rosbot_patrol.alerts.outbox.notice import Notice
from rosbot_patrol.alerts.outbox.outbox import Outbox

rospy = pytest.importorskip("rospy", reason="needs ROS: source the workspace first")


def test_person_makes_one_mail_with_picture(house):
    house.start_move_base()
    house.start_patrol()
    house.send(2, move=False)  # a heartbeat
    house.person = True
    house.send(2)
    last = house.wait_for_mission()
    assert last.last_verdict == "confirmed"
    phases = house.phases()
    assert phases[phases[0] == "starting" :] == ["idle", "driving", "looking", "returning", "idle"]
    wait_until(lambda: any(a.delivered for a in house.alerts), 20, "the delivery")
    assert [a.delivered for a in house.alerts] == [False, True]
    (mail,) = house.mails()
    assert mail["Subject"].startswith("Person ")  # in the room or, without depth, on the way to it
    assert "square room behind the door" in mail["Subject"]
    parts = list(mail.walk())
    text = parts[2].get_payload(decode=True).decode()
    assert text.startswith("Person seen ")
    assert "2 (square room behind the door)" in text
    picture = parts[-1]
    assert picture.get_content_type() == "image/jpeg"
    assert picture.get_payload(decode=True)[:2] == b"\xff\xd8"
    assert Path(house.alerts[-1].location).exists()
    assert house.alerts[0].room_id == 2
    assert house.alerts[0].object_class == "person"
    wait_until(lambda: house.verdicts, 20, "the verdict on /patrol/alerts")
    assert [(a.kind, a.verdict) for a in (*house.alerts, *house.verdicts)] == [
        ("seen", "confirmed"),
        ("delivered", "confirmed"),
        ("verdict", "confirmed"),
    ]
    stop(house.patrol)  # the record is completed at once
    incident = house.incident(house.alerts[0].id)
    assert (incident.verdict, incident.object_class, incident.origin) == ("confirmed", "person", "trigger")
    assert [phase for phase, _ in incident.times] == ["driving", "looking", "returning"]
    assert incident.events[0].text == "motion sensor 2 sees motion"
    roles = {file.role for file in incident.files}
    assert roles >= {"detection", "best", "after", "look", "map"}
    report = (house.folder / "state" / "incidents" / incident.id / "report.html").read_text()
    assert "square room behind the door" in report


def test_empty_room_makes_none_and_the_turn_ends_with_zero(house):
    house.start_move_base()
    house.start_patrol()
    house.send(1)
    last = house.wait_for_mission()
    assert last.last_verdict == "clear", last.why
    assert house.mails() == []
    assert max(house.twists) > 0.5
    assert house.twists[-1] == 0.0
    turned = float(last.why.split("turned ")[1].split()[0])
    assert abs(turned - 360) <= 6
    wait_until(lambda: house.verdicts, 20, "the verdict on /patrol/alerts")
    kept = house.incident(house.verdicts[0].id)
    assert (kept.verdict, house.verdicts[0].verdict) == ("clear", "clear")


def test_dead_detector_is_never_clear(house):
    house.start_move_base()
    house.start_patrol()
    house.detecting = False
    house.send(1)
    last = house.wait_for_mission()
    assert last.last_verdict == "unverified"
    assert "detector" in last.why
    wait_until(house.mails, 10.0, "the mail that the room was not looked at")
    (mail,) = house.mails()
    assert mail["Subject"] == "rosbot patrol: room 1"
    text = next(part for part in mail.walk() if part.get_content_type() == "text/plain").get_payload(decode=True)
    assert b"could not be looked at to the end: the detector was silent" in b" ".join(text.split())


def test_unreachable_room_is_reported_and_not_turned_in(house):
    house.start_move_base(refuse=["15,11"])
    house.start_patrol()
    house.twists.clear()
    house.send(7)
    last = house.wait_for_mission()
    assert last.last_verdict == "unreachable"
    assert "Failed to find a valid plan" in last.why
    assert "looking" not in house.phases()
    assert not any(house.twists)


def test_unknown_room_is_refused_and_the_node_lives(house):
    house.start_move_base()
    house.start_patrol()
    house.send(99)
    house.send(1)
    assert house.wait_for_mission().last_verdict == "clear"
    assert "there is no room 99" in house.log(house.patrol)


@pytest.mark.long
def test_triggers_of_a_mission_wait_in_order(house):
    house.start_move_base()
    house.start_patrol()
    house.send(1)
    wait_until(lambda: house.states[-1].state == "driving", 20, "the drive")
    for room in (3, 2, 3):
        house.send(room)
    wait_until(lambda: list(house.states[-1].queue) == [3, 2], 20, "the queue")
    house.wait_for_mission(3)
    rooms = [s.room_id for s in house.states if s.state == "driving"]
    assert [r for i, r in enumerate(rooms) if i == 0 or rooms[i - 1] != r] == [1, 3, 2]


def test_killed_in_mission_goes_on_after_respawn_with_one_mail(house):
    house.start_move_base()
    house.start_patrol()
    house.person = True
    house.send(2)
    wait_until(lambda: house.states[-1].state == "looking", 20, "the look")
    wait_until(lambda: any(a.delivered for a in house.alerts), 20, "the delivery")
    os.killpg(house.patrol.pid, signal.SIGKILL)
    house.patrol.wait()
    house.start_patrol(wait=False)
    last = house.wait_for_mission()
    assert last.last_verdict == "confirmed"
    assert len(house.mails()) == 1


def test_killed_right_after_the_notice_it_stays_confirmed(house):
    """What the patrol remembers is then older than the notice, and nobody may be in view any more."""
    house.start_move_base()
    house.start_patrol()
    house.send(2)
    memory = house.folder / "state" / "patrol.json"
    wait_until(lambda: memory.exists() and '"phase": "looking"' in memory.read_text(), 20, "the look")
    old = memory.read_bytes()
    house.person = True
    wait_until(lambda: any(a.delivered for a in house.alerts), 20, "the delivery")
    os.killpg(house.patrol.pid, signal.SIGKILL)
    house.patrol.wait()
    memory.write_bytes(old)
    house.person = False
    house.start_patrol(wait=False)
    assert house.wait_for_mission().last_verdict == "confirmed"
    assert len(house.mails()) == 1
    wait_until(lambda: "is on record: confirmed" in house.log(house.patrol), 20, "the record")
    (incident,) = [p for p in (house.folder / "state" / "incidents").iterdir() if p.is_dir()]
    assert any(p.name == "seen.jpg" for p in incident.iterdir())


def test_latched_trigger_makes_no_second_mission_after_respawn(house):
    house.start_move_base()
    house.start_patrol()
    command = ["rostopic", "pub", "/motion_trigger", "rosbot_patrol/EspTrigger", "{id: 1, move: true}"]
    sender = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    try:
        house.wait_for_mission()
        os.killpg(house.patrol.pid, signal.SIGKILL)
        house.patrol.wait()
        house.start_patrol()
        wait_until(lambda: "was taken before the restart" in house.log(house.patrol), 20, "the refusal")
        # "returning" where the kill came before the mission's end was on disk
        assert {s.state for s in house.states} <= {"starting", "returning", "idle"}
    finally:
        stop(sender)


def test_move_base_that_is_down_is_said_and_bounded(house):
    house.start_move_base()
    house.start_patrol(server_wait=8)
    stop(house.move_base, signal.SIGKILL)
    house.send(1)
    wait_until(lambda: "move_base" in house.states[-1].why, 15, "the word about move_base")
    house.start_move_base()
    assert house.wait_for_mission(seconds=40).last_verdict == "clear"


def test_unreachable_mail_server_loses_and_hangs_nothing(house):
    house.start_move_base()
    port = free_port()
    house.start_patrol(
        transport="smtp", email_to="owner@example.org", smtp_host="localhost", smtp_port=port, mail_retry=0.5
    )
    house.person = True
    house.send(2)
    assert house.wait_for_mission().last_verdict == "confirmed"
    assert f"the mail server localhost:{port} cannot be used" in house.log(house.patrol)
    assert len(list((house.folder / "state" / "outbox").glob("*.notice"))) == 1


@pytest.mark.parametrize("keep", [False, True])
def test_sigint_cancels_the_goal_and_stops_the_wheels(house, keep):
    house.start_move_base()
    house.start_patrol(keep_calls_at_end=keep)
    house.send(1)
    wait_until(lambda: any(house.twists), 20, "the turn")
    began = time.monotonic()
    os.killpg(house.patrol.pid, signal.SIGINT)
    house.patrol.wait(10)
    assert time.monotonic() - began < 5
    wait_until(lambda: house.twists[-1] == 0.0, 2, "the zero twist")
    assert "Traceback" not in house.log(house.patrol)
    kept = json.loads((house.folder / "state" / "patrol.json").read_text())
    assert (kept["memory"]["mission"] is not None) == keep  # it goes on at the next start


def test_rosnode_kill_and_respawn_goes_on(house):
    house.start_move_base()
    house.start_patrol()
    house.send(1)
    wait_until(lambda: any(house.twists), 20, "the turn")
    subprocess.run(["rosnode", "kill", "/patrolling_node"], capture_output=True, check=True)
    house.patrol.wait(10)
    assert house.twists[-1] == 0.0
    house.start_patrol(wait=False, detector_wait=10.0, detector_timeout=5.0)  # a busy machine is no silent detector
    state = house.wait_for_mission()
    assert state.last_verdict == "clear", state.why


@pytest.mark.parametrize(
    ("params", "said"),
    [
        ({"path_to_params": "/nowhere/rooms.yaml"}, "/nowhere/rooms.yaml: cannot be read: No such file"),
        ({"email_to": "a@b.org\nBcc: x@y.org"}, "email_to: has a line break"),
        ({"transport": "smtp"}, "email_to: expected a real address for smtp"),
        ({"spin_speed": "fast"}, "spin_speed: expected a number"),
        ({"smtp_password": "geheim"}, "smtp_password: a password may not stand on the parameter server"),
    ],
)
def test_bad_parameter_is_one_sentence_and_exit_1(house, params, said):
    house.start_patrol(wait=False, **params)
    assert house.patrol.wait(20) == 1
    assert said in house.log(house.patrol)
    assert "Traceback" not in house.log(house.patrol)


def test_the_mail_server_comes_back_and_gets_it_once(house):
    from smtp_server import SmtpServer

    port = free_port()
    mail = {"transport": "smtp", "email_to": "owner@example.org", "smtp_port": port, "mail_retry": 0.5}
    house.start_move_base()
    house.start_patrol(**mail)
    house.person = True
    house.send(2)
    assert house.wait_for_mission().last_verdict == "confirmed"
    os.killpg(house.patrol.pid, signal.SIGKILL)
    house.patrol.wait()
    with SmtpServer(port=port) as server:
        house.start_patrol(**mail)
        wait_until(lambda: server.mails, 20, "the mail")
        # the word on /patrol/alerts may be out before this subscriber is connected again: the log has it in any case
        wait_until(lambda: "delivered by smtp" in house.log(house.patrol), 20, "the word about it")
        time.sleep(1.0)
        assert len(server.mails) == 1
    assert not list((house.folder / "state" / "outbox").glob("*.notice"))
    assert "1 wait from before" in house.log(house.patrol)


def test_two_programs_share_an_outbox_and_one_takes_over(house):
    from diagnostic_msgs.msg import DiagnosticArray

    said = {}
    end = rospy.Subscriber(
        "/diagnostics", DiagnosticArray, lambda m: said.update({s.name: s.message for s in m.status})
    )
    house.ends.append(end)
    house.start_move_base()
    house.start_patrol(notify_verdicts=["clear"])
    same = {name: str(house.folder / place) for name, place in (("state_dir", "state"), ("maildir", "mail"))}
    rooms = str(ROOT / "params" / "room_points.yaml")
    command = ["rosrun", "rosbot_patrol", "sensor_watch"]
    watch = house._start(command, {"path_to_params": rooms, "transport": "maildir", "mail_interval": 0, **same})
    what = "sensor_watch: outbox"
    wait_until(lambda: "/patrolling_node (process" in said.get(what, ""), 20, "who delivers, and different parameters")
    house.send(1)
    wait_until(lambda: house.mails(), 40, "the mail of the verdict")
    assert house.mails()[0]["Subject"] == "rosbot patrol: room 1 (guest room): clear"
    os.killpg(house.patrol.pid, signal.SIGKILL)
    wait_until(lambda: said.get(what, "").endswith("/sensor_watch delivers"), 20, "the other")
    note = Notice(id="from-here", wall=time.time(), kind="incident", subject="s", text="t")
    Outbox(house.folder / "state" / "outbox").put(note)
    wait_until(lambda: len(house.mails()) == 2, 20, "the mail that another program put")
    wait_until(lambda: "notice from-here delivered by maildir" in house.log(watch), 20, "the word about it")
    assert said["sensor_watch: mail"].startswith("notices go to the Maildir")


def fill(path):
    with path.open("wb", buffering=0) as file:
        while True:
            file.write(bytes(4096))


def test_a_full_disk_is_said_the_patrol_goes_on_and_the_mail_comes_from_memory_once(house):
    """A file system for the node alone, filled to the last block before the trigger.

    It is too small for the room that incidents hold in reserve: that is let go of and taken again, and in the moment
    between a notice may rightly find its place.
    """
    from diagnostic_msgs.msg import DiagnosticArray

    state, errors = house.folder / "state", []
    state.mkdir()

    def hear(message):
        errors.extend(status.message for status in message.status if status.name == "patrolling_node: outbox")

    house.ends.append(rospy.Subscriber("/diagnostics", DiagnosticArray, hear))
    mount = f'mount -t tmpfs -o size=1m none {state} && exec "$@"'
    probe = subprocess.run(["unshare", "-rm", "sh", "-c", mount, "sh", "true"], capture_output=True, check=False)
    if probe.returncode:
        pytest.skip(f"no file system of its own can be made here: {probe.stderr.decode()}")
    house.start_move_base()
    house.start_patrol(inside=["unshare", "-rm", "sh", "-c", mount, "sh"])
    inside = Path(f"/proc/{house.patrol.pid}/root{state}")
    with pytest.raises(OSError, match="No space left"):
        fill(inside / "filler")
    house.person = True
    house.send(2)
    last = house.wait_for_mission()
    assert last.last_verdict == "confirmed"
    assert "cannot be written to" in house.log(house.patrol)
    assert any("the outbox cannot be written: [Errno 28]" in text for text in errors)

    def incidents():
        return [mail for mail in house.mails() if mail["X-Rosbot-Patrol-Incident"]]

    wait_until(incidents, 20, "the mail, which lies on another disk")
    (inside / "filler").unlink()
    wait_until(lambda: errors[-1].endswith("delivers"), 20, "that all is well")
    wait_until(lambda: list((inside / "outbox" / "sent").glob("*.notice")), 20, "the notice on the disk")
    assert len(incidents()) == 1


@pytest.mark.parametrize(("person", "verdict", "status"), [(True, "confirmed", 0), (False, "confirmed", 3)])
def test_the_narrator_tells_and_ends_with_the_mission(house, person, verdict, status):
    summary = house.folder / "summary.json"
    house.start_move_base()
    narrator = house._start(
        ["rosrun", "rosbot_patrol", "narrator"],
        {"exit_after_mission": True, "expect_verdict": verdict, "summary_file": str(summary), "time_limit": 60},
    )
    house.start_patrol()
    wait_until(lambda: "On guard." in house.log(narrator), 20, "the word")
    wait_until(lambda: house.trigger.get_num_connections() > 1, 20, "the narrator's subscription")
    house.person = person
    house.send(3)
    assert narrator.wait(60) == status
    told = [line.split("] ", 1)[1] for line in house.log(narrator).splitlines() if line.startswith("[ ")]
    room = "room 3 (west alcove)"
    ends = "confirmed" if person else "clear"
    steps = [
        "On guard.",
        "Motion sensor 3 calls.",
        f"Driving to {room}.",
        f"Arrived in {room}.",
        f"Turning once to look around in {room}.",
        f"Home again. Verdict for {room}: {ends}.",
    ]
    told_steps = [line for line in told if line in steps]
    assert sorted(told_steps[1:3]) == sorted(steps[1:3])  # of two topics: either may be heard first
    assert told_steps[:1] + told_steps[3:] == steps[:1] + steps[3:]
    assert any(line.startswith("INTRUDER: a person") for line in told) == person
    (mission,) = json.loads(summary.read_text())["missions"]
    assert mission["verdict"] == ends
    assert [Path(p).exists() for p in mission["mails"]] == [True] * person


def test_the_file_of_sensors_says_which_room_an_id_calls_to_and_a_silent_sensor_asks_for_a_look(house):
    from rosbot_patrol.msg import SensorEvent

    (house.folder / "sensors.yaml").write_text("sensors: [{id: 9, room: 2}, {id: 4, room: 4, enabled: false}]")
    events = rospy.Publisher("/sensors/events", SensorEvent, queue_size=10)
    house.start_move_base()
    house.start_patrol(sensors=str(house.folder / "sensors.yaml"))
    for unknown in (2, 4):
        house.send(unknown)
    wait_until(lambda: "has no sensor with id 2" in house.log(house.patrol), 20, "the refusal")
    wait_until(lambda: "enabled: false" in house.log(house.patrol), 20, "the other refusal")
    house.send(9)
    wait_until(lambda: house.states[-1].room_id == 2, 20, "the mission")
    wait_until(lambda: events.get_num_connections() > 0, 20, "the subscription")
    events.publish(SensorEvent(kind="silent", active=True, room=5))
    events.publish(SensorEvent(kind="look", active=True, id=9, room=3, text="sensor 9 is silent"))
    wait_until(lambda: list(house.states[-1].queue) == [3], 20, "the queue")
    house.wait_for_mission(1)
    events.unregister()


def test_a_bad_file_of_sensors_is_one_sentence(house):
    (house.folder / "sensors.yaml").write_text("sensors: [{id: 1, room: 1}, {id: 1, room: 2}]")
    house.start_patrol(wait=False, sensors=str(house.folder / "sensors.yaml"))
    assert house.patrol.wait(15) == 1
    assert "sensors[1]/id: is 1, which sensors[0] has already" in house.log(house.patrol)
