"""Report on the clients of a server, bounded: the important ones in full, the others in one line each."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from enum import IntEnum

from rosbot_patrol.rosserial.server.client import Client

IN_SYNC = 5.0  # [s] since the last frame
RECENT = 60.0  # time for which a refusal counts as a fault [s]
MOST = 20  # number of clients reported in full


class Level(IntEnum):
    """As in diagnostic_msgs/DiagnosticStatus."""

    OK = 0
    WARN = 1
    ERROR = 2


@dataclass(frozen=True)
class ClientState:
    """Present state of one client.

    Attributes:
        values: its identity and statistics, by name, ready to be shown.
    """

    peer: str
    level: Level
    text: str
    values: dict[str, object]

    @property
    def line(self) -> str:
        """Summary in one line."""
        v = self.values
        who = f"sensor {v['sensor']}, {v['proven']}, " if v["sensor"] != "" else ""
        return f"{who}{self.text}, {v['messages']} messages, {v['dropped']} dropped, {v['last heard']} s ago"


def look_at(client: Client, now: float) -> ClientState:
    """State of a client at `now` [s]."""
    session = client.session
    quiet = now - session.last_frame
    level, text = Level.OK, "in sync"
    if not session.configured:
        level = Level.WARN
        text = "has not proved itself" if session.needs_proof else "no topic accepted"
    elif quiet >= IN_SYNC:
        level, text = Level.ERROR, "no sync with device"
    elif client.refused and now - client.last_refused < RECENT:
        level, text = Level.WARN, f"was refused {client.last_refusal}"
    values: dict[str, object] = {
        "sensor": "" if client.sensor_id is None else client.sensor_id,
        "proven": "no key needed" if not session.policy.keys else "no" if session.proven_id is None else "yes",
        "messages": session.messages,
        "dropped": session.dropped,
        "refused": client.refused,
        "bytes of garbage": session.parser.garbage,
        "bad checksums": session.parser.bad_checksums,
        "last heard": f"{max(quiet, 0.0):.1f}",
        "last sync lost": session.sync_losses,
        "not delivered": client.discarded,
    }
    return ClientState(client.peer, level, text, values)


def choose(clients: Iterable[Client], now: float, most: int = MOST) -> tuple[list[ClientState], list[ClientState]]:
    """The clients to report in full, faults first, and the others."""
    states = sorted((look_at(client, now) for client in clients), key=lambda state: -state.level)
    return states[:most], states[most:]
