"""secure: closes the ROS graph of this machine to everybody else, and joins robot and PC by WireGuard.

    scripts/secure alone                       one machine: the graph answers this machine alone
    scripts/secure robot                       the robot of two machines: prints the command for the PC
    scripts/secure pc --robot HOST --peer KEY  the PC: prints the command for the robot
    scripts/secure robot --peer KEY            the robot again, which now lets the PC in
    scripts/secure status                      what is closed, and who is connected
    scripts/secure remove                      takes all of it away

It says what it does before it does it. --show says it only. A second run changes nothing that is right already.
"""

from __future__ import annotations

import argparse
import os
import re
import socket
import sys
from dataclasses import dataclass
from pathlib import Path

from rosbot_patrol.errors import HostError, ParamError, PatrolError
from rosbot_patrol.host import commands, tunnel
from rosbot_patrol.host.closed import CLOSED, read_closed, to_json
from rosbot_patrol.host.firewall import BRIDGE_PORT, BRIDGES, MASTER_PORT, TABLE, Firewall, network, tell
from rosbot_patrol.host.sockets import ephemeral_ports, listeners, programs
from rosbot_patrol.host.tunnel import INTERFACE, PC, ROBOT, Tunnel, graph_env

FOLDER = Path("/etc/rosbot_patrol")
RULES, REMEMBERED, GRAPH = FOLDER / "firewall.nft", FOLDER / "closed.json", FOLDER / "graph.env"
KEY, PEER = FOLDER / "wireguard.key", FOLDER / "wireguard.peer"
TUNNEL_CONF = Path(f"/etc/wireguard/{INTERFACE}.conf")
UNIT_NAME = "rosbot-patrol-firewall.service"
UNIT = Path("/etc/systemd/system") / UNIT_NAME
HUSARNET = "hnet0"
_UNIT_TEXT = f"""\
# Made by scripts/secure; taken away by `scripts/secure remove`.
[Unit]
Description=Closed ports of the ROS graph (rosbot_patrol)
Wants=network-pre.target
Before=network-pre.target

[Service]
Type=oneshot
RemainAfterExit=yes
ExecStart=/usr/sbin/nft -f {RULES}
ExecStartPost=/usr/bin/install -D -m 644 {REMEMBERED} {CLOSED}
ExecStop=/usr/sbin/nft delete table inet {TABLE}
ExecStopPost=/usr/bin/rm -f {CLOSED}

[Install]
WantedBy=multi-user.target
"""


@dataclass(frozen=True, kw_only=True)
class Plan:
    """What is to be done: the rules, and the end of the tunnel, if there is one."""

    firewall: Firewall
    tunnel: Tunnel | None = None
    notes: tuple[str, ...] = ()


def main() -> None:
    """Run the program; exit status 1 and a sentence if something is refused."""
    given = _parser().parse_args()
    try:
        given.run(given)
    except PatrolError as err:
        sys.exit(f"secure: {err}")


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="scripts/secure", description="\n".join(__doc__.split("\n\n")[:2]), formatter_class=_Plain
    )
    roles = parser.add_subparsers(dest="role", required=True, metavar="alone|robot|pc|status|remove")
    for name in ("alone", "robot", "pc"):
        role = roles.add_parser(name)
        role.set_defaults(run=_secure, robot="", peer="", wireguard=False)
        role.add_argument(
            *("--sensors", "-s"), action="append", default=[], metavar="NETWORK", help="motion sensors may report from"
        )
        role.add_argument("--keep", action="append", type=int, default=[], metavar="PORT", help="stays open to all")
        role.add_argument("--master-port", type=int, default=MASTER_PORT, metavar="N", help="(%(default)s)")
        role.add_argument("--bridge-port", type=int, default=BRIDGE_PORT, metavar="N", help="first of 3 (%(default)s)")
        role.add_argument("--show", action="store_true", help="say what would be done, and end")
    for name in ("robot", "pc"):
        role = roles.choices[name]
        role.add_argument("--peer", default="", metavar="KEY", help="public key of the other machine")
        role.add_argument("--wireguard", action="store_true", help="even where Husarnet is there")
    roles.choices["pc"].add_argument(
        "--robot", default="", metavar="HOST", help="address of the robot as the PC has it"
    )
    roles.add_parser("status").set_defaults(run=_status)
    roles.add_parser("remove").set_defaults(run=_remove)
    return parser


class _Plain(argparse.RawDescriptionHelpFormatter):
    """The description as it stands."""


