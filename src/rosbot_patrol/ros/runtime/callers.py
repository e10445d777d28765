"""Caller of a service: its name and machine."""

from __future__ import annotations

import logging
from typing import Any

import rospy

from rosbot_patrol.alerts.safe_text import one_line

log = logging.getLogger(__name__)

_LONGEST_NAME = 100  # of a caller, who chooses it
_PEER = "rosbot_patrol_peer"  # in a connection's header: the caller's address


class CallerService(rospy.Service):
    """A service that knows the address of its caller."""

    def handle(self, transport: Any, header: dict[str, str]) -> None:
        """Record the address beside the caller's name, then answer."""
        header[_PEER] = ""  # the caller's own entry does not count
        try:
            header[_PEER] = str(transport.socket.getpeername()[0])
        except OSError as err:  # it has disconnected
            log.debug("the address of a caller is not known: %s", err)
        super().handle(transport, header)


def caller_of(request: object) -> str:
    """Name and machine of a `CallerService`'s caller, for people."""
    header = getattr(request, "_connection_header", None) or {}
    peer = str(header.get(_PEER, ""))
    is_here = peer.startswith("127.") or peer == "::1"
    where = "this machine" if is_here else f"the machine {peer}" if peer else "an unknown machine"
    return f"{one_line(str(header.get('callerid') or 'an unnamed program'))[:_LONGEST_NAME]} on {where}"
