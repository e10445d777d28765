"""sensor_watch before a real master: real TCP, a real bridge, virtual ESP32s, mails in a Maildir."""

import http.server
import json
import mailbox
import re
import signal
import threading
import time
from email.header import decode_header, make_header
from pathlib import Path
from typing import ClassVar

import pytest
import yaml

pytest.importorskip("rospy", reason="needs ROS: source the workspace first")

from ros_processes import PATIENCE, free_port, wait_for

from rosbot_patrol.rosserial.device.poor_link import LinkQuality
from rosbot_patrol.rosserial.device.tcp_client import EspClient
from rosbot_patrol.rosserial.protocol.keys import add_key, new_key

ROOT = Path(__file__).resolve().parents[2]
TRIGGER = ["/motion_trigger", "rosbot_patrol/EspTrigger"]
EVENTS, STATES = ["/sensors/events", "rosbot_patrol/SensorEvent"], ["/sensors/states", "rosbot_patrol/SensorStates"]
DIAGNOSTICS = ["/diagnostics", "diagnostic_msgs/DiagnosticArray"]
SHOWN = {"path_to_params": "params/room_points.yaml", "motion_sensors": "config/house_sensors.yaml"}
FAST = {
    "silent_after": 2.0,
    "start_grace": 4.0,
    "steady_after": 0.5,
    "notice_after": 1.0,
    "well_after": 1.0,
    "notice_interval": 0.0,
    "mail_interval": 0.0,
}


def plain_text(mail):
    part = next(part for part in mail.walk() if part.get_content_type() == "text/plain")
    return part.get_payload(decode=True).decode()


def problems_of(sensor, said):
    """Of a sensor in what the probe heard on /sensors/states."""
    return {problem for s in yaml.safe_load(said["sensors"]) if s["id"] == sensor for problem in s["problems"]}


def plain(header):
    return " ".join(str(make_header(decode_header(header))).split())  # a long one is folded


class Watch:
    """The node, its file of sensors, and its mails."""

    def __init__(self, ros, folder, sensors, **params):
        self.ros, self.folder = ros, folder
        (folder / "sensors.yaml").write_text(json.dumps({"sensors": sensors}), encoding="utf-8")
        self.params = {
            "path_to_params": str(ROOT / "params" / "room_points.yaml"),
            "sensors": str(folder / "sensors.yaml") if sensors else "",
            "state_dir": str(folder / "state"),
            "maildir": str(folder / "mail"),
            "transport": "maildir",
            **FAST,
            **params,
        }
        self.start()

    def start(self):
        arguments = [f"_{key}:={json.dumps(value)}" for key, value in self.params.items()]
        self.node = self.ros.node("sensor_watch", *arguments)

    def mails(self):
        place = self.folder / "mail"
        box = mailbox.Maildir(place, create=False) if (place / "cur").exists() else []
        return sorted(box, key=lambda mail: mail["Message-ID"])

    def mail(self, subject, seconds=12.0):
        """The mail of that subject, once it is there."""
        return wait_for(
            lambda: [m for m in self.mails() if plain(m["Subject"]) == f"rosbot patrol: {subject}"], seconds, subject
        )[0]


def bridge(ros, port, *arguments, name="esp_client1"):
    node = ros.node("serial_node.py", "_port:=tcp", f"_tcp_port:={port}", f"__name:={name}", *arguments)
    node.says("waiting for sensors")
    return node


def event(kind, sensor_id, active):
    return lambda said: (said.get("kind"), said.get("id"), said.get("active")) == (kind, sensor_id, active)


