"""Reads the ROS graph from the master for the watch, on a thread of its own: the master may hang."""

from __future__ import annotations

import ipaddress
import logging
import socket
import time
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import rosgraph
import rospy

from rosbot_patrol.errors import ParamError, StateError
from rosbot_patrol.graph.judge import Expected, Finding, Judge
from rosbot_patrol.graph.snapshot import Snapshot, digests, port_of
from rosbot_patrol.host.closed import read_closed
from rosbot_patrol.host.sockets import listeners
from rosbot_patrol.params import param
from rosbot_patrol.ros.runtime.node import Worker

log = logging.getLogger(__name__)

PERIOD = 2.0  # [s] between two looks
SELDOM = 5  # looks between two of the costly ones: addresses of all nodes, parameters, ports
_PUBLISHED = {
    "camera/rgb/image_raw": "the camera",
    "scan": "the lidar",
    "odom": "the odometry",
    "cmd_vel": "the command of the base",
    "darknet_ros/bounding_boxes": "the detector",
    "motion_trigger": "the bridge of the motion sensors",
}
_WITNESSED = ("camera/rgb/image_raw", "scan", "odom", "darknet_ros/bounding_boxes")
_CALLS, _ALIVE, _DRIVEN = "motion_trigger", "patrol/alive", "cmd_vel"
# nodes with parameters that stay as they are while the node runs; for each node, the parameters that it sets itself
_STEADY: dict[str, frozenset[str]] = {
    "patrolling_node": frozenset(),
    "sensor_watch": frozenset(),
    "twist_mux": frozenset(),
    "esp_client1": frozenset(),
    "esp_client2": frozenset(),
    "esp_client3": frozenset(),
    "darknet_ros": frozenset({"running"}),
    "console": frozenset({"url"}),
}


@dataclass(frozen=True, kw_only=True)
class GraphParams:
    """Who belongs to the guard."""

    graph_hosts: str = param(
        "10.203.87.0/24",
        doc="further machines with nodes of the guard: names, addresses or networks, with spaces between",
    )


class KnownHosts:
    """The guard's machines.

    Args:
        given: names, addresses and networks, with spaces between them.

    Raises:
        ParamError: one of them makes no sense.
    """

    def __init__(self, given: str) -> None:
        self._names = {"localhost", socket.gethostname()}
        self._networks = []
        for word in given.split():
            try:
                self._networks.append(ipaddress.ip_network(word, strict=False))
            except ValueError:
                if any(letter in word for letter in "/,;"):
                    problem = f"'{word}' is no name, address or network"
                    raise ParamError(f"{rospy.get_name()}/graph_hosts", problem) from None
                self._names.add(word)
        self._found: dict[str, bool] = {}

    def __call__(self, host: str) -> bool:
        """Whether a host is one of them; a name is resolved once."""
        if host not in self._found:
            self._found[host] = host in self._names or any(self._is_known(each) for each in _addresses(host))
        return self._found[host]

    def _is_known(self, address: ipaddress.IPv4Address | ipaddress.IPv6Address) -> bool:
        return address.is_loopback or any(address in net for net in self._networks) or _is_own(str(address))


def _addresses(host: str) -> Iterable[ipaddress.IPv4Address | ipaddress.IPv6Address]:
    try:
        found = {str(entry[4][0]).partition("%")[0] for entry in socket.getaddrinfo(host, None)}
    except OSError:
        return []
    return [ipaddress.ip_address(each) for each in found]


def _is_own(address: str) -> bool:
    """Whether this machine has an address: only then a socket can be bound to it."""
    family = socket.AF_INET6 if ":" in address else socket.AF_INET
    try:
        with socket.socket(family, socket.SOCK_DGRAM) as probe:
            probe.bind((address, 0))
    except OSError:
        return False
    return True


