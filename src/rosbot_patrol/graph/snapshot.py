"""What the ROS master says of its graph at one moment, as plain records."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any
from urllib.parse import urlparse


@dataclass(frozen=True, kw_only=True)
class Snapshot:
    """The graph.

    Attributes:
        publishers, subscribers: nodes by topic.
        uris: address of each node, as http://HOST:PORT/.
        parameters: digests of the watched parameters, by their owner in words for people, such as "node /x"; None: not
            asked this time.
        listening: TCP ports of this machine that others can reach; None: not asked this time.
        master_port: TCP port of the master; run_id: its mark since its start.
    """

    publishers: Mapping[str, frozenset[str]] = field(default_factory=dict)
    subscribers: Mapping[str, frozenset[str]] = field(default_factory=dict)
    uris: Mapping[str, str] = field(default_factory=dict)
    parameters: Mapping[str, Mapping[str, str]] | None = None
    listening: frozenset[int] | None = None
    master_port: int = 11311
    run_id: str = ""


def host_of(uri: str) -> str:
    """Host of a node's address."""
    return urlparse(uri).hostname or ""


def port_of(uri: str) -> int:
    """Port of a node's address, 0 if it names none."""
    return urlparse(uri).port or 0


def digests(tree: Mapping[str, Any], without: frozenset[str] = frozenset()) -> dict[str, str]:
    """A digest for each parameter of a node, so that no password is kept in memory; without those it sets itself."""
    return {name: _digest(value) for name, value in tree.items() if name not in without}


def _digest(value: Any) -> str:
    return hashlib.sha256(json.dumps(value, sort_keys=True, default=str).encode()).hexdigest()