def test_a_sensor_falls_silent_and_comes_back_all_the_way_to_the_mail(ros, tmp_path):
    port, probe = free_port(), ros.probe()
    for topic in (EVENTS, STATES, DIAGNOSTICS):
        probe.tell(subscribe=topic)
    watch = Watch(ros, tmp_path, [{"id": 3, "room": 5, "name": "Haustür"}, {"id": 4, "room": 4}])
    watch.node.says("watching 2 sensors of")
    keys = {i: new_key() for i in (3, 4)}
    for i, key in keys.items():
        add_key(tmp_path / "keys.yaml", i, key)
    bridge(ros, port, f"_key_file:={tmp_path}/keys.yaml", name="with_keys")  # parameters outlive their node
    sensors = [EspClient("127.0.0.1", port, i, key=key).start() for i, key in keys.items()]
    probe.expect(lambda said: said.get("text") == "2 of 2 sensors are well" and str(said).count("/with_keys") == 3)
    sensors[0].set_link(LinkQuality(loss=1.0))  # says nothing more on a link that stays open
    silent = probe.expect(event("silent", 3, True))
    assert (silent["room"], silent["name"], silent["bridge"]) == (5, "Haustür", "/with_keys")
    assert silent["text"].startswith('sensor 3 "Haustür" in room 5 (corridor hall) is silent')
    probe.expect(lambda said: "sensor_watch: sensor 3 Haust" in str(said.get("status")) and "not: 3" in str(said))
    mail = watch.mail('sensor 3 "Haustür" in room 5 (corridor hall) is silent')
    text = plain_text(mail)
    assert "Last heard 20" in text
    assert "What to do: see that it has power" in text
    assert "1 of 2 motion sensors are well." in text
    sensors[0].set_link(LinkQuality())
    probe.expect(event("silent", 3, False))
    watch.mail('sensor 3 "Haustür" in room 5 (corridor hall) is well again')
    shown = ros.node("sensors")
    assert shown.popen.wait(PATIENCE) == 0
    line = r'^3 +5 corridor hall "Haustür" +ok +\d s ago +never +0 +127\.0\.0\.1:\d+ \(key\)$'
    assert re.search(line, shown.output, re.M), shown.output
    assert len(watch.mails()) == 2
    for sensor in sensors:
        sensor.stop()


def test_a_bridge_is_killed_and_its_sensors_are_told_as_one(ros, tmp_path):
    port, probe = free_port(), ros.probe()
    probe.tell(subscribe=EVENTS)
    watch = Watch(ros, tmp_path, [{"id": 1, "room": 1}, {"id": 2, "room": 2}], bridge_after=2.0)
    first = bridge(ros, port)
    sensors = [EspClient("127.0.0.1", port, i).start() for i in (1, 2)]
    wait_for(lambda: all(s.connected for s in sensors))
    time.sleep(1.5)
    first.stop(signal.SIGKILL)
    gone = probe.expect(lambda said: said.get("kind") == "bridge_gone" and said.get("active"))
    assert gone["text"] == "bridge /esp_client1 has gone: nothing is heard of it"
    mail = plain_text(watch.mail("bridge /esp_client1 has gone"))
    assert "and with it of sensor 1 in room 1 (guest room), sensor 2 in room 2" in mail
    bridge(ros, port)
    for i in (1, 2):
        probe.expect(event("silent", i, False), 15.0)
    assert len(watch.mails()) == 1  # its well-being takes longer to be believed
    for sensor in sensors:
        sensor.stop()


