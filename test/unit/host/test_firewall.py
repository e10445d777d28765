"""Rules, tunnel, open ports: texts and bytes alone."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from rosbot_patrol.errors import HostError, ParamError, StateError
from rosbot_patrol.host import commands, secure
from rosbot_patrol.host.closed import read_closed, to_json
from rosbot_patrol.host.firewall import Firewall, network, tell
from rosbot_patrol.host.sockets import ephemeral_ports, listeners, parse_listeners
from rosbot_patrol.host.tunnel import PC, ROBOT, Tunnel, endpoint, graph_env, public_key

RULES = Firewall(
    graph=((11311, 11311), (32768, 60999)),
    bridges=(11411, 11413),
    interfaces=("patrol0",),
    sensors=("192.168.3.0/24", "fd00:3::/64"),
    kept=(50022,),
)
KEY = "yAnz5TF+lXXJte14tji3zlMNq+hd2rYUIgJBgB3fBmk="
TCP = """\
  sl  local_address rem_address   st tx_queue rx_queue tr tm->when retrnsmt   uid  timeout inode
   0: 0100007F:2C2F 00000000:0000 0A 00000000:00000000 00:00000000 00000000     0        0 41 1 0 100 0 0 10 0
   1: 00000000:2C93 00000000:0000 0A 00000000:00000000 00:00000000 00000000     0        0 42 1 0 100 0 0 10 0
   2: 0100007F:8123 0100007F:2C2F 01 00000000:00000000 00:00000000 00000000     0        0 43 1 0 100 0 0 10 0
"""
TCP6 = """\
  sl  local_address                         remote_address                        st tx rx tr when uid timeout inode
   0: 00000000000000000000000001000000:1F90 00000000000000000000000000000000:0000 0A 0:0 0:0 0 0 0 51 1 0 100 0 0 10 0
   1: 0000000000000000FFFF00000100007F:1F91 00000000000000000000000000000000:0000 0A 0:0 0:0 0 0 0 52 1 0 100 0 0 10 0
