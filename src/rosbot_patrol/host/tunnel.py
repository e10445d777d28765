"""WireGuard between the robot and the PC: keys, addresses, and the file for wg-quick(8)."""

from __future__ import annotations

import base64
import binascii
import ipaddress
from dataclasses import dataclass

from rosbot_patrol.errors import ParamError

INTERFACE = "patrol0"
PORT = 51820  # UDP, of the robot
ROBOT, PC = "10.203.87.1", "10.203.87.2"
_KEEPALIVE = 25  # [s]; a router forgets a connection that says nothing for longer


@dataclass(frozen=True, kw_only=True)
class Tunnel:
    """One end.

    Attributes:
        address: of this end; peer_address: of the other.
        peer_key: public key of the other end, "" until it is known.
        endpoint: HOST:PORT of the other end, "" where the other one calls.
    """

    address: str
    peer_address: str
    peer_key: str = ""
    endpoint: str = ""

    def conf(self, private_key: str) -> str:
        """The file for wg-quick; holds the private key."""
        lines = ["[Interface]", f"PrivateKey = {private_key}", f"Address = {self.address}/24"]
        if not self.endpoint:
            lines.append(f"ListenPort = {PORT}")
        if self.peer_key:
            lines += ["", "[Peer]", f"PublicKey = {self.peer_key}", f"AllowedIPs = {self.peer_address}/32"]
            if self.endpoint:
                lines += [f"Endpoint = {self.endpoint}", f"PersistentKeepalive = {_KEEPALIVE}"]
        return "\n".join(lines) + "\n"


def public_key(text: str) -> str:
    """A WireGuard key that a person has copied; raises ParamError."""
    try:
        raw = base64.b64decode(text, validate=True)
    except (ValueError, binascii.Error):
        raw = b""
    if len(raw) != 32:
        problem = "is no WireGuard key: expected the 44 characters that scripts/secure printed on the other machine"
        raise ParamError(f"--peer {text[:60]}", problem)
    return text


def endpoint(text: str) -> str:
    """HOST:PORT of the robot for a name or an address with or without a port; raises ParamError."""
    host, _, port = text.rpartition(":") if text.count(":") == 1 or "]" in text else (text, "", str(PORT))
    if text.endswith("]"):
        host, port = text, str(PORT)
    bare = host.strip("[]")
    if ":" in bare:
        try:
            bare = f"[{ipaddress.IPv6Address(bare)}]"
        except ValueError as err:
            raise ParamError(f"--robot {text}", "is no address; expected a name, 192.168.1.20 or fd00::20") from err
    if not bare or any(letter.isspace() for letter in bare) or not port.isdigit() or not 0 < int(port) < 65536:
        raise ParamError(f"--robot {text}", "expected a name or address of the robot, with a UDP port or without")
    return f"{bare}:{port}"


def graph_env(*, own_address: str, robot_address: str, master_port: int) -> str:
    """Variables that put this machine's nodes onto the tunnel, for scripts/env."""
    return f"ROS_IP={own_address}\nROS_MASTER_URI=http://{robot_address}:{master_port}\n"