@pytest.mark.long
def test_patrol_and_watch_tell_of_each_other_when_one_hangs(ros, tmp_path):
    """A hung process cannot say so itself; it is stopped here, and goes on."""
    probe = ros.probe()
    for topic in (EVENTS, DIAGNOSTICS):
        probe.tell(subscribe=topic)
    (tmp_path / "state").mkdir(mode=0o755)
    watch = Watch(ros, tmp_path, [{"id": 1, "room": 1}], patrol_after=3.0, start_grace=60.0)
    watch.node.says("of the files and folders in")
    patrol = ros.node(
        "patrol_robot",
        "__name:=patrolling_node",
        f"_path_to_params:={ROOT / SHOWN['path_to_params']}",
        f"_state_dir:={tmp_path / 'state'}",  # one outbox, and the watch, which began before, delivers
        f"_maildir:={tmp_path / 'mail'}",
        "_transport:=maildir",
        "_sensor_watch_after:=6.0",
        "_sensor_watch_notice_after:=1.0",
    )
    probe.expect(lambda said: "sensor_watch: patrol" in str(said) and "is heard" in str(said), 20.0)
    patrol.popen.send_signal(signal.SIGSTOP)
    gone = probe.expect(lambda said: said.get("kind") == "patrol_gone" and said.get("active"), 15.0)
    assert gone["bridge"] == "/patrolling_node"
    mail = plain_text(watch.mail("the patrol (patrolling_node) has gone, or hangs"))
    assert "motion is not answered" in mail
    assert "What to do: " in mail
    patrol.popen.send_signal(signal.SIGCONT)
    probe.expect(lambda said: said.get("kind") == "patrol_gone" and said.get("active") is False, 15.0)
    watch.mail("the patrol (patrolling_node) is well again")
    watch.node.popen.send_signal(signal.SIGSTOP)
    probe.expect(
        lambda said: "patrolling_node: sensor_watch" in str(said) and "it has gone, or hangs" in str(said), 20.0
    )
    mail = plain_text(watch.mail("the sensors' watch", 40.0))
    assert "program sensor_watch has gone, or hangs: nobody tells of motion sensors that fail" in mail
    patrol.says("/sensor_watch (process")  # "..., which delivered the notices, gave no sign of life": taking over
    watch.node.popen.send_signal(signal.SIGCONT)
    watch.mail("the sensors' watch again well", 30.0)
    watch.node.says("this program hung: /patrolling_node")
    places = (tmp_path / "state", *(tmp_path / "state").rglob("*"), *(tmp_path / "mail").rglob("*"))
    assert [str(path) for path in places if path.stat().st_mode & 0o077] == []


def test_who_else_speaks(ros, tmp_path):
    """An id that is not in the file, a second peer with a sensor's id on another bridge, a stuck output, garbage."""
    ports, probe = (free_port(), free_port()), ros.probe()
    for topic in (EVENTS, STATES, ["/house_markers/markers", "visualization_msgs/MarkerArray"]):
        probe.tell(subscribe=topic)
    probe.tell(advertise=["/sensors/links", "rosbot_patrol/SensorLinks"])
    watch = Watch(ros, tmp_path, [{"id": 1, "room": 1}], notice_after=60.0)
    for i, port in enumerate(ports):
        bridge(ros, port, name=f"esp_client{i + 1}")
    ros.node("house_markers", *(f"_{key}:={ROOT}/{file}" for key, file in SHOWN.items()))
    honest = EspClient("127.0.0.1", ports[0], 1, stuck_after=1.0).start()
    others = [EspClient("127.0.0.1", ports[1], i).start() for i in (1, 9)]
    unknown = probe.expect(event("unknown_id", 9, True))
    assert unknown["text"].endswith("sensors.yaml has no sensor with id 9")
    honest.set_motion(True)
    assert "its output stays high" in probe.expect(event("stuck_on", 1, True))["text"]
    probe.expect(lambda said: "g: 0.875" in str(said.get("markers")))  # yellow in rviz
    double = probe.expect(event("duplicate_id", 1, True), 15.0)
    assert "is reported by two at a time: 127.0.0.1:" in double["text"]
    for link in ({"id": 1, "peer": "x" * 3000, "heard": -1.0}, {"id": 255, "heard": 1e30, "clock_known": True}):
        probe.tell(publish=["/sensors/links", {"bridge": "", "links": [link] * 300}])
    probe.expect(
        lambda said: "/esp_client2" in said.get("bridges", "") and problems_of(1, said) >= {"duplicate_id", "stuck_on"}
    )
    assert watch.node.popen.poll() is None
    assert "Traceback" not in watch.node.output
    for sensor in (honest, *others):
        sensor.stop()


