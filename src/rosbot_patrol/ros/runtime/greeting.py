"""Handshakes of new links on threads of their own, so that a silent peer blocks nobody.

rospy's server reads the header of a new link on the only thread that accepts links, and without a time limit. If a
node's port belonged to another node a moment ago, the master may still send XML-RPC requests there. The first four
bytes of such a request stand for a header of 1.4 GB, and the node then accepts no subscriber and no call any more.
"""

from __future__ import annotations

import socket
import struct
import threading
from typing import Any

import rospy
from rospy.impl.tcpros_base import TCPROSServer

PATIENCE_S = 10.0  # time for a whole header
LARGEST = 1 << 20  # bytes of a header; the largest part is the text of a message's definition

_read_header_and_serve = TCPROSServer._tcp_server_callback


def install() -> None:
    """Greet each new link of this process on its own thread; call it before `rospy.init_node`."""
    TCPROSServer._tcp_server_callback = _accept


def _accept(server: Any, link: socket.socket, address: tuple[Any, ...]) -> None:
    threading.Thread(target=_greet, args=(server, link, address), name="greeting", daemon=True).start()


def _greet(server: Any, link: socket.socket, address: tuple[Any, ...]) -> None:
    link.settimeout(PATIENCE_S)  # until rospy takes over the link and makes it blocking
    try:
        first = link.recv(4, socket.MSG_PEEK)
    except OSError as err:
        _refuse(link, address, f"no header came: {err}")
        return
    if len(first) == 4 and struct.unpack("<I", first)[0] > LARGEST:
        _refuse(link, address, f"what it sends begins with {first!r} and is no header of ROS")
        return
    _read_header_and_serve(server, link, address)


def _refuse(link: socket.socket, address: tuple[Any, ...], why: str) -> None:
    link.close()
    rospy.logwarn_throttle(10.0, f"a link from {address[0]}:{address[1]} is closed: {why}")
