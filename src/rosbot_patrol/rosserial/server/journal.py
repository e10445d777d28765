"""Log of the server about its clients: each refusal once per peer, with a limit against floods."""

from __future__ import annotations

import logging
from collections.abc import Hashable

from rosbot_patrol.rosserial.server.client import Client
from rosbot_patrol.rosserial.server.complaints import Complaints

log = logging.getLogger(__name__)

LINES, REFUSALS = 60, 20  # per minute about one address
STRANGERS, LINES_OF_STRANGERS = "strangers", 120  # per minute about all that have announced nothing


class Journal:
    """Writes the log.

    Attributes:
        refused: number of refused requests; turned_away: number of refused or closed connections.
    """

    def __init__(self) -> None:
        self.refused = 0
        self.turned_away = 0
        self._complaints = Complaints()

    def is_new(self, key: Hashable, now: float) -> bool:
        """Whether something has not been logged within ten minutes."""
        return self._complaints.is_new(key, now)

    def say(self, client: Client, level: int, now: float, text: str, *details: object) -> None:
        """Log about a client."""
        is_stranger = client.on_tcp and not client.session.configured
        if self.may_speak(client.address, now) and (not is_stranger or self._may_speak_of_strangers(now)):
            log.log(level, "%s: " + text, client.peer, *details)

    def come(self, client: Client, now: float) -> None:
        """Log a new connection; an address that tries again and again is logged once."""
        if self.is_new((client.address, "connected"), now):
            self.say(client, logging.INFO, now, "connected")

    def go(self, client: Client, reason: str, now: float) -> None:
        """Log the end of a connection, other than by a refusal; once per address if nothing came of it."""
        if client.session.needs_proof:
            reason += ", without a proof (has it a key?)"
        if client.session.configured or self.is_new((client.address, reason), now):
            self.say(client, logging.INFO, now, "disconnected, %s", reason)

    def refuse(self, client: Client, what: str, now: float) -> None:
        """Log a refused request."""
        client.note_refusal(what, now)
        self.refused += 1
        address = client.address
        if self.is_new((address, what), now) and self.may_speak(f"refusals of {address}", now, REFUSALS):
            self.say(client, logging.WARNING, now, "refused %s", what)

    def turn_away(self, peer: str, address: str, reason: str, now: float) -> None:
        """Log a refused connection."""
        self.turned_away += 1
        if self.is_new(("peer", address), now) and self._may_speak_of_strangers(now):
            log.warning("%s: refused, %s", peer, reason)

    def may_speak(self, group: str, now: float, limit: int = LINES) -> bool:
        """Whether one more line about an address fits into this minute."""
        if self._complaints.may_speak(group, now, limit):
            return True
        if self._complaints.left_out and (group == STRANGERS or self._may_speak_of_strangers(now)):
            log.warning("%s: more than %d lines within a minute, the rest of them is left out", group, limit)
        return False

    def _may_speak_of_strangers(self, now: float) -> bool:
        return self.may_speak(STRANGERS, now, LINES_OF_STRANGERS)