"""


def test_what_the_rules_close() -> None:
    assert [RULES.closes(port) for port in (11311, 11412, 40000, 50022, 22)] == [True, True, True, False, False]


def test_rules_as_text() -> None:
    text = RULES.ruleset()
    order = [
        'iif "lo" accept',
        "ct state established,related accept",
        'iifname { "patrol0" } accept',
        "tcp dport { 50022 } accept",
        "ip saddr { 192.168.3.0/24 } tcp dport 11411-11413 accept",
        "ip6 saddr { fd00:3::/64 } tcp dport 11411-11413 accept",
        "tcp dport { 11311, 32768-60999, 11411-11413 } counter drop",
    ]
    places = [text.index(rule) for rule in order]
    assert places == sorted(places)
    assert "saddr" not in Firewall(graph=((1, 2),), bridges=(3, 4)).ruleset()


def test_rules_are_told() -> None:
    told = " ".join(tell(RULES))
    for each in ("11311, 32768-60999", "patrol0", "192.168.3.0/24", "50022"):
        assert each in told
    assert "--sensors NETWORK" in " ".join(tell(Firewall(graph=((1, 2),), bridges=(3, 4))))


def test_what_is_closed_is_read_back(tmp_path: Path) -> None:
    path = tmp_path / "closed.json"
    assert read_closed(path) is None
    path.write_text(to_json(RULES))
    assert read_closed(path) == RULES
    path.write_text("{}")
    with pytest.raises(StateError, match="run scripts/secure again"):
        read_closed(path)


@pytest.mark.parametrize("text", ["192.168.3.0/99", "kitchen", ""])
def test_no_network(text: str) -> None:
    with pytest.raises(ParamError, match="is no network"):
        network(text)


def test_files_of_both_ends() -> None:
    robot = Tunnel(address=ROBOT, peer_address=PC, peer_key=KEY).conf("secret")
    assert "ListenPort = 51820" in robot
    assert f"AllowedIPs = {PC}/32" in robot
    assert "Endpoint" not in robot
    pc = Tunnel(address=PC, peer_address=ROBOT, peer_key=KEY, endpoint="robot:51820").conf("secret")
    assert "Endpoint = robot:51820\nPersistentKeepalive = 25" in pc
    assert "[Peer]" not in Tunnel(address=ROBOT, peer_address=PC).conf("secret")
    env = graph_env(own_address=PC, robot_address=ROBOT, master_port=11312)
    assert env == f"ROS_IP={PC}\nROS_MASTER_URI=http://{ROBOT}:11312\n"


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("192.168.1.20", "192.168.1.20:51820"),
        ("robot.local:1234", "robot.local:1234"),
        ("fd00::20", "[fd00::20]:51820"),
        ("[fd00::20]:99", "[fd00::20]:99"),
        ("[fd00::20]", "[fd00::20]:51820"),
    ],
)
def test_where_the_robot_is(text: str, expected: str) -> None:
    assert endpoint(text) == expected


@pytest.mark.parametrize("text", ["", "a b", "robot:", "robot:99999", "fd00:::1", "robot:x"])
def test_no_place_of_the_robot(text: str) -> None:
    with pytest.raises(ParamError, match="--robot"):
        endpoint(text)


def test_keys_that_people_copy() -> None:
    assert public_key(KEY) == KEY
    for wrong in ("", KEY[:-2], "not a key", KEY + KEY):
        with pytest.raises(ParamError, match="is no WireGuard key"):
            public_key(wrong)


def test_listening_sockets_of_the_kernel() -> None:
    found = parse_listeners(TCP) + parse_listeners(TCP6)
    assert [(each.port, each.address, each.is_local, each.inode) for each in found] == [
        (11311, "127.0.0.1", True, 41),
        (11411, "0.0.0.0", False, 42),
        (8080, "::1", True, 51),
        (8081, "::ffff:7f00:1", True, 52),
    ]
    assert listeners() == sorted(listeners())
    first, last = ephemeral_ports()
    assert 1024 <= first < last <= 65535


def test_the_port_by_which_a_shell_came_in(tmp_path: Path) -> None:
    for process, parent, env in (
        ("self", "7", b"A=1\0"),
        ("7", "6", b"B=2\0SSH_CONNECTION=10.0.0.9 5000 10.0.0.1 2222\0"),
    ):
        (tmp_path / process).mkdir()
        (tmp_path / process / "environ").write_bytes(env)
        (tmp_path / process / "status").write_text(f"Name:\tsh\nPPid:\t{parent}\n")
    assert secure.ssh_port(tmp_path) == 2222
    assert secure.ssh_port(tmp_path / "none") is None


def test_rules_that_would_shut_the_shell_out_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(secure, "ssh_port", lambda: 40022)
    with pytest.raises(HostError, match="add --keep 40022"):
        secure._keep_shell(RULES)
    monkeypatch.setattr(secure, "ssh_port", lambda: 50022)
    secure._keep_shell(RULES)


def test_a_key_that_others_can_read_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "wireguard.key"
    path.write_text(KEY)
    path.chmod(0o644)
    monkeypatch.setattr(secure, "KEY", path)
    with pytest.raises(HostError, match="others can read it"):
        secure._private_key()
    path.chmod(0o600)
    assert secure._private_key() == KEY


def test_files_of_the_system_are_written_whole(tmp_path: Path) -> None:
    path = tmp_path / "etc" / "a"
    assert commands.write(path, "x", 0o600)
    assert not commands.write(path, "x", 0o600)
    assert path.stat().st_mode & 0o777 == 0o600
    assert commands.write(path, "x")
    assert os.listdir(path.parent) == ["a"]
    (tmp_path / "b").write_text("")
    with pytest.raises(HostError, match="cannot be written"):
        commands.write(tmp_path / "b" / "c", "x")
