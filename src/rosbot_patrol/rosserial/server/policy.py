"""Permissions over rosserial: allow-lists of topics, services, parameters and peers, and limits.

A serial device, a wire of the robot itself, is trusted. Anyone on a TCP port is a stranger, who may report motion and
nothing else.
"""

from __future__ import annotations

import ipaddress
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from rosbot_patrol.errors import ParamError
from rosbot_patrol.rosserial.protocol.packet import MAX_PAYLOAD
from rosbot_patrol.rosserial.protocol.topics import ESP_TRIGGER_TYPES, TopicId, TopicInfo

_GRAPH_NAME = re.compile(r"[~/]?[A-Za-z][A-Za-z0-9_/]{0,199}")
_TYPE_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,99}/[A-Za-z][A-Za-z0-9_]{0,99}")
_SENSOR_IDS = re.compile(r"(\d{1,3})(?:-(\d{1,3}))?")

MOTION_TRIGGER_RULES = tuple(f"/motion_trigger {kind}" for kind in ESP_TRIGGER_TYPES)

Network = ipaddress.IPv4Network | ipaddress.IPv6Network


@dataclass(frozen=True)
class Rule:
    """A topic or service name and its permitted type; "*" stands for any.

    Attributes:
        verb: "offer" or "call" if a service rule permits only one of them.
    """

    name: str
    message_type: str
    verb: str = ""

    def matches(self, info: TopicInfo) -> bool:
        """Whether this rule is about that topic."""
        name_fits = self.name == "*" or self.name.lstrip("/") == info.name.lstrip("/")
        return name_fits and self.message_type in ("*", info.message_type)


def parse_rules(texts: Iterable[str], param_name: str, *, verbs: tuple[str, ...] = ()) -> tuple[Rule, ...]:
    """Parse rules "NAME TYPE", such as "/motion_trigger rosbot_patrol/EspTrigger", with an optional verb before.

    Raises:
        ParamError: one of them has another form.
    """
    rules = []
    for text in texts:
        parts = text.split()
        verb = parts.pop(0) if len(parts) == 3 and parts[0] in verbs else ""
        if len(parts) != 2 or (parts[1] != "*" and not _TYPE_NAME.fullmatch(parts[1])):
            before = f"[{'|'.join(verbs)}] " if verbs else ""
            raise ParamError(param_name, f"expected '{before}TOPIC PACKAGE/TYPE', got {text!r}")
        rules.append(Rule(parts[0], parts[1], verb))
    return tuple(rules)


def parse_networks(texts: Iterable[str], param_name: str) -> tuple[Network, ...]:
    """Parse addresses and networks ("192.168.1.7", "fc94::/16"); raises ParamError."""
    networks = []
    for text in texts:
        try:
            networks.append(ipaddress.ip_network(text, strict=False))
        except ValueError as err:
            raise ParamError(param_name, f"expected an address or a network, got {text!r}") from err
    return tuple(networks)


@dataclass(frozen=True)
class SensorRule:
    """Sensor ids permitted to the peers of a network; None: any."""

    network: Network
    sensor_ids: frozenset[int] | None


def parse_sensors(texts: Iterable[str], param_name: str) -> tuple[SensorRule, ...]:
    """Parse rules "NETWORK IDS", such as "192.168.1.12 2", "10.0.0.0/24 1-4 7", "fc94::/16 *"; raises ParamError."""
    rules = []
    for text in texts:
        network, *parts = text.split() or [""]
        numbers: set[int] = set()
        for part in parts:
            found = _SENSOR_IDS.fullmatch(part)
            first = int(found[1]) if found else 0
            last = int(found[2] or first) if found else 0
            is_good = found is not None and first <= last <= 255
            if not is_good and parts != ["*"]:
                raise ParamError(param_name, f"expected sensor ids from 0 to 255, as '2', '1-4' or '*', got {text!r}")
            numbers.update(range(first, last + 1))
        if not parts:
            raise ParamError(param_name, f"expected 'NETWORK IDS', as '192.168.1.12 2', got {text!r}")
        (parsed,) = parse_networks([network], param_name)
        rules.append(SensorRule(parsed, None if parts == ["*"] else frozenset(numbers)))
    return tuple(rules)