def test_a_plain_publisher_is_watched_too_and_a_silent_one_asks_for_a_look(ros, tmp_path):
    probe = ros.probe()
    for topic in (EVENTS, STATES):
        probe.tell(subscribe=topic)
    probe.tell(advertise=TRIGGER)
    watch = Watch(ros, tmp_path, [], patrol_silent_sensors=True, look_after=2.0, notice_after=60.0)
    watch.node.says("watching whatever sensor is heard")
    probe.tell(publish=[TRIGGER[0], {"id": 2, "move": True}])  # a test by hand: nobody waits for its heartbeat
    for _ in range(60):
        probe.tell(publish=[TRIGGER[0], {"id": 6, "move": False}])
        time.sleep(0.05)
    look = probe.expect(event("look", 6, True))
    assert (look["room"], look["room_name"]) == (6, "tilted hall")
    assert not probe.heard(kind="silent", id=2)


def test_a_bad_file_is_one_sentence(ros, tmp_path):
    watch = Watch(ros, tmp_path, [{"id": 1, "room": 12}])
    watch.node.says("sensors[0]/room: there is no room 12: ")
    assert watch.node.popen.wait(PATIENCE) == 1
    assert "Traceback" not in watch.node.output
    watch = Watch(ros, tmp_path, [{"id": 1, "room": 2}], motion_sensors=str(ROOT / "config" / "house_sensors.yaml"))
    watch.node.says("sensor 1 watches room 2, and room 1 in")
    assert watch.node.popen.wait(PATIENCE) == 1


@pytest.mark.long
def test_what_was_told_is_not_told_again_by_a_watch_that_was_killed(sim_ros, tmp_path):
    """Nor is it lost where the disk takes nothing. Simulated time that stands still (no /clock) changes nothing."""
    ros = sim_ros
    probe = ros.probe()
    probe.tell(subscribe=EVENTS)
    watch = Watch(ros, tmp_path, [{"id": 7, "room": 7}], start_grace=2.0)
    watch.node.says("watching 1 sensor")
    outbox = tmp_path / "state" / "outbox"
    outbox.rename(tmp_path / "aside")
    outbox.write_text("the disk takes nothing")
    watch.node.says("it is sent from memory")
    outbox.unlink()
    (tmp_path / "aside").rename(outbox)
    watch.mail("sensor 7 in room 7 (north-east hall) is silent")
    wait_for((tmp_path / "state" / "sensors.json").exists)
    watch.node.stop(signal.SIGKILL)
    before = len(probe.heard(kind="silent"))
    watch.start()
    wait_for(lambda: len(probe.heard(kind="silent")) > before)
    time.sleep(2.5)
    assert len(watch.mails()) == 1
    assert watch.node.stop() == 0


def test_people_at_home_are_no_mail_and_a_sensor_that_is_stuck_is_told_when_they_have_left(ros, tmp_path):
    probe, port = ros.probe(), free_port()
    probe.tell(subscribe=EVENTS)
    probe.tell(advertise=["/patrol/arming", "rosbot_patrol/Arming"])
    watch = Watch(ros, tmp_path, [{"id": 1, "room": 1}, {"id": 2, "room": 2}], motion_pause=2.0)
    watch.node.says("watching 2 sensors")
    bridge(ros, port)
    sensors = [EspClient("127.0.0.1", port, i, stuck_after=1.0).start() for i in (1, 2)]
    probe.tell(linked="/patrol/arming")
    probe.tell(publish=["/patrol/arming", {"mode": "armed_home", "all_rooms": False, "rooms": [2]}])
    time.sleep(0.5)  # the message is on its way
    for sensor in sensors:
        sensor.set_motion(True)
    for i in (1, 2):
        probe.expect(event("stuck_on", i, True))
    title = "sensor {0} in room {0} ({1}) reports motion without an end"
    watch.mail(title.format(2, "square room behind the door"))
    time.sleep(5.0)
    assert not [mail for mail in watch.mails() if title.format(1, "guest room") in plain(mail["Subject"])]
    probe.tell(publish=["/patrol/arming", {"mode": "armed_away", "all_rooms": True}])
    watch.mail(title.format(1, "guest room"))
    for sensor in sensors:
        sensor.stop()


