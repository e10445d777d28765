"""Guard against silent connections: each new link to a node is greeted on a thread of its own.

rospy's server reads the header of a new link on its only accepting thread, and waits without a time limit. If another
node used this port a moment ago, the master may still send that node's XML-RPC request here. rospy takes its first four
bytes for a header length of 1.4 GB. The node then accepts no more subscribers and no more calls.
"""

from __future__ import annotations

import socket
import struct
import threading
from typing import Any

import rospy
from rospy.impl.tcpros_base import TCPROSServer

PATIENCE_S = 10.0  # for a whole header, however many pieces it comes in
LARGEST = 1 << 20  # bytes of a header; most of it is the text of the message definition

_read_header_and_serve = TCPROSServer._tcp_server_callback


def install() -> None:
    """Greet each new link of this process on a thread of its own; call before `rospy.init_node`."""
    TCPROSServer._tcp_server_callback = _accept


def _accept(server: Any, link: socket.socket, address: tuple[Any, ...]) -> None:
    threading.Thread(target=_greet, args=(server, link, address), name="greeting", daemon=True).start()


def _greet(server: Any, link: socket.socket, address: tuple[Any, ...]) -> None:
    link.settimeout(PATIENCE_S)  # until rospy takes the link and makes it blocking
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