# -- what to do


def _secure(given: argparse.Namespace) -> None:
    plan = _plan(given)
    for line in (*tell(plan.firewall), *plan.notes):
        print(line)
    _keep_shell(plan.firewall)
    if given.show:
        return
    if os.geteuid() != 0:
        raise HostError(f"scripts/secure {given.role}", "needs root (sudo)")
    commands.install([("nft", "nftables")] + [("wg-quick", "wireguard-tools")] * (plan.tunnel is not None))
    if plan.tunnel is not None:
        _join(plan.tunnel)
    _close(plan.firewall)
    if plan.tunnel is not None:
        env = graph_env(own_address=plan.tunnel.address, robot_address=ROBOT, master_port=given.master_port)
        commands.write(GRAPH, env)
        _say_next(given, plan.tunnel)


def _plan(given: argparse.Namespace) -> Plan:
    has_husarnet = _has_interface(HUSARNET)
    uses_husarnet = has_husarnet and given.role != "alone" and not given.wireguard
    end, notes = None, []
    if given.role != "alone" and not uses_husarnet:
        end = _tunnel(given)
        notes.append(f"WireGuard interface {INTERFACE}: this machine is {end.address}, the other {end.peer_address}.")
    elif uses_husarnet:
        notes.append(f"Husarnet is there: robot and PC meet on {HUSARNET}, and WireGuard is not set up (--wireguard).")
    first = given.bridge_port
    firewall = Firewall(
        graph=((given.master_port, given.master_port), ephemeral_ports()),
        bridges=(first, first + BRIDGES - 1),
        interfaces=(INTERFACE,) * (end is not None) + (HUSARNET,) * uses_husarnet,
        sensors=tuple(network(each) for each in given.sensors),
        kept=tuple(given.keep),
    )
    notes += _cut_off(firewall)
    return Plan(firewall=firewall, tunnel=end, notes=tuple(notes))


def _tunnel(given: argparse.Namespace) -> Tunnel:
    peer = tunnel.public_key(given.peer) if given.peer else ""
    if given.role == "robot":
        known = PEER.read_text("ascii").strip() if not peer and PEER.exists() and os.access(PEER, os.R_OK) else ""
        return Tunnel(address=ROBOT, peer_address=PC, peer_key=peer or known)
    if not (given.robot and peer):
        raise ParamError("scripts/secure pc", "needs --robot and --peer, as `scripts/secure robot` prints them")
    return Tunnel(address=PC, peer_address=ROBOT, peer_key=peer, endpoint=tunnel.endpoint(given.robot))


def _cut_off(firewall: Firewall) -> list[str]:
    """Which other programs here will not be reached from outside any more."""
    closed = [each for each in listeners() if not each.is_local and firewall.closes(each.port)]
    names = programs(each.inode for each in closed)
    found = sorted({f"{each.port} ({names.get(each.inode, 'program unknown')})" for each in closed})
    return [f"Open to all until now: {', '.join(found)}. --keep PORT leaves one open."] if found else []


def _keep_shell(firewall: Firewall) -> None:
    """Refuse rules that close the port by which this shell came in; raises HostError."""
    port = ssh_port()
    if port is not None and firewall.closes(port):
        problem = f"this shell came in by it, and it would be closed: add --keep {port}"
        raise HostError(f"TCP port {port}", problem)


def ssh_port(proc: Path = Path("/proc")) -> int | None:
    """The machine's TCP port by which this shell's SSH connection came, from the shells above; None without one."""
    process = "self"
    while process != "0":
        folder = proc / process
        try:
            environment = (folder / "environ").read_bytes()
            status = (folder / "status").read_text("utf-8", errors="replace")
        except OSError:
            return None
        found = re.search(rb"(?:^|\0)SSH_CONNECTION=\S+ \d+ \S+ (\d+)", environment)
        if found:
            return int(found[1])
        parent = re.search(r"^PPid:\s*(\d+)", status, re.MULTILINE)
        process = parent[1] if parent else "0"
    return None


# -- how it is done


def _close(firewall: Firewall) -> None:
    rules = firewall.ruleset()
    commands.run("nft", "--check", "--file", "-", given=rules)
    commands.write(RULES, rules)
    commands.write(REMEMBERED, to_json(firewall))
    if commands.has_systemd():
        commands.write(UNIT, _UNIT_TEXT)
        commands.run("systemctl", "daemon-reload")
        commands.run("systemctl", "enable", UNIT_NAME)
        commands.run("systemctl", "restart", UNIT_NAME)
        print("Closed, now and after each start of the machine.")
        return
    commands.run("nft", "--file", str(RULES))
    commands.write(CLOSED, to_json(firewall))
    print("Closed until the machine is switched off: no systemd runs here, so call this again after each start.")


