"""What is wrong with the ROS graph: one function of snapshots and time, without ROS.

ROS 1 lets every program in the network become a publisher, cut links and change parameters. Nothing here prevents that
(scripts/secure does). It notices, so that the owner hears of it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from enum import Enum

from rosbot_patrol.counts import count_of
from rosbot_patrol.graph.snapshot import Snapshot, host_of, port_of

SETTLED = 10.0  # time for which a link must have been there before its end means anything [s]
MUTE = 10.0  # time without an answer of the master [s]
GONE = 30.0  # time without it, longer than a node takes to start again [s]


class Fault(Enum):
    """Kind of a finding."""

    MASTER_GONE = "master_gone"
    SECOND_DRIVER = "second_driver"
    SECOND_WITNESS = "second_witness"
    STRANGE_NODE = "strange_node"
    LINK_GONE = "link_gone"
    SETTINGS_CHANGED = "settings_changed"
    GRAPH_OPEN = "graph_open"


@dataclass(frozen=True, kw_only=True, order=True)
class Finding:
    """One fault.

    Attributes:
        fault: its kind.
        subject: what it is about, for people: "topic /cmd_vel".
        what: words that follow the subject.
    """

    fault: Fault
    subject: str
    what: str


@dataclass(frozen=True, kw_only=True)
class Expected:
    """What the graph should be like.

    Attributes:
        driven: topic on which one node alone drives the robot.
        witnessed: topics on which one node alone tells what the guard sees, with a name for people.
        published, subscribed: topics that need a publisher or a subscriber, with a name for people.
        is_known_host: whether nodes of a host belong to the guard.
    """

    driven: str
    witnessed: Mapping[str, str]
    published: Mapping[str, str]
    subscribed: Mapping[str, str]
    is_known_host: Callable[[str], bool]


@dataclass
class _Link:
    since: float
    last: float
    nodes: frozenset[str] = frozenset()
    is_settled: bool = False


@dataclass
class Judge:
    """Findings of each moment; remembers which links were there, and the parameters of each node's start."""

    expected: Expected
    _run_id: str = ""
    _answered: float | None = None
    _links: dict[tuple[str, str], _Link] = field(default_factory=dict)
    _first: dict[str, dict[str, str]] = field(default_factory=dict)
    _changed: list[Finding] = field(default_factory=list)
    _open: list[Finding] = field(default_factory=list)

    def look(self, graph: Snapshot, now: float) -> list[Finding]:
        """All faults at a time [s] of a steady clock."""
        self._answered = now
        self._run_id = self._run_id or graph.run_id
        if graph.run_id != self._run_id:  # nothing else can be judged: it knows no node of before
            return [_master("was started anew and does not know the programs that run: what ends now stays away")]
        if graph.parameters is not None:
            self._changed = list(self._settings(graph.parameters))
        if graph.listening is not None:
            self._open = list(_open_ports(graph, graph.listening))
        return [*self._drivers(graph), *self._strangers(graph), *self._gone(graph, now), *self._changed, *self._open]

    def no_answer(self, now: float, before: list[Finding]) -> list[Finding]:
        """All faults where the master has not answered at a time [s]; `before`: those of the last look."""
        self._answered = now if self._answered is None else self._answered
        if now - self._answered < MUTE:
            return before
        return [_master("does not answer: a program that ends now will not find the others again")]

    def _drivers(self, graph: Snapshot) -> Iterable[Finding]:
        drivers = sorted(graph.publishers.get(self.expected.driven, ()))
        if len(drivers) > 1:
            what = f"has {len(drivers)} publishers where one alone may drive the robot: {', '.join(drivers[:5])}"
            yield Finding(fault=Fault.SECOND_DRIVER, subject=f"topic {self.expected.driven}", what=what)
        for topic, name in self.expected.witnessed.items():
            witnesses = sorted(graph.publishers.get(topic, ()))
            if len(witnesses) > 1:
                what = f"has {len(witnesses)} publishers where {name} alone may speak: {', '.join(witnesses[:5])}"
                yield Finding(fault=Fault.SECOND_WITNESS, subject=f"topic {topic}", what=what)

    def _strangers(self, graph: Snapshot) -> Iterable[Finding]:
        for node, uri in sorted(graph.uris.items()):
            host = host_of(uri)
            if not self.expected.is_known_host(host):
                what = f"runs on {host}, a machine that the guard does not know"
                yield Finding(fault=Fault.STRANGE_NODE, subject=f"node {node}", what=what)

    def _gone(self, graph: Snapshot, now: float) -> Iterable[Finding]:
        sides = (
            ("publishes", graph.publishers, self.expected.published),
            ("listens to", graph.subscribers, self.expected.subscribed),
        )
        for verb, nodes_of, wanted in sides:
            for topic, name in wanted.items():
                nodes = nodes_of.get(topic, frozenset())
                link = self._links.get((verb, topic))
                if nodes:
                    link = self._links[verb, topic] = link or _Link(now, now)
                    link.last, link.nodes = now, nodes
                    link.is_settled = link.is_settled or now - link.since >= SETTLED
                elif link is not None and not link.is_settled:
                    del self._links[verb, topic]
                elif link is not None and now - link.last >= GONE:
                    what = f"has gone: nobody {verb} {topic} any more, which {', '.join(sorted(link.nodes)[:3])} did"
                    yield Finding(fault=Fault.LINK_GONE, subject=name, what=what)

    def _settings(self, parameters: Mapping[str, Mapping[str, str]]) -> Iterable[Finding]:
        for subject, now in sorted(parameters.items()):
            first = self._first.setdefault(subject, dict(now))
            changed = sorted(name for name in first.keys() | now.keys() if first.get(name) != now.get(name))
            if changed:
                more = f" and {len(changed) - 5} more" if len(changed) > 5 else ""
                what = f"would start with other settings than before: {', '.join(changed[:5])}{more} changed"
                yield Finding(fault=Fault.SETTINGS_CHANGED, subject=subject, what=what)


def _master(what: str) -> Finding:
    return Finding(fault=Fault.MASTER_GONE, subject="the ROS master", what=what)


def _open_ports(graph: Snapshot, listening: frozenset[int]) -> Iterable[Finding]:
    nodes = {port_of(uri): node for node, uri in graph.uris.items()}
    is_master_open = graph.master_port in listening
    found = [f"{node} ({port})" for port, node in sorted(nodes.items()) if port in listening]
    if not (found or is_master_open):
        return
    parts = [f"the ROS master ({graph.master_port})"] * is_master_open
    if found:
        named = ", ".join(found[:4]) + (", ..." if len(found) > 4 else "")
        parts.append(f"{count_of(len(found), 'node')}: {named}")
    what = f"answers whoever reaches it: {' and '.join(parts)}"
    yield Finding(fault=Fault.GRAPH_OPEN, subject="this machine", what=what)
