"""Bad input: one clear sentence that says what and where, and nothing lost or hung. Real processes, real TCP.

| bad input                      | shown by                                                                            |
|--------------------------------|-------------------------------------------------------------------------------------|
| a room that does not exist     | here, from a real sensor; test_patrol_node: test_unknown_room_is_refused...         |
| points file, key missing       | here; every key: test/unit/patrol/test_rooms                                        |
| points file, broken yaml       | here; file not there: test_patrol_node: test_bad_parameter_is_one_sentence...       |
| weights file missing           | here, for the shipped network; test_darknet_node: test_bad_start_is_a_sentence      |
| weights file cut short, foreign | here, with both sizes; test_darknet_node: test_bad_start_is_a_sentence             |
| map that is not there, cut     | here; picture gone, key missing, broken yaml: test_map_nodes: test_a_broken_map...  |
| serial_node on a taken port    | here; test_serial_node: test_taken_port_is_one_sentence_and_exit_1                  |
| garbage on the sensor port     | here, as a flood; wrong topics and types: test_serial_node: test_strangers_get...   |
| mail server that is down       | here, for a mail that waits; test_patrol_node: test_unreachable_mail_server...      |
| mail server that says nothing  | here                                                                                |
| mail addresses that are refused | here, of three: one put off, one unknown; test_recipients                          |
| world, sensors, configuration  | here; launch arguments: test_launch_files                                           |
| move_base: parameters, plug-ins | here; every parameter: test/unit/{costmap,planning}, test_params                   |
| goals: NaN, frame, quaternion, wall, off the map | test_move_base_actions                                            |
"""

import random
import socket
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("rospy", reason="needs ROS: source the workspace first")

from ros_processes import Process, free_port, wait_for

from rosbot_patrol.alerts.outbox.incident_notices import incident_notice
from rosbot_patrol.alerts.outbox.outbox import Outbox
from rosbot_patrol.alerts.records.incident import Incident
from rosbot_patrol.detection.darknet.cfg import read_cfg
from rosbot_patrol.detection.darknet.random_weights import random_weights
from rosbot_patrol.detection.darknet.weights import format_weights
from rosbot_patrol.grid import Grid, GridInfo
from rosbot_patrol.maps.map_io import write_map
from rosbot_patrol.rosserial.device.tcp_client import EspClient

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
ROOMS = ROOT / "params" / "room_points.yaml"
TRIGGER = ["/motion_trigger", "rosbot_patrol/EspTrigger"]
STATE = ["/patrol/state", "rosbot_patrol/PatrolState"]


_names = (f"tried{i}" for i in range(1000))


def start(ros, program, *arguments, **params):
    """A node under a name of its own, as parameters stay with the master."""
    given = [f"_{key.replace('__', '/')}:={value}" for key, value in params.items()]
    return ros.node(program, *arguments, f"__name:={next(_names)}", *given)


def assert_refused(node, said):
    """It ends by itself with exit 1 and says so in exactly one line."""
    wait_for(lambda: node.popen.poll() is not None, 40.0, f"the end of the program, for '{said}'")
    time.sleep(0.1)
    complaints = [line for line in node.lines if "FATAL" in line or "ERROR" in line]
    assert len(complaints) == 1, node.output
    assert said in complaints[0]
    assert node.popen.returncode == 1
    assert "Traceback" not in node.output


def start_patrol(ros, folder, **params):
    """patrol_robot with a base that drives, without camera and detector, and a probe that hears its state."""
    base = Process([sys.executable, str(HERE / "move_base_like.py")], ros.env)
    ros.processes.append(base)
    probe = ros.probe()
    probe.tell(subscribe=STATE, advertise=TRIGGER)
    given = {"path_to_params": ROOMS, "transport": "maildir", "maildir": folder / "mail"} | params
    patrol = start(
        ros, "patrol_robot", state_dir=folder / "state", image_topic="''", detector_wait=0.2, spin_speed=2.5, **given
    )
    probe.expect(lambda said: said.get("state") == "idle", 40.0)
    return patrol, probe


