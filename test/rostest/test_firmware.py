"""The firmware's host build (the sketch itself, over real TCP) before serial_node.py and a real master."""

import json
import signal
import socket
import subprocess
import time
from pathlib import Path

import pytest

pytest.importorskip("rospy", reason="needs ROS: source the workspace first")

from ros_processes import Process, Teller, free_port, wait_for

REPOSITORY = Path(__file__).resolve().parents[2]
BUILD = REPOSITORY / ".ws" / "firmware"
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


@pytest.fixture
def start(ros):
    """Starts firmware, and ends it with the test."""

    def begin(port, *arguments):
        firmware = Firmware(port, *arguments)
        ros.processes.append(firmware)
        firmware.says("Wi-Fi is there")
        return firmware

    return begin


def bridge_on(ros, port, *arguments):
    # A name of its own: the master keeps the parameters of the last bridge.
    bridge = ros.node("serial_node.py", "_port:=tcp", f"_tcp_port:={port}", f"__name:=bridge_{port}", *arguments)
    bridge.says(f" on TCP port {port}")
    return bridge


def listener_of(ros):
    listener = ros.script(LISTENER)
    assert isinstance(listener, Teller)
    return listener


def triggers(listener, sensor_id=5):
    return listener.heard(id=sensor_id, move=True)


def connected(ros, start, *arguments, bridge_arguments=()):
    port, listener = free_port(), listener_of(ros)
    bridge = bridge_on(ros, port, *bridge_arguments)
    firmware = start(port, "--id", "5", *arguments)
    firmware.says("the bridge listens")
    listener.expect(lambda said: said.get("id") == 5)
    return port, listener, bridge, firmware


