"""The firmware's host build (the sketch itself, over real TCP) before serial_node.py and a real master."""

import itertools
import signal
import socket
import subprocess
import time
from pathlib import Path
from types import SimpleNamespace

import pytest

pytest.importorskip("rospy", reason="needs ROS: source the workspace first")

from ros_processes import Process, free_port, wait_for

REPOSITORY = Path(__file__).resolve().parents[2]
BUILD = REPOSITORY / ".ws" / "firmware"
IDS = itertools.count(10)
KEY, OTHER_KEY = "0123456789abcdef" * 4, "fedcba9876543210" * 4

# Says when a trigger comes, by the clock that the firmware's "edge" lines tell too.
LISTENER = """
import json, sys, threading, time
import roslib.message, rospy
lock = threading.Lock()
def say(**what):
    with lock:
        print(json.dumps(what), flush=True)
def heard(message):
    say(at=time.monotonic_ns(), id=message.id, move=message.move)
rospy.init_node("listener", anonymous=True, disable_signals=True)
kind = roslib.message.get_message_class("rosbot_patrol/EspTrigger")
rospy.Subscriber("/motion_trigger", kind, heard, tcp_nodelay=True)
rospy.Subscriber("/rosout", roslib.message.get_message_class("rosgraph_msgs/Log"), lambda m: say(log=m.msg))
say(ready=True)
sys.stdin.read()
"""


class Firmware(Process):
    """The sketch as a program; commands as firmware/host/main.cpp lists them."""

    def __init__(self, port, *arguments):
        command = [str(BUILD / "esp_motion_sensor"), "--port", str(port), *arguments]
        super().__init__(command, None, stdin=subprocess.PIPE)

    def tell(self, *lines):
        for line in lines:
            self.popen.stdin.write(line + "\n")
        self.popen.stdin.flush()

    def move(self):
        """One motion, from its begin to its end."""
        began, ended = self.lines.count("motion"), self.count("no motion any more")
        self.tell("motion 1")
        wait_for(lambda: self.lines.count("motion") > began)
        self.tell("motion 0")
        wait_for(lambda: self.count("no motion any more") > ended)

    @property
    def edges(self):
        return [int(line.split()[1]) for line in list(self.lines) if line.startswith("edge ")]

    def count(self, text):
        return sum(text in line for line in list(self.lines))

    def stop(self, sig=signal.SIGTERM):
        return super().stop(sig)


