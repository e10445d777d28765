"""A state folder that cannot be written: the alarm leaves from memory, the owner hears of the disk, the nodes live."""

import json
import subprocess
import threading
from contextlib import suppress
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import pytest
from patrol_house import ROOT, stop, wait_until

rospy = pytest.importorskip("rospy", reason="needs ROS: source the workspace first")

FAST = {"silent_after": 2.0, "start_grace": 1.0, "steady_after": 0.5, "notice_after": 1.0, "notice_interval": 0.0}


class Webhook:
    """A web address that takes everything."""

    def __init__(self):
        self.taken = []
        outer = self

        class Handler(BaseHTTPRequestHandler):
            def do_POST(self):
                outer.taken.append(json.loads(self.rfile.read(int(self.headers["Content-Length"]))))
                self.send_response(204)
                self.end_headers()

            def log_message(self, *_):
                pass

        self.server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        threading.Thread(target=self.server.serve_forever, daemon=True).start()

    def of(self, kind, word=""):
        return [told for told in self.taken if told["kind"] == kind and word in told["subject"]]

    def channels(self, folder):
        """A file of channels with this one."""
        path = folder / "channels.yaml"
        phone = {"type": "webhook", "url": f"http://127.0.0.1:{self.server.server_port}/", "interval": 0}
        path.write_text(json.dumps({"channels": {"phone": phone}}))
        return str(path)


@pytest.fixture
def phone():
    webhook = Webhook()
    yield webhook
    webhook.server.shutdown()
    webhook.server.server_close()


@pytest.fixture
def disk(tmp_path):
    """The state folder as a disk of its own."""
    folder = tmp_path / "state"
    folder.mkdir()
    if subprocess.run(["mount", "-t", "tmpfs", "-o", "size=8m", "none", folder], capture_output=True).returncode:
        pytest.skip("needs the right to mount a disk")
    yield folder
    while subprocess.run(["umount", "-l", folder], capture_output=True).returncode == 0:
        pass


def make_read_only(folder):
    """As seen by whoever opens a file there from now on; the disk itself is busy, so that it cannot be remounted."""
    subprocess.run(["mount", "--bind", folder, folder], check=True)
    subprocess.run(["mount", "-o", "remount,bind,ro", folder], check=True)


def listen(house):
    """The level of each part on /diagnostics, as it comes."""
    from diagnostic_msgs.msg import DiagnosticArray

    levels = {}

    def hear(message):
        for status in message.status:
            levels.setdefault(status.name, []).append(status.level)

    house.ends.append(rospy.Subscriber("/diagnostics", DiagnosticArray, hear))
    return levels


def test_a_disk_that_becomes_read_only_in_mid_run_silences_nothing(house, disk, phone):
    levels = listen(house)
    house.start_move_base()
    house.start_patrol(channels=phone.channels(house.folder), maildir=str(disk / "mail"), mail_retry=0.5)
    make_read_only(disk)
    house.person = True
    house.send(2)
    wait_until(lambda: phone.of("incident"), 30, "the notice")
    assert house.wait_for_mission().last_verdict == "confirmed"
    (told,) = phone.of("incident")
    assert told["picture"]["base64"]
    wait_until(lambda: 2 in levels.get("patrolling_node: outbox", []), 10, "an error on /diagnostics")
    wait_until(lambda: phone.of("fault", "disk takes nothing"), 30, "the word about the disk")
    subprocess.run(["umount", "-l", disk], check=True)  # the disk is back
    wait_until(lambda: phone.of("fault", "disk works again"), 30, "the word that it is back")
    wait_until(lambda: list((disk / "outbox" / "sent").glob(f"*-{told['id']}.notice")), 30, "the notice on the disk")
    wait_until(lambda: levels["patrolling_node: outbox"][-1] == 0, 10, "that all is well")
    assert len(phone.of("incident")) == 1
    assert [len(phone.of("fault", word)) for word in ("disk takes nothing", "disk works again")] == [1, 1]
    assert len(list((disk / "mail" / "new").glob(f"{told['id']}.*"))) == 1  # the Maildir lies on the same disk
    stop(house.patrol)
    assert house.incident(told["id"]).verdict == "confirmed"


