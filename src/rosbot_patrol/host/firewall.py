"""The nftables rules that close the ROS graph: which TCP ports may be reached from where.

ROS 1 asks nobody for a password. The master, and each node on two ports of its own, answer whoever reaches them. Nodes
take any port of the range that Linux gives to programs that name none (rospy and roscpp have no setting for a node's
XML-RPC port that launch files could use for all). So the rules close the master's port and that whole range, but for
this machine itself and the private interfaces. Answers to connections from here always pass.

The rules are one table of our own. Other tables (a distribution's, Docker's) stay as they are, and still count.
"""

from __future__ import annotations

import ipaddress
from collections.abc import Iterable
from dataclasses import dataclass

from rosbot_patrol.errors import ParamError

TABLE = "rosbot_patrol"
MASTER_PORT = 11311
BRIDGE_PORT, BRIDGES = 11411, 3
Ports = tuple[int, int]  # first and last


@dataclass(frozen=True, kw_only=True)
class Firewall:
    """What is closed, and who may pass.

    Attributes:
        graph: port ranges of the ROS graph.
        bridges: ports on which motion sensors report.
        interfaces: private network interfaces; machines behind them may use the graph.
        sensors: networks from which sensors may report, such as 192.168.3.0/24 or fd00:3::/64.
        kept: ports inside the ranges that stay open, for other programs.
    """

    graph: tuple[Ports, ...]
    bridges: Ports
    interfaces: tuple[str, ...] = ()
    sensors: tuple[str, ...] = ()
    kept: tuple[int, ...] = ()

    def closes(self, port: int) -> bool:
        """Whether a stranger cannot reach a port."""
        return port not in self.kept and any(first <= port <= last for first, last in (*self.graph, self.bridges))

    def ruleset(self) -> str:
        """The rules as a file for `nft -f`, which replaces an earlier table at once."""
        networks = [ipaddress.ip_network(network, strict=False) for network in self.sensors]
        rules = ['iif "lo" accept', "ct state established,related accept"]
        if self.interfaces:
            names = ", ".join(f'"{name}"' for name in self.interfaces)
            rules.append(f"iifname {{ {names} }} accept")
        if self.kept:
            rules.append(f"tcp dport {_set_of((port, port) for port in self.kept)} accept")
        for family, version in (("ip", 4), ("ip6", 6)):
            addresses = ", ".join(str(network) for network in networks if network.version == version)
            if addresses:
                rules.append(f"{family} saddr {{ {addresses} }} tcp dport {_span(self.bridges)} accept")
        rules.append(f"tcp dport {_set_of((*self.graph, self.bridges))} counter drop")
        lines = "\n".join(f"    {rule}" for rule in rules)
        chain = f"  chain input {{\n    type filter hook input priority filter - 5; policy accept;\n{lines}\n  }}"
        # the first two lines make deleting succeed whether or not the table is there
        return f"table inet {TABLE}\ndelete table inet {TABLE}\ntable inet {TABLE} {{\n{chain}\n}}\n"


def network(text: str) -> str:
    """A network of sensors as the rules have it; raises ParamError."""
    try:
        return str(ipaddress.ip_network(text, strict=False))
    except ValueError as err:
        problem = "is no network; expected an address or a network, such as 192.168.3.0/24 or fd00:3::/64"
        raise ParamError(f"--sensors {text}", problem) from err


def tell(firewall: Firewall) -> list[str]:
    """What the rules do, as sentences."""
    graph = ", ".join(_span(ports) for ports in firewall.graph)
    inside = ["this machine itself", *(f"interface {name}" for name in firewall.interfaces)]
    lines = [f"TCP ports {graph} (the ROS master and its nodes) answer {' and '.join(inside)}, and nobody else."]
    if firewall.sensors:
        who = f"{' and '.join(inside)}, and sensors of {', '.join(firewall.sensors)}"
    else:
        who = f"{' and '.join(inside)}: no motion sensor of another machine (--sensors NETWORK lets some in)"
    lines.append(f"TCP ports {_span(firewall.bridges)} (motion sensors) answer {who}.")
    if firewall.kept:
        lines.append(f"Stays open to all: {', '.join(str(port) for port in firewall.kept)}.")
    return lines


def _span(ports: Ports) -> str:
    first, last = ports
    return str(first) if first == last else f"{first}-{last}"


def _set_of(ranges: Iterable[Ports]) -> str:
    return "{ " + ", ".join(_span(ports) for ports in ranges) + " }"
