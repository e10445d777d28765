"""Two sensor hosts and the bridge's, each in a network namespace; run by test_two_hosts.py within the bridge's.

bridge's host, up1, 10.77.1.1, fd77:1::1  ---  eth0, 10.77.1.2, fd77:1::2, sensor host 1
bridge's host, up2, 10.77.2.1, fd77:2::1  ---  eth0, 10.77.2.2, fd77:2::2, sensor host 2
"""

import subprocess
import sys
import time
from pathlib import Path

import pytest
from ros_processes import Process, wait_for

PORT = 11411
SENSOR = """
import sys
from rosbot_patrol.rosserial.device.tcp_client import EspClient
sensor = EspClient(sys.argv[1], int(sys.argv[2]), int(sys.argv[3])).start()
print("started", flush=True)
for line in sys.stdin:
    sensor.trigger()
"""


def ip(*arguments):
    subprocess.run(["ip", *arguments], check=True)


class Host:
    """A namespace with a cable to ours."""

    def __init__(self, number):
        self.number = number
        self._holder = subprocess.Popen(["unshare", "-n", "sleep", "600"])
        self._enter = ["nsenter", "-t", str(self._holder.pid), "-n"]
        ours = subprocess.run(["readlink", "/proc/self/ns/net"], capture_output=True, text=True, check=True).stdout
        theirs = Path(f"/proc/{self._holder.pid}/ns/net")
        wait_for(lambda: str(theirs.readlink()) != ours.strip())
        ip("link", "add", f"up{number}", "type", "veth", "peer", "name", "eth0", "netns", str(self._holder.pid))
        for run, name, last in ((ip, f"up{number}", 1), (self._ip, "eth0", 2)):
            run("addr", "add", f"10.77.{number}.{last}/24", "dev", name)
            run("addr", "add", f"fd77:{number}::{last}/64", "dev", name, "nodad")
            run("link", "set", name, "up")
        self.sensor = None

    def _ip(self, *arguments):
        subprocess.run([*self._enter, "ip", *arguments], check=True)

    def start_sensor(self, ros, address):
        """A sensor with the host's number as its id."""
        command = [*self._enter, sys.executable, "-c", SENSOR, address, str(PORT), str(self.number)]
        self.sensor = Process(command, ros.env, stdin=subprocess.PIPE)
        self.sensor.says("started")

    def trigger(self):
        self.sensor.popen.stdin.write("motion\n")
        self.sensor.popen.stdin.flush()

    def plug(self, state):
        """The cable: "up" or "down"."""
        ip("link", "set", f"up{self.number}", state)

    def stop(self):
        if self.sensor is not None:
            self.sensor.popen.kill()
            self.sensor.popen.wait()
        self._holder.kill()
        self._holder.wait()


@pytest.fixture
def hosts():
    Path("/proc/sys/net/ipv6/conf/all/keep_addr_on_down").write_text("1")  # a cable that is pulled keeps its address
    made = [Host(1), Host(2)]
    yield made
    for host in made:
        host.stop()


def test_one_host_is_cut_off_and_plugged_in_again(hosts, master):
    one, two = hosts
    probe = master.probe()
    probe.tell(subscribe=["/motion_trigger", "rosbot_patrol/EspTrigger"])
    bridge = master.node("serial_node.py", "tcp", str(PORT), "_silence_timeout:=3", "__name:=esp_client1")
    bridge.says("waiting for sensors")
    one.start_sensor(master, "fd77:1::1")
    two.start_sensor(master, "10.77.2.1")
    for number, host in ((1, one), (2, two)):
        host.trigger()
        wait_for(lambda n=number: probe.heard(id=n, move=True), 10.0, f"sensor {number}")

    one.plug("down")
    cut, before, began = len(probe.heard(id=1)), len(probe.heard(id=2)), time.monotonic()
    one.trigger()
    two.trigger()
    wait_for(lambda: len(probe.heard(id=2, move=True)) == 2, 2.0, "the trigger of the host that was left alone")
    wait_for(lambda: "[fd77:1::2]" in bridge.output and "nothing that makes sense" in bridge.output, 8.0, "the notice")
    assert len(probe.heard(id=1)) <= cut + 2  # what was on its way
    seconds = time.monotonic() - began
    assert len(probe.heard(id=2)) - before >= 2 * seconds - 4  # its heartbeats
    assert "10.77.2.2" not in "\n".join(line for line in bridge.lines if "disconnected" in line)

    one.plug("up")
    wait_for(lambda: len(probe.heard(id=1, move=True)) == 2, 15.0, "the trigger that was raised without a link")
    wait_for(lambda: len(probe.heard(id=1, move=False)) > cut + 3, 10.0, "its heartbeats")
    assert bridge.stop() == 0