def drives_to(probe, room):
    return probe.expect(lambda said: said.get("state") == "driving" and said.get("room_id") == room, 20.0)


def start_bridge(ros, port):
    bridge = start(ros, "serial_node.py", port="tcp", tcp_port=port)
    bridge.says(f"waiting for sensors on TCP port {port}", 30.0)
    return bridge


@pytest.fixture
def sensors():
    """Start sensors by id and port; they end with the test."""
    started = []

    def begin(port, sensor_id):
        started.append(EspClient("localhost", port, sensor_id).start())
        return started[-1]

    yield begin
    for sensor in started:
        sensor.stop()


def test_a_sensor_of_a_room_that_does_not_exist(ros, sensors, tmp_path):
    port = free_port()
    start_bridge(ros, port)
    patrol, probe = start_patrol(ros, tmp_path)
    stray, honest = sensors(port, 99), sensors(port, 1)
    assert stray.wait_connected(15.0)
    assert honest.wait_connected(15.0)
    for _ in range(20):  # a sensor in a loop
        stray.trigger()
    sentence = f"motion trigger refused: there is no room 99: {ROOMS} has the rooms 0 to 7"
    patrol.says(sentence, 10.0)
    honest.trigger()
    drives_to(probe, 1)
    assert patrol.output.count(sentence) == 1
    assert not probe.heard(state="driving", room_id=99)
    assert patrol.popen.poll() is None


HOME = "room0: {name: base, x: 0, y: 0, angle: 0}"


@pytest.mark.parametrize(
    "cases",
    [
        pytest.param(
            {
                f"rooms: {{{HOME}}}\n": "rooms_num: is missing, expected a whole number",
                f"rooms_num: 2\nrooms: {{{HOME}}}\n": "rooms_num: is 2, expected exactly room0 to room1 under rooms: "
                "room1 not listed",
                f"rooms_num: 2\nrooms: {{{HOME}, room1: {{name: hall, x: 1, angle: 0}}}}\n": "rooms/room1/y: is "
                "missing, expected a number [m]",
                f"rooms_num: 2\nrooms: {{{HOME}, room1: {{name: hall, x: 1, y: far, angle: 0}}}}\n": "rooms/room1/y: "
                "expected a number [m], got 'far'",
            },
            id="missing-key",
        ),
        pytest.param(
            {
                f"rooms_num: 1\nrooms: {{{HOME}\n": "is no valid yaml at line 3, column 1: expected ',' or '}'",
                f"rooms_num: 1\nrooms: {{{HOME}, {HOME}}}\n": "is no valid yaml at line 2, column",
                "": "expected the keys rooms_num and rooms, got 'None'",
                "rooms_num: caf\udce9\n": "is no text in UTF-8",
            },
            id="broken-yaml",
        ),
    ],
)
def test_a_points_file_that_is_wrong(ros, tmp_path, cases):
    started = []
    for i, (text, said) in enumerate(cases.items()):
        path = tmp_path / f"rooms{i}.yaml"
        path.write_bytes(text.encode("utf-8", "surrogateescape"))
        node = start(ros, "patrol_robot", path_to_params=path, state_dir=tmp_path, transport="maildir")
        started.append((node, f"{path}: {said}"))
    for node, said in started:
        assert_refused(node, said)


