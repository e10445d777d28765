"""Services that know their callers and the callers' machines."""

from __future__ import annotations

import logging
from typing import Any

import rospy

from rosbot_patrol.alerts.safe_text import one_line

log = logging.getLogger(__name__)

_LONGEST_NAME = 100  # longest part shown of a caller's name, which the caller chooses
_PEER = "rosbot_patrol_peer"  # key of the caller's address in a connection's header


class CallerService(rospy.Service):
    """A service that knows the address of its caller."""

    def handle(self, transport: Any, header: dict[str, str]) -> None:
        """Store the address beside the caller's name, then answer."""
        header[_PEER] = ""  # the caller must not choose it
        try:
            header[_PEER] = str(transport.socket.getpeername()[0])
        except OSError as err:  # the caller has hung up
            log.debug("the address of a caller is not known: %s", err)
        super().handle(transport, header)


def caller_of(request: object) -> str:
    """Caller of a `CallerService` and its machine, as text for people."""
    header = getattr(request, "_connection_header", None) or {}
    peer = str(header.get(_PEER, ""))
    is_here = peer.startswith("127.") or peer == "::1"
    where = "this machine" if is_here else f"the machine {peer}" if peer else "an unknown machine"
    return f"{one_line(str(header.get('callerid') or 'an unnamed program'))[:_LONGEST_NAME]} on {where}"
