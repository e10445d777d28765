"""Parameters of `serial_node`: upstream's names and defaults, and those of the limits that upstream lacks."""

from __future__ import annotations

from dataclasses import dataclass, replace

from rosbot_patrol.errors import ParamError
from rosbot_patrol.params import param
from rosbot_patrol.rosserial.protocol.keys import read_keys
from rosbot_patrol.rosserial.server.admission import Limits
from rosbot_patrol.rosserial.server.policy import (
    MOTION_TRIGGER_RULES,
    TRUSTED,
    Policy,
    parse_networks,
    parse_rules,
    parse_sensors,
)

DEFAULT_TCP_PORT = 11411
DEFAULT_PORT = "/dev/ttyUSB0"


@dataclass(frozen=True, kw_only=True)
class SerialNodeParams:
    """Parameters of serial_node."""

    port: str = param(DEFAULT_PORT, doc="serial device, or 'tcp' for a TCP server")
    baud: int = param(57600, lo=50, hi=4_000_000, unit="baud", reads_text=True, doc="speed of the serial device")
    tcp_port: int = param(
        DEFAULT_TCP_PORT, lo=0, hi=65535, reads_text=True, doc="TCP port; without it /rosserial_embeddedlinux/tcp_port"
    )
    fork_server: bool = param(False, doc="accepted and not needed: one process serves all clients")
    fix_pyserial_for_test: bool = param(False, doc="accepted and not needed: pseudo-terminals work as they are")
    tcp_ports: tuple[int, ...] = param((), lo=0, hi=65535, reads_text=True, doc="further TCP ports of the same process")
    host: str = param("", doc="address to listen on; empty: every address, IPv4 and IPv6")
    restrict: str = param("tcp", choices=("tcp", "always", "never"), doc="where the allow_ lists hold")
    allow_publish: tuple[str, ...] = param(MOTION_TRIGGER_RULES, doc="'TOPIC TYPE' that devices may publish")
    allow_subscribe: tuple[str, ...] = param((), doc="'TOPIC TYPE' that devices may subscribe to")
    allow_services: tuple[str, ...] = param(
        (), doc="'SERVICE TYPE' that devices may offer or call; 'offer' or 'call' before it: only that"
    )
    allow_parameters: tuple[str, ...] = param((), doc="parameters that devices are told")
    key_file: str = param("", doc="keys of the sensors, each TCP client must prove that it has one; empty: none needed")
    allow_peers: tuple[str, ...] = param((), doc="addresses and networks that may connect; empty: all")
    allow_sensors: tuple[str, ...] = param(
        (), doc="'NETWORK IDS', sensors that peers may be: '192.168.1.12 2', 'fc94::/16 1-9 12'; empty: any"
    )
    max_clients: int = param(600, lo=1, hi=20000, doc="TCP clients at a time, all ports together")
    max_clients_per_address: int = param(64, lo=0, doc="TCP clients of one address at a time; 0: any")
    max_strangers: int = param(
        32, lo=1, doc="TCP clients of one address that proved and announced nothing; a newcomer ends the oldest"
    )
    max_rate: float = param(200.0, lo=0.0, unit="1/s", doc="frames a second and client, beyond it reads slowly; 0: any")
    max_rate_per_address: float = param(
        2000.0, lo=0.0, unit="1/s", doc="frames a second of all clients of one address, likewise; 0: any"
    )
    max_topics: int = param(16, lo=1, hi=1000, doc="topics and services of one restricted client")
    max_payload: int = param(1024, lo=64, hi=32767, unit="bytes", doc="longest message of a restricted client")
    silence_timeout: float = param(15.0, lo=1.0, unit="s", doc="hang up on a TCP client not heard of for that long")
    sensor_timeout: float = param(
        10.0, lo=1.0, unit="s", doc="a motion sensor without a heartbeat for that long is silent"
    )
    record_bytes: bool = param(False, doc="publish what devices send, byte for byte, on ~bytes, for bags to replay")

    @property
    def is_tcp(self) -> bool:
        """Whether to serve TCP."""
        return self.port == "tcp"

    @property
    def all_tcp_ports(self) -> tuple[int, ...]:
        """Every TCP port to open."""
        return (self.tcp_port, *(port for port in self.tcp_ports if port != self.tcp_port))

    def policy(self, prefix: str) -> Policy:
        """What devices may do, with the keys read; `prefix` names the parameters in messages. Raises ParamError."""
        restricted = self.restrict == "always" or (self.restrict == "tcp" and self.is_tcp)
        base = Policy() if restricted else TRUSTED
        return replace(
            base,
            publish=parse_rules(self.allow_publish, prefix + "allow_publish"),
            subscribe=parse_rules(self.allow_subscribe, prefix + "allow_subscribe"),
            services=parse_rules(self.allow_services, prefix + "allow_services", verbs=("offer", "call")),
            parameters=self.allow_parameters,
            keys=self._keys(prefix),
            peers=parse_networks(self.allow_peers, prefix + "allow_peers"),
            sensors=parse_sensors(self.allow_sensors, prefix + "allow_sensors"),
            max_topics=self.max_topics if restricted else base.max_topics,
            max_payload=self.max_payload if restricted else base.max_payload,
            max_rate=self.max_rate if restricted else base.max_rate,
        )

    @property
    def limits(self) -> Limits:
        """How many TCP clients may come, and how much those of one address may send."""
        return Limits(
            clients=self.max_clients,
            per_address=self.max_clients_per_address,
            strangers=self.max_strangers,
            rate=self.max_rate_per_address if self.restrict != "never" else 0.0,
        )

    def _keys(self, prefix: str) -> dict[int, bytes]:
        """A serial device is a trusted wire, which needs no key unless it is restricted too."""
        if not self.key_file or not (self.is_tcp or self.restrict == "always"):
            return {}
        try:
            return read_keys(self.key_file)
        except ParamError as err:
            raise ParamError(prefix + "key_file", str(err)) from err