def test_weights_that_are_missing_or_of_the_wrong_size(ros, tmp_path):
    cfg = ROOT / "models" / "house.cfg"
    spec = read_cfg(str(cfg))
    good = format_weights(spec, random_weights(spec, np.random.default_rng(0)))
    half = len(good) // 2
    files = {
        "cut": (good[:half], f" is cut short: it has {half} bytes, {cfg} needs {len(good)}"),
        "empty": (b"", f": has 0 bytes, {cfg} needs {len(good)}"),
        "foreign": (good + bytes(8), f" is too long, it belongs to another network: it has {len(good) + 8} bytes"),
        "damaged": (good[:-4] + b"\xff" * 4, f": the number at byte {len(good) - 4} is not finite"),
        "missing": (None, f" is not there: put the file of {len(good):,} bytes that goes with {cfg} there"),
    }
    started = []
    for name, (data, said) in files.items():
        path = tmp_path / f"{name}.weights"
        if data is not None:
            path.write_bytes(data)
        network = {
            "config_path": ROOT / "models",
            "weights_path": tmp_path,
            "yolo_model__config_file__name": "house.cfg",
            "yolo_model__weight_file__name": path.name,
            "yolo_model__detection_classes__names": "[person, fire hydrant]",
        }
        started.append((start(ros, "darknet_ros", **network), f"{path}{said}"))
    for node, said in started:
        assert_refused(node, said)


def test_a_map_that_is_not_there_or_cut_short(ros, tmp_path):
    info = GridInfo(resolution=0.05, width=30, height=20, origin_x=0.0, origin_y=0.0)
    write_map(str(tmp_path / "house"), Grid(info, np.zeros(info.shape, np.int8)))
    write_map(str(tmp_path / "cut"), Grid(info, np.zeros(info.shape, np.int8)))
    picture = tmp_path / "cut.pgm"
    picture.write_bytes(picture.read_bytes()[:-100])
    cut = f"{picture}: the picture is cut short: 500 bytes of pixels, expected 600"
    gone = f"{tmp_path / 'gone.yaml'}: the map's yaml cannot be read: No such file or directory"
    refused = [start(ros, "map_server", str(tmp_path / name)) for name in ("cut.yaml", "gone.yaml")]
    for node, said in zip(refused, (cut, gone), strict=True):
        assert_refused(node, said)

    server = start(ros, "map_server", str(tmp_path / "house.yaml"))
    server.says("Read a 30 X 20 map", 20.0)
    probe = ros.probe()
    probe.tell(call=["/change_map", "nav_msgs/LoadMap", [str(tmp_path / "cut.yaml")]])
    assert probe.expect(lambda said: said.get("called") == "/change_map", 15.0)["result"] == 2  # invalid data
    server.says(f"change_map: {cut}; the old map stays")
    probe.tell(call=["/static_map", "nav_msgs/GetMap", []])
    assert "width: 30" in probe.expect(lambda said: said.get("called") == "/static_map", 15.0)["map"]


def test_a_second_bridge_on_a_taken_port_leaves_the_first_alone(ros, sensors):
    port, probe = free_port(), ros.probe()
    probe.tell(subscribe=TRIGGER)
    start_bridge(ros, port)
    sensor = sensors(port, 4)
    assert sensor.wait_connected(15.0)
    second = start(ros, "serial_node.py", "tcp", str(port))
    assert_refused(second, f"TCP port {port} is already taken by another program")
    assert sensor.connected
    sensor.trigger()
    probe.expect(lambda said: said.get("id") == 4 and said.get("move"))


class Flood:
    """Somebody who sends garbage as fast as it is taken, and never reads."""

    def __init__(self, port, data):
        self._socket = socket.create_connection(("127.0.0.1", port))
        self._socket.settimeout(0.5)
        self.peer = "{}:{}".format(*self._socket.getsockname())
        self._data = data
        self.sent = 0
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self):
        until = time.monotonic() + 3.0
        while time.monotonic() < until:
            try:
                self.sent += self._socket.send(self._data)
            except TimeoutError:
                continue
            except OSError:
                return  # hung up on
            time.sleep(0.01)

    def stop(self):
        self._thread.join(5.0)
        self._socket.close()