def test_each_motion_is_published_within_50_ms(ros, start):
    _, listener, _, firmware = connected(ros, start)
    motions = 30
    for _ in range(motions):
        firmware.move()
    wait_for(lambda: len(triggers(listener)) == motions)
    delays = sorted((said["at"] - edge) / 1e6 for said, edge in zip(triggers(listener), firmware.edges, strict=True))
    median, p95 = delays[len(delays) // 2], delays[int(len(delays) * 0.95)]
    print(f"interrupt to topic, {motions} motions: median {median:.1f} ms, p95 {p95:.1f} ms, worst {delays[-1]:.1f} ms")
    assert median < 50.0
    assert delays[-1] < 1000.0  # a busy machine
    firmware.tell("spike 1")
    time.sleep(0.5)
    assert len(triggers(listener)) == motions
    assert listener.heard(id=5, move=False)


def test_connects_over_ipv4_and_ipv6_and_by_name(ros, start):
    port, listener, _, _ = connected(ros, start)  # localhost
    for sensor_id, host in ((6, "127.0.0.1"), (7, "::1")):
        firmware = start(port, "--id", str(sensor_id), "--host", host)
        firmware.says("the bridge listens")
        firmware.move()
        wait_for(lambda n=sensor_id: triggers(listener, n))
    nowhere = start(port, "--host", "no.such.name.invalid")
    nowhere.says("no link to the bridge: its name is unknown", 20.0)


def test_cut_cable_loses_no_motion(ros, start):
    _, listener, bridge, firmware = connected(ros, start)
    firmware.tell("cable 0")
    firmware.move()
    firmware.says("no answer to a trigger for 4 s")
    assert not triggers(listener)
    firmware.tell("cable 1")
    wait_for(lambda: triggers(listener), 20.0)
    listener.expect(lambda said: "there was no link until now" in said.get("log", ""))
    time.sleep(0.5)
    assert len(triggers(listener)) == 1
    assert bridge.popen.poll() is None


def test_wifi_lost_and_back(ros, start):
    _, listener, _, firmware = connected(ros, start)
    firmware.tell("wifi 0")
    firmware.says("Wi-Fi is lost")
    firmware.move()
    time.sleep(0.3)
    assert not triggers(listener)
    firmware.tell("wifi 1")
    wait_for(lambda: triggers(listener))


def test_killed_bridge_is_found_again_and_no_motion_is_lost(ros, start):
    port, listener, bridge, firmware = connected(ros, start)
    firmware.move()
    wait_for(lambda: len(triggers(listener)) == 1)
    bridge.stop(signal.SIGKILL)
    firmware.says("no link to the bridge")
    firmware.move()
    firmware.move()
    bridge = bridge_on(ros, port)
    wait_for(lambda: len(triggers(listener)) == 2, 15.0)
    listener.expect(lambda said: "(2 in all)" in said.get("log", ""))


def test_hung_bridge_gets_the_motion_when_it_wakes(ros, start):
    _, listener, bridge, firmware = connected(ros, start)
    bridge.popen.send_signal(signal.SIGSTOP)
    try:
        firmware.move()
        firmware.says("no answer to a trigger for 4 s")
    finally:
        bridge.popen.send_signal(signal.SIGCONT)
    wait_for(lambda: triggers(listener))
    wait_for(lambda: firmware.count("the bridge listens") == 2, 15.0)


@pytest.mark.parametrize("how", ["reset", "break"])
def test_reset_also_in_mid_frame(ros, start, how):
    port, listener, bridge, firmware = connected(ros, start)
    other = start(port, "--id", "6")
    other.says("the bridge listens")
    for reset in range(1, 4):
        firmware.tell(how)
        wait_for(lambda n=reset: firmware.count("starts after a reset") == n)
        wait_for(lambda n=reset: firmware.count("the bridge listens") == n + 1)
        firmware.move()
        wait_for(lambda n=reset: len(triggers(listener)) == n)
    # What the resets left hanging about is closed: the sensor came back.
    bridge.says("its sensor 5 came back as")
    assert other.count("the bridge listens") == 1
    assert bridge.popen.poll() is None
    assert "Traceback" not in bridge.output


def test_warm_up_sends_heartbeats_and_no_triggers(ros, start):
    _, listener, _, firmware = connected(ros, start, "--warm-up", "2500")
    firmware.says("warms up for 2 s")
    firmware.tell("motion 1")
    time.sleep(0.2)
    firmware.tell("motion 0")
    firmware.says("motion counts from now on")
    assert listener.heard(id=5, move=False)
    assert not triggers(listener)
    firmware.move()
    wait_for(lambda: triggers(listener))


def test_motion_goes_on_where_the_milliseconds_wrap(ros, start):
    _, listener, _, firmware = connected(ros, start, "--clock", str(2**32 - 1500))
    for _ in range(10):
        firmware.move()
    wait_for(lambda: len(triggers(listener)) == 10)
    assert firmware.count("the bridge listens") == 1


def test_motion_that_is_too_old_is_dropped(ros, start):
    port = free_port()
    firmware = start(port, "--id", "5", "--max-age", "1500")
    firmware.move()
    firmware.says("could not be told and is dropped")
    listener = listener_of(ros)
    bridge_on(ros, port)
    firmware.says("the bridge listens", 20.0)
    listener.expect(lambda said: said.get("id") == 5)
    time.sleep(0.5)
    assert not triggers(listener)


def key_file(folder, **keys):
    path = folder / "keys.yaml"
    path.write_text("keys:\n" + "".join(f'  {name.strip("_")}: "{key}"\n' for name, key in keys.items()))
    path.chmod(0o600)
    return f"_key_file:={path}"


def test_key_is_proved_on_both_sides(ros, start, tmp_path):
    keys = key_file(tmp_path, _5=KEY)
    _, listener, bridge, firmware = connected(ros, start, "--key", KEY, "--insist", bridge_arguments=[keys])
    firmware.says("has proved that it is ours")
    firmware.move()
    wait_for(lambda: triggers(listener))
    firmware.tell("break")
    wait_for(lambda: firmware.count("has proved that it is ours") == 2)
    firmware.move()
    wait_for(lambda: len(triggers(listener)) == 2)
    assert KEY not in bridge.output + firmware.output


@pytest.mark.parametrize("arguments", [(), ("--key", OTHER_KEY)])
def test_sensor_without_the_key_gets_nothing_through(ros, start, tmp_path, arguments):
    port, listener = free_port(), listener_of(ros)
    bridge_on(ros, port, key_file(tmp_path, _5=KEY))
    honest = start(port, "--id", "5", "--key", KEY)
    stranger = start(port, "--id", "5", *arguments)
    honest.says("the bridge listens")
    stranger.says("no link to the bridge")
    stranger.move()
    time.sleep(1.0)
    assert not triggers(listener)
    assert stranger.count("the bridge listens") == 0
    if not arguments:
        stranger.says("the bridge wants a key, and this sensor has none (SENSOR_KEY in secrets.h)")
    honest.move()
    wait_for(lambda: len(triggers(listener)) == 1)


def test_sensor_with_a_key_before_a_bridge_without(ros, start):
    port, listener, _, firmware = connected(ros, start, "--key", KEY)
    firmware.says("this sensor has a key, but the bridge did not ask for it")
    firmware.move()
    wait_for(lambda: triggers(listener))
    insisting = start(port, "--id", "6", "--key", KEY, "--insist")
    insisting.says("has not proved that it knows the key, and this sensor insists on it")
    insisting.move()
    time.sleep(0.5)
    assert not triggers(listener, 6)


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
        firmware = start(server.getsockname()[1], "--host", "127.0.0.1", "--id", "2")
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
    assert json.dumps(firmware.lines).count("edge") == 1