def _join(end: Tunnel) -> None:
    if _has_interface(INTERFACE) and f"Address = {end.address}/" not in TUNNEL_CONF.read_text("ascii"):
        raise HostError(INTERFACE, "this machine is the other end until now: `scripts/secure remove` first")
    if end.peer_key:
        commands.write(PEER, end.peer_key + "\n")
    commands.write(TUNNEL_CONF, end.conf(_private_key()), 0o600)
    if _has_interface(INTERFACE):
        commands.run("wg", "syncconf", INTERFACE, "/dev/stdin", given=commands.run("wg-quick", "strip", INTERFACE))
        return
    if not _kernel_has_wireguard():
        commands.install([("wireguard-go", "wireguard-go")])
        print("This kernel has no WireGuard: wireguard-go does it, which is slower.")
    if commands.has_systemd():
        commands.run("systemctl", "enable", f"wg-quick@{INTERFACE}")
        commands.run("systemctl", "restart", f"wg-quick@{INTERFACE}")
    else:
        commands.run("wg-quick", "up", INTERFACE)


def _has_interface(name: str) -> bool:
    return any(each == name for _, each in socket.if_nameindex())


def _kernel_has_wireguard() -> bool:
    probe = "patrol-probe"
    try:
        commands.run("ip", "link", "add", probe, "type", "wireguard")
    except HostError:
        return False
    commands.run("ip", "link", "delete", probe)
    return True


def _private_key() -> str:
    """This machine's key, made at the first call; refused if others can read it."""
    if not KEY.exists():
        commands.write(KEY, commands.run("wg", "genkey"), 0o600)
    if KEY.stat().st_mode & 0o077:
        problem = "others can read it, so it is no secret: remove it, and run this again on both machines"
        raise HostError(str(KEY), problem)
    return KEY.read_text("ascii").strip()


def _say_next(given: argparse.Namespace, end: Tunnel) -> None:
    public = commands.run("wg", "pubkey", given=_private_key()).strip()
    if given.role == "pc":
        print(f"Now on the robot:\n  scripts/secure robot --peer {public}")
    elif not end.peer_key:
        print(f"Now on the PC, with the robot's address:\n  scripts/secure pc --robot ADDRESS --peer {public}")
    print(f"New shells with `. scripts/env` use the private network (ROS_IP {end.address}).")


def _status(_given: argparse.Namespace) -> None:
    closed = read_closed()
    if closed is None:
        print("Nothing is closed: `scripts/secure alone`, `robot` or `pc` does it (docs/security.md).")
    for line in tell(closed) if closed is not None else ():
        print(line)
    open_ports = [each for each in listeners() if not each.is_local and not (closed and closed.closes(each.port))]
    names = programs(each.inode for each in open_ports)
    for line in sorted({f"  {each.port}  {names.get(each.inode, '')}".rstrip() for each in open_ports}):
        print(f"open to all: {line.strip()}")
    if _has_interface(INTERFACE) and os.geteuid() == 0:
        print(commands.run("wg", "show", INTERFACE).strip())


def _remove(_given: argparse.Namespace) -> None:
    if os.geteuid() != 0:
        raise HostError("scripts/secure remove", "needs root (sudo)")
    if commands.has_systemd() and UNIT.exists():
        commands.run("systemctl", "disable", "--now", UNIT_NAME)
    if commands.has("nft"):
        commands.run("nft", "--file", "-", given=f"table inet {TABLE}\ndelete table inet {TABLE}\n")
    if _has_interface(INTERFACE):
        if commands.has_systemd():
            commands.run("systemctl", "disable", "--now", f"wg-quick@{INTERFACE}")
        else:
            commands.run("wg-quick", "down", INTERFACE)
    for path in (UNIT, RULES, REMEMBERED, GRAPH, TUNNEL_CONF, CLOSED, PEER, KEY):
        path.unlink(missing_ok=True)
    if commands.has_systemd():
        commands.run("systemctl", "daemon-reload")
    print("The ROS graph is open again: whoever reaches this machine can command the guard.")


if __name__ == "__main__":
    main()