def test_a_flood_of_garbage_beside_an_honest_sensor(ros, sensors):
    port, probe = free_port(), ros.probe()
    probe.tell(subscribe=TRIGGER)
    bridge = start_bridge(ros, port)
    sensor = sensors(port, 3)
    assert sensor.wait_connected(15.0)
    rng = random.Random(5)
    begins_like_a_frame = b"\xff\xfe\x10\x00\xef\x7d\x00"  # and never goes on as one
    floods = [Flood(port, data) for data in (rng.randbytes(4096), begins_like_a_frame * 500, b"GET / HTTP/1.1\r\n\r\n")]
    for count in range(1, 6):
        sensor.trigger()
        wait_for(lambda n=count: len(probe.heard(id=3, move=True)) >= n, 5.0, f"trigger {count}")
    for flood in floods:
        flood.stop()
    assert sensor.connected
    assert sum(flood.sent for flood in floods) > 100_000
    for flood in floods:
        warned = [line for line in bridge.lines if flood.peer in line and "bytes that are no frame" in line]
        assert len(warned) <= 1
    assert sum("bytes that are no frame" in line for line in bridge.lines) == 1  # one address, told of once
    assert len([line for line in bridge.lines if "WARN" in line or "ERROR" in line]) < 10
    assert {(said["id"], said["move"]) for said in probe.heard(topic="/motion_trigger")} == {(3, True), (3, False)}
    assert bridge.popen.poll() is None


def put_a_mail_into_the_outbox(folder):
    """As a node that was killed leaves it; returns the files that wait, as a function."""
    incident = Incident(
        id="20260101T000000-1",
        wall=1767225600.0,
        ros_time=5.0,
        room_id=2,
        room_name="hall",
        phase="looking",
        object_class="person",
        probability=0.9,
        pictures=3,
        verdict="confirmed",
        reason="person seen",
    )
    outbox = folder / "state" / "outbox"
    Outbox(outbox).put(incident_notice(incident, None))
    return lambda: list(outbox.glob("*.notice"))


def smtp(port, **params):
    return {"transport": "smtp", "email_to": "owner@example.org", "smtp_port": port, "mail_retry": 0.3, **params}


@pytest.fixture
def smtp_server():
    """The class of the mail server that the process tests use."""
    from smtp_server import SmtpServer

    return SmtpServer


def test_a_mail_server_that_is_down_and_comes_up(ros, tmp_path, smtp_server):
    port, waiting = free_port(), put_a_mail_into_the_outbox(tmp_path)
    patrol, probe = start_patrol(ros, tmp_path, **smtp(port))
    patrol.says(f"the mail server localhost:{port} cannot be used: [Errno 111] Connection refused", 20.0)
    patrol.says(f"it waits in {tmp_path}/state/outbox, next try in")
    probe.tell(publish=["/motion_trigger", {"id": 1, "move": True}])
    drives_to(probe, 1)
    assert len(waiting()) == 1
    with smtp_server(port=port) as server:
        wait_for(lambda: server.mails, 30.0, "the mail")
        wait_for(lambda: not waiting(), 5.0, "an empty outbox")
        time.sleep(0.5)
        assert len(server.mails) == 1
    assert "Traceback" not in patrol.output


def test_a_mail_server_that_puts_off_one_of_two_recipients_and_one_that_refuses(ros, tmp_path, smtp_server):
    to = [f"{name}@house.test" for name in "abc"]
    said = {to[1]: ["451 4.3.0 later", "451 4.3.0 later", "250 ok"], to[2]: ["550 5.1.1 no such user"]}
    waiting = put_a_mail_into_the_outbox(tmp_path)
    with smtp_server(recipients=said) as server:
        mail = smtp(server.port, email_to=",".join(to), mail_interval=0.0)
        watch = start(ros, "sensor_watch", path_to_params=ROOMS, state_dir=tmp_path / "state", **mail)
        watch.says("delivered by smtp: b@house.test")
        watch.says("is given up for 'mail:c@house.test', others of 'mail' have it")
        wait_for(lambda: not waiting(), 20.0, "an empty outbox")
        first = server.took[0][1]
        took = [taker for taker, mail_id in server.took if mail_id == first]
    assert sorted(took) == to[:2]
    assert server.asked.count(to[2]) == 1
    assert watch.popen.poll() is None
    assert "Traceback" not in watch.output


