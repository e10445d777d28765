"""The file of the MQTT broker.

host: homeassistant.local
user: rosbot
password_file: ~/.config/rosbot_patrol/mqtt_password     # chmod 600
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from rosbot_patrol.alerts.channels.secrets_on_disk import read_secret, refuse_secrets
from rosbot_patrol.errors import ParamError
from rosbot_patrol.params import load_strict, param
from rosbot_patrol.yaml_files import read_mapping


def _bad_topic(value: str) -> str | None:
    is_fine = value and value.isprintable() and not any(c in "+#" or c.isspace() for c in value)
    return None if is_fine and value.strip("/") == value else f"is {value!r}, expected a topic without + # and blanks"


@dataclass(frozen=True, kw_only=True)
class BrokerSpec:
    """Keys of the file of the MQTT broker."""

    host: str = param(doc="name or address of the broker")
    port: int = param(0, lo=0, hi=65535, doc="TCP port; 0: 8883 with TLS, else 1883")
    tls: bool = param(False, doc="speak TLS, and check the broker's certificate")
    ca_file: str = param("", doc="CA file for a certificate that the system does not trust")
    user: str = param("", doc="login; empty: none")
    password_file: str = param("", doc="file with the password, of mode 600")
    password_env: str = param("", doc="environment variable with the password")
    topic: str = param("rosbot_patrol", doc="first part of the guard's own topics", check=_bad_topic)
    name: str = param("Guard robot", doc="name of the device in Home Assistant")
    discovery: str = param("homeassistant", doc="discovery prefix of Home Assistant", check=_bad_topic)


@dataclass(frozen=True, kw_only=True)
class Broker:
    """A broker, with the password in it."""

    spec: BrokerSpec
    password: str = ""

    @property
    def port(self) -> int:
        """TCP port."""
        return self.spec.port or (8883 if self.spec.tls else 1883)

    @property
    def where(self) -> str:
        """Host and port, for people."""
        return f"{self.spec.host}:{self.port}"


def load_broker(path: Path, environ: Mapping[str, str]) -> Broker:
    """Read the file. Raises ParamError, which names file and key."""
    prefix = f"{path}: "
    tree = read_mapping(path, keys="host", is_secret=True)
    refuse_secrets(tree, name=prefix, place="in this file")
    spec = load_strict(BrokerSpec, tree, name=prefix)
    if not spec.host.strip() or not spec.host.isprintable():
        raise ParamError(f"{prefix}host", "is empty, expected the broker's name or address")
    ca_file = os.path.expanduser(spec.ca_file)
    if ca_file and not os.access(ca_file, os.R_OK):
        raise ParamError(f"{prefix}ca_file", f"{ca_file} cannot be read")
    password = ""
    if spec.user:
        password = read_secret(f"{prefix}password_file", spec.password_file, spec.password_env, environ)
    return Broker(spec=replace(spec, ca_file=ca_file), password=password)