class GraphReader:
    """Looks at the graph every two seconds; `findings` are those of the last look."""

    def __init__(self, params: GraphParams) -> None:
        self._master = rosgraph.Master(rospy.get_name())
        self._master_port = port_of(self._master.master_uri)
        self._judge = Judge(
            Expected(
                driven=rospy.resolve_name(_DRIVEN),
                witnessed={rospy.resolve_name(topic): _PUBLISHED[topic] for topic in _WITNESSED},
                published={rospy.resolve_name(topic): name for topic, name in _PUBLISHED.items()},
                subscribed={rospy.resolve_name(_CALLS): "the patrol's ear for motion sensors"},
                is_known_host=KnownHosts(params.graph_hosts),
            )
        )
        self._uris: dict[str, str] = {}
        self._seen: set[str] = set()
        self._refused = ""
        self.findings: list[Finding] = []

    def start(self) -> None:
        """Start looking."""
        Worker(self._run, name="graph").start()

    def _run(self) -> None:
        count = 0
        while not rospy.is_shutdown():
            try:
                self.findings = self._judge.look(self._read(is_whole=not count % SELDOM), time.monotonic())
            except (OSError, rosgraph.MasterException) as err:  # it has gone, and the node with it, or it is busy
                log.debug("the graph cannot be read: %s", err)
                self.findings = self._judge.no_answer(time.monotonic(), self.findings)
            count += 1
            time.sleep(PERIOD)

    def _read(self, *, is_whole: bool) -> Snapshot:
        publishers, subscribers, services = self._master.getSystemState()
        nodes = {node for side in (publishers, subscribers, services) for _, names in side for node in names}
        for node in nodes if is_whole else nodes - self._uris.keys():
            self._uris[node] = self._lookup(node)
        self._uris = {node: uri for node, uri in self._uris.items() if node in nodes and uri}
        publishing = {topic: frozenset(names) for topic, names in publishers}
        listening = {topic: frozenset(names) for topic, names in subscribers}
        calls = rospy.resolve_name(_CALLS)
        patrol = publishing.get(rospy.resolve_name(_ALIVE), frozenset())
        listening[calls] = listening.get(calls, frozenset()) & patrol
        return Snapshot(
            publishers=publishing,
            subscribers=listening,
            uris=dict(self._uris),
            parameters=self._parameters() if is_whole else None,
            listening=self._open_ports() if is_whole else None,
            master_port=self._master_port,
            run_id=self._run_id(),
        )

    def _run_id(self) -> str:
        try:
            return str(self._master.getParam("/run_id"))
        except rosgraph.MasterError:
            return ""  # a master without roslaunch has none

    def _lookup(self, node: str) -> str:
        try:
            return str(self._master.lookupNode(node))
        except rosgraph.MasterError:
            return ""  # it has ended meanwhile

    def _parameters(self) -> dict[str, dict[str, str]]:
        found = {}
        for name, own in _STEADY.items():
            node = rospy.resolve_name(name)
            if node in self._uris or node in self._seen:  # while it starts again, too
                self._seen.add(node)
                found[f"node {node}"] = digests(self._tree(node), own)
        found["every node"] = digests({"use_sim_time": self._is_simulated()})
        return found

    def _is_simulated(self) -> bool:
        try:
            return bool(self._master.getParam("/use_sim_time"))
        except rosgraph.MasterError:  # as good as false
            return False

    def _tree(self, node: str) -> dict[str, Any]:
        try:
            tree = self._master.getParam(node)
        except rosgraph.MasterError:  # it has none
            return {}
        return tree if isinstance(tree, dict) else {}

    def _open_ports(self) -> frozenset[int]:
        try:
            closed = read_closed()
            self._refused = ""
        except StateError as err:
            closed = None
            if str(err) != self._refused:
                self._refused = str(err)
                log.warning("%s", err)
        if not has_neighbours():
            return frozenset()
        return frozenset(
            each.port for each in listeners() if not each.is_local and not (closed and closed.closes(each.port))
        )


def has_neighbours() -> bool:
    """Whether this machine has a network interface beside its loopback."""
    return any(name != "lo" for _, name in socket.if_nameindex())