def test_a_mail_server_that_says_nothing(ros, tmp_path, smtp_server):
    waiting = put_a_mail_into_the_outbox(tmp_path)
    with smtp_server(silent=True) as server:
        patrol, probe = start_patrol(ros, tmp_path, **smtp(server.port, mail_timeout=3.0))
        probe.tell(publish=["/motion_trigger", {"id": 2, "move": True}])
        drives_to(probe, 2)
        patrol.says(f"the mail server localhost:{server.port} cannot be used: no answer within 3 s", 20.0)
        began = time.monotonic()
        assert patrol.stop() == 0  # in the middle of the next try
        assert time.monotonic() - began < 6.0
    assert len(waiting()) == 1


def test_worlds_sensors_and_configuration_that_make_no_sense(ros, tmp_path):
    (tmp_path / "cut.world").write_bytes((ROOT / "worlds" / "house.world").read_bytes()[:3000])
    (tmp_path / "sensors.yaml").write_text("sensors: [{id: 1, x: 0}]\n")
    (tmp_path / "walks.yaml").write_text("walks: 5\n")
    house = ROOT / "worlds" / "house.world"
    cases = [
        (start(ros, "simulator", world="/nowhere.world"), "/nowhere.world: cannot be read: No such file"),
        (
            start(ros, "simulator", world=tmp_path / "cut.world"),
            "cut.world: is not XML, or not all of it: no element found: line",
        ),
        (
            start(ros, "demo_intruder", walks=tmp_path / "walks.yaml"),
            "walks.yaml: walks: expected a walk for each room, got 5",
        ),
        (start(ros, "amcl", max_particles="many"), "/max_particles: expected a whole number, got 'many'"),
        (start(ros, "twist_mux", topics="5"), "/topics: expected a list, each a group of parameters, got 5"),
        (
            start(ros, "simulator", world=house, motion_sensors=tmp_path / "sensors.yaml"),
            f"{tmp_path / 'sensors.yaml'}: sensors[0]/room: is missing",
        ),
    ]
    for node, said in cases:
        assert_refused(node, said)


def test_parameters_and_plug_ins_that_move_base_cannot_use(ros):
    layers = "[{name: sonar, type: 'social_layer::ProxemicLayer'}]"
    cases = {
        "global_costmap/resolution: expected a number [m], got 'fine'": {"global_costmap__resolution": "fine"},
        "local_costmap: expected a group of parameters, got 5": {"local_costmap": 5},
        "local_costmap/footprint": {"local_costmap__footprint": "[[0.1, 0.1], [0.1]]"},
        "local_costmap/plugins: knows no layer 'social_layer::ProxemicLayer', expected one of StaticLayer": {
            "local_costmap__plugins": layers
        },
        "controller_frequency: expected a number [Hz], got 'fast'": {"controller_frequency": "fast"},
        "TrajectoryPlannerROS/max_rotational_vel: is -1.0, expected at least": {
            "TrajectoryPlannerROS__max_rotational_vel": -1.0
        },
        "base_local_planner: knows no plug-in 'teb_local_planner/TebLocalPlannerROS', expected one of "
        "base_local_planner/TrajectoryPlannerROS": {"base_local_planner": "teb_local_planner/TebLocalPlannerROS"},
        "base_global_planner: knows no plug-in 'SBPLLatticePlanner', expected one of navfn/NavfnROS": {
            "base_global_planner": "SBPLLatticePlanner"
        },
        "recovery_behaviors: knows no plug-in 'step_back/Away', expected one of clear_costmap_recovery": {
            "recovery_behaviors": "[{name: away, type: step_back/Away}]"
        },
    }
    started = [(start(ros, "move_base", **params), said) for said, params in cases.items()]
    for node, said in started:
        assert_refused(node, f"/{said}")