@pytest.fixture(scope="module", autouse=True)
def built():
    done = subprocess.run(
        ["make", "-s", "-j2", "-C", str(REPOSITORY / "firmware" / "host"), f"BUILD={BUILD}", "sensor"],
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.fixture(scope="module")
def shared(master):
    """A listener and a bridge without keys for all tests here: each test has sensors of its own ids."""
    listener, port = master.script(LISTENER), free_port()
    bridge = bridge_on(master, port)
    nodes = [listener.process, bridge]
    master.processes[:] = [each for each in master.processes if each not in nodes]  # or they would end with a test
    yield SimpleNamespace(listener=listener, bridge=bridge, port=port)
    for node in nodes:
        node.stop()


@pytest.fixture
def listener(shared):
    return shared.listener


@pytest.fixture
def sensor_id():
    return next(IDS)


@pytest.fixture
def start(ros):
    """Starts firmware, and ends it with the test."""

    def begin(port, sensor_id, *arguments):
        firmware = Firmware(port, "--id", str(sensor_id), *arguments)
        ros.processes.append(firmware)
        firmware.says("Wi-Fi is there")
        return firmware

    return begin


@pytest.fixture
def connect(start, listener):
    """Starts firmware, and waits until it is heard."""

    def begin(port, sensor_id, *arguments):
        firmware = start(port, sensor_id, *arguments)
        firmware.says("the bridge listens")
        listener.expect(lambda said: said.get("id") == sensor_id)
        return firmware

    return begin


def bridge_on(ros, port, *arguments):
    # A name of its own: the master keeps the parameters of the last bridge.
    bridge = ros.node("serial_node.py", "_port:=tcp", f"_tcp_port:={port}", f"__name:=bridge_{port}", *arguments)
    bridge.says(f" on TCP port {port}")
    return bridge


def triggers(listener, sensor_id):
    return listener.heard(id=sensor_id, move=True)


def test_each_motion_is_published_within_50_ms(shared, listener, connect, sensor_id):
    firmware = connect(shared.port, sensor_id)
    motions = 30
    for _ in range(motions):
        firmware.move()
    wait_for(lambda: len(triggers(listener, sensor_id)) == motions)
    heard = [said["at"] for said in triggers(listener, sensor_id)]
    delays = sorted((at - edge) / 1e6 for at, edge in zip(heard, firmware.edges, strict=True))
    median, p95 = delays[len(delays) // 2], delays[int(len(delays) * 0.95)]
    print(f"interrupt to topic, {motions} motions: median {median:.1f} ms, p95 {p95:.1f} ms, worst {delays[-1]:.1f} ms")
    assert median < 50.0
    assert delays[-1] < 1000.0  # a busy machine
    firmware.tell("spike 1")
    firmware.says("a spike on the motion sensor's output")
    assert len(triggers(listener, sensor_id)) == motions
    assert listener.heard(id=sensor_id, move=False)


@pytest.mark.parametrize("host", ["127.0.0.1", "::1"])
def test_connects_over_ipv4_and_ipv6(shared, listener, connect, sensor_id, host):
    firmware = connect(shared.port, sensor_id, "--host", host)
    firmware.move()
    wait_for(lambda: triggers(listener, sensor_id))


def test_unknown_name_is_said(start, sensor_id):
    start(11411, sensor_id, "--host", "no.such.name.invalid").says("no link to the bridge: its name is unknown", 20.0)


def test_cut_cable_loses_no_motion(shared, listener, connect, sensor_id):
    firmware = connect(shared.port, sensor_id)
    firmware.tell("cable 0")
    firmware.move()
    firmware.says("no answer to a trigger for 4 s")
    assert not triggers(listener, sensor_id)
    firmware.tell("cable 1")
    wait_for(lambda: triggers(listener, sensor_id), 20.0)
    late = f"sensor {sensor_id}: motion began"
    listener.expect(lambda said: late in said.get("log", "") and "there was no link until now" in said["log"])
    time.sleep(0.5)
    assert len(triggers(listener, sensor_id)) == 1
    assert shared.bridge.popen.poll() is None


def test_wifi_lost_and_back(shared, listener, connect, sensor_id):
    firmware = connect(shared.port, sensor_id)
    firmware.tell("wifi 0")
    firmware.says("Wi-Fi is lost")
    firmware.move()
    time.sleep(0.3)
    assert not triggers(listener, sensor_id)
    firmware.tell("wifi 1")
    wait_for(lambda: triggers(listener, sensor_id))


def test_killed_bridge_is_found_again_and_no_motion_is_lost(ros, listener, connect, sensor_id):
    port = free_port()
    bridge = bridge_on(ros, port)
    firmware = connect(port, sensor_id)
    firmware.move()
    wait_for(lambda: len(triggers(listener, sensor_id)) == 1)
    bridge.stop(signal.SIGKILL)
    firmware.says("no link to the bridge")
    firmware.move()
    firmware.move()
    bridge_on(ros, port)
    wait_for(lambda: len(triggers(listener, sensor_id)) == 2, 15.0)
    listener.expect(lambda said: "(2 in all)" in said.get("log", ""))


def test_hung_bridge_gets_the_motion_when_it_wakes(ros, listener, connect, sensor_id):
    port = free_port()
    bridge = bridge_on(ros, port)
    firmware = connect(port, sensor_id)
    bridge.popen.send_signal(signal.SIGSTOP)
    try:
        firmware.move()
        firmware.says("no answer to a trigger for 4 s")
    finally:
        bridge.popen.send_signal(signal.SIGCONT)
    wait_for(lambda: triggers(listener, sensor_id))
    wait_for(lambda: firmware.count("the bridge listens") == 2, 15.0)


@pytest.mark.parametrize("how", ["reset", "break"])
def test_reset_also_in_mid_frame(ros, listener, connect, sensor_id, how):
    port = free_port()
    bridge = bridge_on(ros, port)  # its own, as it logs 60 lines a minute of one address at most
    firmware = connect(port, sensor_id)
    other = connect(port, next(IDS))
    for reset in range(1, 4):
        firmware.tell(how)
        wait_for(lambda n=reset: firmware.count("starts after a reset") == n)
        wait_for(lambda n=reset: firmware.count("the bridge listens") == n + 1)
        firmware.move()
        wait_for(lambda n=reset: len(triggers(listener, sensor_id)) == n)
    # What the resets left hanging about is closed: the sensor came back.
    bridge.says(f"its sensor {sensor_id} came back as")
    assert other.count("the bridge listens") == 1
    assert bridge.popen.poll() is None
    assert "Traceback" not in bridge.output


def test_warm_up_sends_heartbeats_and_no_triggers(shared, listener, connect, sensor_id):
    firmware = connect(shared.port, sensor_id, "--warm-up", "2000")
    firmware.tell("motion 1")
    time.sleep(0.2)
    firmware.tell("motion 0")
    assert firmware.count("motion counts from now on") == 0
    firmware.says("motion counts from now on")
    assert listener.heard(id=sensor_id, move=False)
    assert not triggers(listener, sensor_id)
    firmware.move()
    wait_for(lambda: triggers(listener, sensor_id))


def test_motion_goes_on_where_the_milliseconds_wrap(shared, listener, connect, sensor_id):
    firmware = connect(shared.port, sensor_id, "--clock", str(2**32 - 1500))
    for _ in range(10):
        firmware.move()
    wait_for(lambda: len(triggers(listener, sensor_id)) == 10)
    assert firmware.count("the bridge listens") == 1


def test_motion_that_is_too_old_is_dropped(ros, listener, start, sensor_id):
    port = free_port()
    firmware = start(port, sensor_id, "--max-age", "1000")
    firmware.move()
    firmware.says("could not be told and is dropped")
    bridge_on(ros, port)
    firmware.says("the bridge listens", 20.0)
    listener.expect(lambda said: said.get("id") == sensor_id)
    assert not triggers(listener, sensor_id)


def bridge_with_keys(ros, folder, **keys):
    path, port = folder / "keys.yaml", free_port()
    path.write_text("keys:\n" + "".join(f'  {name.strip("_")}: "{key}"\n' for name, key in keys.items()))
    path.chmod(0o600)
    return bridge_on(ros, port, f"_key_file:={path}"), port


def test_key_is_proved_on_both_sides(ros, listener, connect, sensor_id, tmp_path):
    bridge, port = bridge_with_keys(ros, tmp_path, **{f"_{sensor_id}": KEY})
    firmware = connect(port, sensor_id, "--key", KEY, "--insist")
    firmware.says("has proved that it is ours")
    firmware.move()
    wait_for(lambda: triggers(listener, sensor_id))
    firmware.tell("break")
    wait_for(lambda: firmware.count("has proved that it is ours") == 2)
    firmware.move()
    wait_for(lambda: len(triggers(listener, sensor_id)) == 2)
    assert KEY not in bridge.output + firmware.output


def test_sensor_without_the_key_gets_nothing_through(ros, listener, connect, start, sensor_id, tmp_path):
    _, port = bridge_with_keys(ros, tmp_path, **{f"_{sensor_id}": KEY})
    honest = connect(port, sensor_id, "--key", KEY)
    for arguments in ((), ("--key", OTHER_KEY)):
        stranger = start(port, sensor_id, *arguments)
        stranger.says("no link to the bridge")
        stranger.move()
        time.sleep(0.5)
        assert not triggers(listener, sensor_id)
        assert stranger.count("the bridge listens") == 0
        if not arguments:
            stranger.says("the bridge wants a key, and this sensor has none (SENSOR_KEY in secrets.h)")
    honest.move()
    wait_for(lambda: len(triggers(listener, sensor_id)) == 1)


def test_sensor_with_a_key_before_a_bridge_without(shared, listener, connect, start, sensor_id):
    firmware = connect(shared.port, sensor_id, "--key", KEY)
    firmware.says("this sensor has a key, but the bridge did not ask for it")
    firmware.move()
    wait_for(lambda: triggers(listener, sensor_id))
    other_id = next(IDS)
    insisting = start(shared.port, other_id, "--key", KEY, "--insist")
    insisting.says("has not proved that it knows the key, and this sensor insists on it")
    insisting.move()
    time.sleep(0.5)
    assert not triggers(listener, other_id)


def test_what_sensor_key_prints_goes_into_secrets_h(ros, tmp_path):
    printed = subprocess.run([*ros.command("sensor_key"), "7"], env=ros.env, capture_output=True, text=True, check=True)
    lines = [line for line in printed.stdout.splitlines() if line.startswith("#define")]
    secrets = "\n".join(['#define WIFI_SSID "a"', '#define BRIDGE_HOST "::1"', *lines])
    (tmp_path / "secrets.h").write_text(secrets + "\n")
    sketch, stubs = REPOSITORY / "firmware/esp_motion_sensor", REPOSITORY / "firmware/host/stubs"
    command = ["g++", "-x", "c++", "-std=gnu++11", "-fsyntax-only", f"-I{stubs}", "-DHOST_IDF_MAJOR=5"]
    command.append(f'-DPATROL_SECRETS_FILE="{tmp_path}/secrets.h"')
    subprocess.run([*command, str(sketch / "esp_motion_sensor.ino")], check=True)


def test_bytes_of_the_negotiation_are_those_of_upstreams_client(start):
    """Against a server of a few lines, as rosserial_python behaves: it asks after a while, and tells the time."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        firmware = start(server.getsockname()[1], 2, "--host", "127.0.0.1")
        link, _ = server.accept()
        with link:
            link.settimeout(5.0)
            time.sleep(0.5)
            link.sendall(bytes.fromhex("fffe0000ff0000ff"))
            time_request = bytes.fromhex("fffe0800f70a000000000000000000f5")
            topic_info = bytes.fromhex("fffe5800a700007d000e000000") + b"motion_trigger" + bytes.fromhex("18000000")
            topic_info += b"rosbot_patrol/EspTrigger" + bytes.fromhex("20000000")
            topic_info += b"95f4bf9b776b2424e3a9da1182e3a9d2" + bytes.fromhex("00020000d4")
            received = b""
            while len(received) < 2 * len(time_request) + len(topic_info):
                received += link.recv(4096)
            assert received.startswith(time_request + topic_info)
            firmware.tell("motion 1")
            while bytes.fromhex("fffe0200fd7d0002017f") not in received:
                received += link.recv(4096)
    wait_for(lambda: firmware.edges)  # the bytes may be here before the line that tells of them is read
    assert len(firmware.edges) == 1