def test_a_second_driver_and_other_settings_are_told(ros, tmp_path):
    probe, thief = ros.probe(), ros.probe()
    probe.tell(subscribe=EVENTS)
    watch = Watch(ros, tmp_path, [{"id": 1, "room": 1}], start_grace=60.0)
    watch.node.says("watching 1 sensor")
    probe.tell(advertise=["/cmd_vel", "geometry_msgs/Twist"])
    thief.tell(advertise=["/cmd_vel", "geometry_msgs/Twist"])
    said = probe.expect(lambda heard: heard.get("kind") == "second_driver" and heard.get("active"))
    assert "has 2 publishers where one alone may drive the robot" in said["text"]
    text = plain_text(watch.mail("topic /cmd_vel has a second publisher"))
    assert "What to do: where you drive with a program of your own, end it." in text
    thief.process.stop()
    probe.expect(lambda heard: heard.get("kind") == "second_driver" and not heard.get("active"))
    ros.set_param("/sensor_watch/email_to", "thief@example.org")
    said = probe.expect(lambda heard: heard.get("kind") == "settings_changed" and heard.get("active"))
    assert "email_to changed" in said["text"]
    assert "thief@" not in said["text"]
    ros.forget("/sensor_watch")


def test_hosts_that_make_no_sense_are_refused(ros, tmp_path):
    watch = Watch(ros, tmp_path, [{"id": 1, "room": 1}], graph_hosts="pc 10.0.0.0/99")
    watch.node.says("/sensor_watch/graph_hosts: '10.0.0.0/99' is no name, address or network")
    assert watch.node.stop(None) == 1
    ros.forget("/sensor_watch")


class Outside(http.server.BaseHTTPRequestHandler):
    """A service that waits for heartbeats."""

    calls: ClassVar[list[tuple[str, str]]] = []
    answer = 200

    def do_GET(self):
        self.calls.append((self.command, self.path))
        self.send_response(self.answer)
        self.end_headers()

    def do_POST(self):
        self.do_GET()

    def log_message(self, *_):
        pass


@pytest.mark.long
def test_a_heartbeat_is_sent_while_all_is_well_and_only_then(ros, tmp_path):
    server = http.server.HTTPServer(("127.0.0.1", 0), Outside)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    url = f"http://127.0.0.1:{server.server_port}/api/webhook/secret"
    probe = ros.probe()
    for topic in (EVENTS, DIAGNOSTICS):
        probe.tell(subscribe=topic)
    probe.tell(advertise=["/patrol/alive", "std_msgs/Empty"])
    watch = Watch(ros, tmp_path, [], heartbeat_url=url, heartbeat_period=1.0, patrol_after=3.0)
    watch.node.says("watching")
    probe.tell(linked="/patrol/alive")
    assert Outside.calls == []  # the patrol was not heard yet
    until = time.monotonic() + 4.0
    while time.monotonic() < until:
        probe.tell(publish=["/patrol/alive", {}])
        time.sleep(0.5)
    wait_for(lambda: len(Outside.calls) >= 2, what="two heartbeats")
    assert set(Outside.calls) == {("POST", "/api/webhook/secret")}
    probe.expect(lambda said: "it arrives at 127.0.0.1" in str(said.get("status")))
    probe.expect(lambda said: said.get("kind") == "patrol_gone" and said.get("active"))
    time.sleep(6.0)
    count = len(Outside.calls)
    time.sleep(2.5)
    assert len(Outside.calls) == count
    Outside.answer = 404
    for _ in range(12):
        probe.tell(publish=["/patrol/alive", {}])
        time.sleep(0.5)
    watch.node.says("the heartbeat does not arrive: 127.0.0.1 answers 404 Not Found")
    assert "secret" not in watch.node.output
    server.shutdown()
    server.server_close()
    ros.forget("/sensor_watch")
