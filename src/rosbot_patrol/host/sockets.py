"""TCP ports on which programs of this machine wait, from Linux's /proc; no socket is opened."""

from __future__ import annotations

import ipaddress
import os
import struct
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

PROC = Path("/proc")
_LISTEN = "0A"  # state of a listening socket in /proc/net/tcp


@dataclass(frozen=True, kw_only=True, order=True)
class Listener:
    """One listening TCP socket.

    Attributes:
        port: TCP port.
        address: that it is bound to; 0.0.0.0 or :: for all of the machine's.
        inode: of the socket, by which /proc knows its program.
    """

    port: int
    address: str
    inode: int = 0

    @property
    def is_local(self) -> bool:
        """Whether only programs of this machine can reach it."""
        address = ipaddress.ip_address(self.address)
        mapped = getattr(address, "ipv4_mapped", None)
        return bool((mapped or address).is_loopback)


def parse_listeners(text: str) -> list[Listener]:
    """Listening sockets of a file such as /proc/net/tcp or /proc/net/tcp6."""
    found = []
    for line in text.splitlines()[1:]:
        words = line.split()
        if len(words) < 10 or words[3] != _LISTEN:
            continue
        address, _, port = words[1].partition(":")
        found.append(Listener(port=int(port, 16), address=_address(address), inode=int(words[9])))
    return found


def _address(digits: str) -> str:
    """Address of the kernel's digits: 32-bit words in the machine's byte order."""
    raw = bytes.fromhex(digits)
    words = struct.unpack(f">{len(raw) // 4}I", raw)
    return str(ipaddress.ip_address(struct.pack(f"={len(words)}I", *words)))


def listeners(proc: Path = PROC) -> list[Listener]:
    """All listening TCP sockets of this network namespace, by port."""
    found: list[Listener] = []
    for name in ("tcp", "tcp6"):
        path = proc / "self" / "net" / name
        if path.exists():  # a kernel without IPv6 has no tcp6
            found += parse_listeners(path.read_text("ascii"))
    return sorted(found)


def programs(inodes: Iterable[int], proc: Path = PROC) -> dict[int, str]:
    """Names of the programs that hold these sockets, as far as this user may know, by inode."""
    wanted = {f"socket:[{inode}]": inode for inode in inodes}
    found = {}
    for process, target in _open_files(proc):
        inode = wanted.get(target)
        if inode is not None and inode not in found:
            found[inode] = (process / "comm").read_text("utf-8", errors="replace").strip()
    return found


def _open_files(proc: Path) -> Iterator[tuple[Path, str]]:
    for process in proc.iterdir():
        if not process.name.isdigit():
            continue
        try:
            for link in (process / "fd").iterdir():
                yield process, os.readlink(link)
        except (FileNotFoundError, PermissionError, ProcessLookupError):
            continue  # it has ended, or belongs to another user


def ephemeral_ports(proc: Path = PROC) -> tuple[int, int]:
    """First and last port of those that Linux gives to programs that name none, as ROS nodes do."""
    first, last = (proc / "sys" / "net" / "ipv4" / "ip_local_port_range").read_text("ascii").split()
    return int(first), int(last)
