"""Who may do what over rosserial: allow-lists of topics, services, parameters and peers, and limits.

A wire of the robot's own (a serial device) is trusted; whoever reaches a TCP port is a stranger, who may tell that
something moves and nothing else.
"""

from __future__ import annotations

import ipaddress
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from rosbot_patrol.errors import ParamError
from rosbot_patrol.rosserial.packet import MAX_PAYLOAD
from rosbot_patrol.rosserial.topics import ESP_TRIGGER_TYPES, TopicId, TopicInfo

_GRAPH_NAME = re.compile(r"^[~/]?[A-Za-z][A-Za-z0-9_/]{0,199}$")
_TYPE_NAME = re.compile(r"^[A-Za-z][A-Za-z0-9_]{0,99}/[A-Za-z][A-Za-z0-9_]{0,99}$")

MOTION_TRIGGER_RULES = tuple(f"/motion_trigger {kind}" for kind in ESP_TRIGGER_TYPES)

Network = ipaddress.IPv4Network | ipaddress.IPv6Network


@dataclass(frozen=True)
class Rule:
    """A topic or service name, and the one type that it may have; "*" stands for any."""

    name: str
    message_type: str

    def matches(self, info: TopicInfo) -> bool:
        """Whether this rule is about that topic."""
        name_fits = self.name == "*" or self.name.lstrip("/") == info.name.lstrip("/")
        return name_fits and self.message_type in ("*", info.message_type)


def parse_rules(texts: Iterable[str], param_name: str) -> tuple[Rule, ...]:
    """Rules from texts "NAME TYPE", as "/motion_trigger rosbot_patrol/EspTrigger".

    Raises:
        ParamError: one of them has another form.
    """
    rules = []
    for text in texts:
        parts = text.split()
        if len(parts) != 2 or (parts[1] != "*" and not _TYPE_NAME.match(parts[1])):
            raise ParamError(param_name, f"expected 'TOPIC PACKAGE/TYPE', got {text!r}")
        rules.append(Rule(parts[0], parts[1]))
    return tuple(rules)


def parse_networks(texts: Iterable[str], param_name: str) -> tuple[Network, ...]:
    """Addresses and networks ("192.168.1.7", "fc94::/16"); raises ParamError."""
    networks = []
    for text in texts:
        try:
            networks.append(ipaddress.ip_network(text, strict=False))
        except ValueError as err:
            raise ParamError(param_name, f"expected an address or a network, got {text!r}") from err
    return tuple(networks)


@dataclass(frozen=True, kw_only=True)
class Policy:
    """What one kind of link is allowed.

    Attributes:
        restricted: whether the lists count; if not, everything is allowed.
        publish, subscribe, services: rules of what a device may do.
        parameters: parameters that it is told.
        peers: networks that may connect; empty: all.
        keys: of the sensors, by id; where there are any, each device must prove that it has one of them.
        max_payload: longest message [bytes]; max_topics: most topics of one client.
        max_rate: frames a second beyond which a client is read more slowly, 0 for no limit.
        max_garbage: bytes without a frame in them after which a client is hung up on, 0 for never.
    """

    restricted: bool = True
    publish: tuple[Rule, ...] = parse_rules(MOTION_TRIGGER_RULES, "")
    subscribe: tuple[Rule, ...] = ()
    services: tuple[Rule, ...] = ()
    parameters: tuple[str, ...] = ()
    peers: tuple[Network, ...] = ()
    keys: Mapping[int, bytes] = field(default_factory=dict, repr=False)
    max_payload: int = 1024
    max_topics: int = 16
    max_rate: float = 200.0
    max_garbage: int = 65536

    def refusal(self, kind: TopicId, info: TopicInfo) -> str | None:
        """Why a topic is not allowed, None where it is."""
        if not _GRAPH_NAME.match(info.name) or not _TYPE_NAME.match(info.message_type):
            return "the name or the type is none that ROS allows"
        if not self.restricted:
            return None
        if kind == TopicId.PUBLISHER:
            rules, verb = self.publish, "publish"
        elif kind == TopicId.SUBSCRIBER:
            rules, verb = self.subscribe, "subscribe to"
        else:
            rules, verb = self.services, "use or offer the service"
        if any(rule.matches(info) for rule in rules):
            return None
        return f"not on the list of what it may {verb}"

    def may_read(self, parameter: str) -> bool:
        """Whether a device is told that parameter."""
        return not self.restricted or parameter in self.parameters

    def may_connect(self, address: str) -> bool:
        """Whether that address may connect."""
        if not self.peers:
            return True
        try:
            found = ipaddress.ip_address(address.partition("%")[0])
        except ValueError:
            return False
        return any(found in network for network in self.peers if network.version == found.version)


TRUSTED = Policy(restricted=False, max_payload=MAX_PAYLOAD, max_topics=200, max_rate=0.0, max_garbage=0)
