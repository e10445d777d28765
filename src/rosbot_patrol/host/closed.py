"""What is closed on this machine, for programs that may not ask nftables: a file beside the rules, in /run."""

from __future__ import annotations

import json
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

from rosbot_patrol.errors import StateError
from rosbot_patrol.host.firewall import Firewall

CLOSED = Path("/run/rosbot_patrol/closed.json")


def to_json(firewall: Firewall) -> str:
    """The file's text."""
    return json.dumps(asdict(firewall)) + "\n"


def read_closed(path: Path = CLOSED) -> Firewall | None:
    """What is closed now; None where scripts/secure has not run, or its rules were taken away.

    Raises:
        StateError: the file cannot be used.
    """
    try:
        tree = json.loads(path.read_text("utf-8"))
        return Firewall(**{field.name: _tuples(tree[field.name]) for field in fields(Firewall)})
    except FileNotFoundError:
        return None
    except (OSError, ValueError, KeyError, TypeError) as err:
        raise StateError(path, f"cannot be used ({err}); run scripts/secure again") from err


def _tuples(value: Any) -> Any:
    return tuple(_tuples(each) for each in value) if isinstance(value, list) else value