def _address(text: str) -> ipaddress.IPv4Address | ipaddress.IPv6Address | None:
    try:
        return ipaddress.ip_address(text.partition("%")[0])
    except ValueError:
        return None


@dataclass(frozen=True, kw_only=True)
class Policy:
    """Permissions of one kind of link.

    Attributes:
        restricted: whether the lists count; if not, everything is allowed.
        publish, subscribe, services: rules of what a device may do.
        parameters: parameters that it may read.
        peers: networks that may connect; empty: all.
        keys: of the sensors, by id; if there are any, each device must prove that it has one.
        sensors: sensors permitted to peers; the rule of the smallest network counts; empty: any.
        max_payload: longest message [bytes]; max_topics: most topics of one client; max_sensors: for how many motion
            sensors it may speak.
        max_names: most topics that all clients together may create; they stay advertised after a client has gone.
        max_rate: frames per second beyond which a client is read more slowly; 0: no limit.
        max_garbage: bytes without a frame after which a client is disconnected; 0: never.
        max_frame_time: longest time from the first byte of a frame to its last [s]; 0: no limit.
        max_waiting: queued bytes for a client beyond which the oldest frames are dropped.
    """

    restricted: bool = True
    publish: tuple[Rule, ...] = parse_rules(MOTION_TRIGGER_RULES, "")
    subscribe: tuple[Rule, ...] = ()
    services: tuple[Rule, ...] = ()
    parameters: tuple[str, ...] = ()
    peers: tuple[Network, ...] = ()
    keys: Mapping[int, bytes] = field(default_factory=dict, repr=False)
    sensors: tuple[SensorRule, ...] = ()
    max_payload: int = 1024
    max_topics: int = 16
    max_sensors: int = 16
    max_names: int = 1000
    max_rate: float = 200.0
    max_garbage: int = 65536
    max_frame_time: float = 5.0
    max_waiting: int = 65536

    def refusal(self, kind: TopicId, info: TopicInfo) -> str | None:
        """Reason why a topic is not permitted, None if it is."""
        if not _GRAPH_NAME.fullmatch(info.name) or not _TYPE_NAME.fullmatch(info.message_type):
            return "the name or the type is none that ROS allows"
        if not self.restricted:
            return None
        if kind == TopicId.PUBLISHER:
            rules, does = self.publish, "publish"
        elif kind == TopicId.SUBSCRIBER:
            rules, does = self.subscribe, "subscribe to"
        else:
            offers = kind in (TopicId.SERVICE_SERVER_PUBLISHER, TopicId.SERVICE_SERVER_SUBSCRIBER)
            verb, does = ("offer", "offer as a service") if offers else ("call", "call as a service")
            rules = tuple(rule for rule in self.services if rule.verb in ("", verb))
        if any(rule.matches(info) for rule in rules):
            return None
        return f"not on the list of what it may {does}"

    def may_read(self, parameter: str) -> bool:
        """Whether a device may read that parameter."""
        return not self.restricted or parameter in self.parameters

    def may_connect(self, address: str) -> bool:
        """Whether that address may connect."""
        if not self.peers:
            return True
        found = _address(address)
        return found is not None and any(found in n for n in self.peers if n.version == found.version)

    def sensor_ids(self, address: str) -> frozenset[int] | None:
        """Sensors permitted to a peer, None: any. A serial device, with a path for an address, may be any."""
        found = _address(address)
        if not self.sensors or found is None:
            return None
        rules = [r for r in self.sensors if r.network.version == found.version and found in r.network]
        size = max((rule.network.prefixlen for rule in rules), default=0)
        rules = [rule for rule in rules if rule.network.prefixlen == size]
        if any(rule.sensor_ids is None for rule in rules):
            return None
        return frozenset().union(*(rule.sensor_ids or () for rule in rules))


TRUSTED = Policy(
    restricted=False,
    max_payload=MAX_PAYLOAD,
    max_topics=200,
    max_sensors=256,
    max_names=100_000,
    max_rate=0.0,
    max_garbage=0,
    max_frame_time=0.0,
    max_waiting=1 << 20,
)