@pytest.mark.parametrize("way", ["read-only", pytest.param("a file", marks=pytest.mark.long)])
def test_a_state_folder_that_cannot_be_written_at_the_start_is_said_and_the_guard_guards(house, disk, phone, way):
    levels = listen(house)
    state = disk if way == "read-only" else house.folder / "file" / "state"
    if way == "read-only":
        subprocess.run(["mount", "-o", "remount,ro", disk], check=True)
    else:
        (house.folder / "file").write_text("")
    house.start_move_base()
    places = {"state_dir": str(state), "channels": phone.channels(house.folder)}
    house.start_patrol(**places)
    house.person = True
    house.send(2)
    wait_until(lambda: phone.of("incident"), 30, "the notice")
    assert house.wait_for_mission().last_verdict == "confirmed"
    assert 2 in levels["patrolling_node: outbox"]
    assert "Traceback" not in house.log(house.patrol)
    if way == "read-only":
        subprocess.run(["mount", "-o", "remount,rw", disk], check=True)
    else:
        (house.folder / "file").unlink()
    name = phone.of("incident")[0]["id"]
    wait_until(lambda: list((state / "outbox" / "sent").glob(f"*-{name}.notice")), 30, "the notice on the disk")
    wait_until(lambda: (state / "patrol.json").exists(), 30, "the patrol's memory")
    assert len(phone.of("incident")) == 1
    assert len(house.mails()) >= 1  # the Maildir lies elsewhere


def test_the_emergency_stop_and_the_mode_are_kept_once_the_disk_is_back(house, disk, phone):
    from rosbot_patrol.srv import Arm
    from std_srvs.srv import SetBool

    subprocess.run(["mount", "-o", "remount,ro", disk], check=True)
    house.start_move_base()
    house.start_patrol(channels=phone.channels(house.folder))
    said = rospy.ServiceProxy("/patrol/emergency_stop", SetBool)(True)
    assert "does not outlive a restart" in said.message
    rospy.ServiceProxy("/patrol/arm", Arm)("disarmed")
    subprocess.run(["mount", "-o", "remount,rw", disk], check=True)
    wait_until(lambda: (disk / "stop.json").exists() and (disk / "arming.json").exists(), 20, "both files")
    assert json.loads((disk / "stop.json").read_text()) == {"held_by": ["service"]}
    assert json.loads((disk / "arming.json").read_text())["mode"] == "disarmed"


@pytest.mark.long
def test_sensor_watch_starts_and_tells_without_a_disk(house, phone):
    (house.folder / "file").write_text("")
    levels = listen(house)
    params = {
        "path_to_params": str(ROOT / "params" / "room_points.yaml"),
        "state_dir": str(house.folder / "file" / "s"),
    }
    (house.folder / "sensors.yaml").write_text(json.dumps({"sensors": [{"id": 3, "room": 5}, {"id": 4, "room": 4}]}))
    params |= {"sensors": str(house.folder / "sensors.yaml"), "transport": "maildir"}
    params |= {"maildir": str(house.folder / "mail"), "channels": phone.channels(house.folder), **FAST}
    watch = house._start(["rosrun", "rosbot_patrol", "sensor_watch"], params)
    wait_until(lambda: phone.of("sensor"), 40, "the word about silent sensors")
    wait_until(lambda: phone.of("fault", "disk takes nothing"), 40, "the word about the disk")
    assert 2 in levels["sensor_watch: outbox"]
    assert watch.poll() is None
    (house.folder / "file").unlink()
    wait_until(lambda: list((house.folder / "file" / "s" / "outbox" / "sent").glob("*sensors*")), 30, "the notice")
    wait_until(lambda: (house.folder / "file" / "s" / "sensors.json").exists(), 30, "what was told")
    assert len(phone.of("sensor")) == 1
    assert "Traceback" not in house.log(watch)


def test_calls_that_were_emptied_are_told(house, phone):
    from rosbot_patrol.patrol.calls.journal import Journal

    state = house.folder / "state"
    journal = Journal(state / "calls.jsonl", 0)
    for room in (2, 3):
        journal.add(room, 1.0)
    (state / "calls.jsonl").write_bytes(b"")
    house.start_move_base()
    house.start_patrol(channels=phone.channels(house.folder))
    wait_until(lambda: phone.of("fault", "calls lost"), 20, "the word about it")
    assert "2 calls of motion sensors" in phone.of("fault", "calls lost")[0]["text"]


def test_a_damaged_notice_is_made_again_of_its_record(house, phone):
    """Confirmed and written while no channel takes anything; damaged while the program is down."""
    house.start_move_base()
    phone.server.shutdown()
    phone.server.server_close()
    place = {"channels": phone.channels(house.folder), "maildir": str(house.folder / "file" / "mail")}
    (house.folder / "file").write_text("")
    house.start_patrol(**place)
    house.person = True
    house.send(2)
    assert house.wait_for_mission().last_verdict == "confirmed"
    stop(house.patrol)
    (waiting,) = (house.folder / "state" / "outbox").glob("*.notice")
    data = waiting.read_bytes()
    waiting.write_bytes(data[: len(data) // 2])
    with suppress(FileNotFoundError):
        (house.folder / "file").unlink()
    house.person = False
    house.start_patrol(**place)
    wait_until(lambda: list((house.folder / "file" / "mail" / "new").glob("*")), 20, "the mail")
    (mail,) = (house.folder / "file" / "mail" / "new").glob("*")
    text = mail.read_text()
    assert "Person seen " in text
    assert "image/jpeg" in text
