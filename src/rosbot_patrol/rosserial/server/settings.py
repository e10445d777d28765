"""Parameters of `serial_node`: upstream's names and defaults, and limits that upstream lacks."""

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
        DEFAULT_TCP_PORT, lo=0, hi=65535, reads_text=True, doc="TCP port; default: /rosserial_embeddedlinux/tcp_port"
    )
    fork_server: bool = param(False, doc="accepted, not needed: one process serves all clients")
    fix_pyserial_for_test: bool = param(False, doc="accepted, not needed: pseudo-terminals work without it")
    tcp_ports: tuple[int, ...] = param((), lo=0, hi=65535, reads_text=True, doc="further TCP ports of the same process")
    host: str = param("", doc="address to listen on; empty: every address, IPv4 and IPv6")
    restrict: str = param("tcp", choices=("tcp", "always", "never"), doc="links restricted by the allow_ lists")
    allow_publish: tuple[str, ...] = param(MOTION_TRIGGER_RULES, doc="'TOPIC TYPE' that devices may publish")
    allow_subscribe: tuple[str, ...] = param((), doc="'TOPIC TYPE' that devices may subscribe to")
    allow_services: tuple[str, ...] = param(
        (), doc="'SERVICE TYPE' that devices may offer or call; a prefix 'offer' or 'call' allows only that"
    )
    allow_parameters: tuple[str, ...] = param((), doc="parameters that devices may read")
    key_file: str = param(
        "", doc="file with the sensors' keys, which every TCP client must prove to hold; empty: no keys needed"
    )
    allow_peers: tuple[str, ...] = param((), doc="addresses and networks that may connect; empty: all")
    allow_sensors: tuple[str, ...] = param(
        (), doc="'NETWORK IDS': sensor ids allowed by address: '192.168.1.12 2', 'fc94::/16 1-9 12'; empty: any"
    )
    max_clients: int = param(600, lo=1, hi=20000, doc="maximum number of TCP clients on all ports together")
    max_clients_per_address: int = param(64, lo=0, doc="maximum number of TCP clients of one address; 0: no limit")
    max_strangers: int = param(
        32, lo=1, doc="maximum number of clients of one address without key and topic; a newcomer replaces the oldest"
    )
    max_rate: float = param(
        200.0,
        lo=0.0,
        unit="1/s",
        doc="frames per second from a client; faster clients are read more slowly; 0: no limit",
    )
    max_rate_per_address: float = param(
        2000.0, lo=0.0, unit="1/s", doc="frames per second from all clients of one address, likewise; 0: no limit"
    )
    max_topics: int = param(16, lo=1, hi=1000, doc="maximum number of topics and services of a restricted client")
    max_payload: int = param(
        1024, lo=64, hi=32767, unit="bytes", doc="maximum length of a message from a restricted client"
    )
    silence_timeout: float = param(15.0, lo=1.0, unit="s", doc="silence after which a TCP client is disconnected")
    sensor_timeout: float = param(
        10.0, lo=1.0, unit="s", doc="time without a heartbeat after which a motion sensor counts as silent"
    )
    record_bytes: bool = param(False, doc="publish the bytes that devices send on ~bytes, for bags to replay")

    @property
    def is_tcp(self) -> bool:
        """Whether to serve TCP."""
        return self.port == "tcp"

    @property
    def all_tcp_ports(self) -> tuple[int, ...]:
        """Every TCP port to open."""
        return (self.tcp_port, *(port for port in self.tcp_ports if port != self.tcp_port))

    def policy(self, prefix: str) -> Policy:
        """Permissions of devices, with the keys read; `prefix` names the parameters in messages. Raises ParamError."""
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
        """Limits on TCP clients, and on the frames from one address."""
        return Limits(
            clients=self.max_clients,
            per_address=self.max_clients_per_address,
            strangers=self.max_strangers,
            rate=self.max_rate_per_address if self.restrict != "never" else 0.0,
        )

    def _keys(self, prefix: str) -> dict[int, bytes]:
        """Read the keys; a serial device is a trusted wire and needs none unless it is restricted, too."""
        if not self.key_file or not (self.is_tcp or self.restrict == "always"):
            return {}
        try:
            return read_keys(self.key_file)
        except ParamError as err:
            raise ParamError(prefix + "key_file", str(err)) from err
