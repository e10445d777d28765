"""Robot, PC, sensor and stranger on one network, before and after scripts/secure; run by test_closed_graph.py."""

import json
import subprocess
import sys
from pathlib import Path

import pytest
from network_hosts import ROOT, Host, make_switch
from ros_processes import wait_for

STRANGER = str(Path(__file__).with_name("graph_stranger.py"))
NODES = {"twist_mux": ("cmd_vel_out:=cmd_vel",), "serial_node.py": ("tcp", "11411", "__name:=esp_client1")}


@pytest.fixture(scope="module")
def hosts():
    make_switch()
    made = {name: Host(name, number) for number, name in enumerate(("robot", "pc", "stranger", "sensor"), start=1)}
    yield made
    for host in made.values():
        host.stop()


def start_graph(robot, **env):
    core = robot.start("roscore", **env)
    core.says("started core service")
    robot.ask("rosparam", "load", "config/twist_mux.yaml", "/twist_mux", **env)
    for program, arguments in NODES.items():
        path = next(Path(ROOT, ".ws", "devel", "lib").glob(f"*/{program}"))
        robot.start(str(path), *arguments, **env)
    robot.processes[-1].says("waiting for sensors")
    wait_for(
        lambda: robot.processes[1].popen.poll() is not None or "/twist_mux" in robot.ask("rosnode", "list", **env),
        what="the nodes",
    )
    return json.loads(robot.ask(sys.executable, STRANGER, "look", **env))


def attack(hosts, ports, *addresses):
    return json.loads(hosts["stranger"].ask(sys.executable, STRANGER, "attack", json.dumps(ports), *addresses))


def stop(host):
    for process in reversed(host.processes):
        process.stop()
    host.processes.clear()


def test_a_stranger_commands_an_open_graph_and_gets_nowhere_with_a_closed_one(hosts):
    robot, pc, stranger, sensor = (hosts[name] for name in ("robot", "pc", "stranger", "sensor"))
    # open: with an address that others reach, as two machines need it
    ports = start_graph(robot, ROS_IP=robot.address, ROS_MASTER_URI=f"http://{robot.address}:11311")
    before = attack(hosts, ports, robot.address)
    print("before:", json.dumps(before, indent=1))
    assert all(before.values())
    stop(robot)

    # closed and joined, as docs/security.md says
    said = robot.run("scripts/secure", "robot", "--sensors", sensor.address)
    key = said.split("--peer ")[1].split()[0]
    said = pc.run("scripts/secure", "pc", "--robot", robot.address, "--peer", key)
    key = said.split("--peer ")[1].split()[0]
    robot.run("scripts/secure", "robot", "--sensors", sensor.address, "--peer", key)
    again = robot.run("scripts/secure", "robot", "--sensors", sensor.address)  # forgets nobody
    assert key in robot.run("wg", "show", "patrol0"), again

    # the stranger reaches the robot's private address only by ways that are not the tunnel
    stranger.run("ip", "route", "add", "10.203.87.0/24", "via", robot.address)
    ports = start_graph(robot)
    after = attack(hosts, ports, robot.address, robot.address6, "10.203.87.1")
    print("after:", json.dumps(after, indent=1))
    assert len(after) == 30
    assert not any(after.values())
    # with WireGuard, but a key that the robot does not know
    other = stranger.run("scripts/secure", "pc", "--robot", robot.address, "--peer", public_key(robot))
    assert "scripts/secure robot --peer" in other
    stranger.run("ip", "route", "del", "10.203.87.0/24", "via", robot.address)
    assert not any(attack(hosts, ports, "10.203.87.1").values())

    # the PC commands as before, and the sensor reports
    assert "/twist_mux" in pc.ask("rosnode", "list")
    pc.ask("rostopic", "pub", "-1", "/e_stop", "std_msgs/Bool", "true")
    echo = pc.start("rostopic", "echo", "-n1", "/cmd_vel")
    wait_for(
        lambda: (
            "linear" in echo.output
            or pc.ask("rostopic", "pub", "-1", "/cmd_vel/patrol", "geometry_msgs/Twist", "{linear: {x: 0.1}}") is None
        ),
        20.0,
        "a command through the tunnel",
    )
    sensor.ask("timeout", "3", "bash", "-c", f"exec 3<>/dev/tcp/{robot.address}/11411; head -c 8 <&3 >/dev/null")
    assert "stolen" not in robot.ask("rosparam", "list")


def public_key(host):
    private = host.run("cat", "/etc/rosbot_patrol/wireguard.key").strip()
    return subprocess.run(["wg", "pubkey"], input=private, capture_output=True, text=True, check=True).stdout.strip()


def test_husarnet_is_taken_where_it_is(hosts):
    assert hosts  # they have made the switch
    robot = Host("abroad", 5)
    hosts["abroad"] = robot
    for words in (("add", "hnet0", "type", "veth", "peer", "name", "hnet1"), ("set", "hnet0", "up")):
        robot.run("ip", "link", *words)
    assert "Husarnet is there" in robot.run("scripts/secure", "robot")
    assert '"hnet0"' in robot.run("nft", "list", "ruleset")
    assert "patrol0" not in robot.run("ip", "link")
    robot.run("scripts/secure", "remove")
    assert "hnet0" not in robot.run("nft", "list", "ruleset")
