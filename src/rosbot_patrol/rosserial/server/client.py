"""One connection of the server: a link, its session, and the frames to be sent."""

from __future__ import annotations

import errno
import selectors
import socket
import threading
from collections import deque
from typing import Protocol

from rosbot_patrol.errors import ProtocolError
from rosbot_patrol.rosserial.protocol.packet import encode
from rosbot_patrol.rosserial.protocol.topics import ESP_TRIGGER_MD5
from rosbot_patrol.rosserial.server.budget import Budget
from rosbot_patrol.rosserial.server.session import Session

MAX_WAITING = 256  # frames
UNLIMITED = Budget(0.0, 0.0)
STUCK_AFTER = 15.0  # time after which a client that reads nothing is stuck [s]
SOCKET_BUFFER = 32768  # of a restricted client, each way [bytes]


class Link(Protocol):
    """Interface of a non-blocking socket or serial device."""

    def fileno(self) -> int: ...  # noqa: D102
    def recv(self, size: int, /) -> bytes: ...  # noqa: D102
    def send(self, data: bytes, /) -> int: ...  # noqa: D102
    def close(self) -> None: ...  # noqa: D102


class Client:
    """A connected device.

    Attributes:
        peer: "ADDRESS:PORT" or the path of the serial device; address: the part that survives a reconnect.
        on_tcp: whether it came over the network.
        sensor_id: the id in its last EspTrigger, None before the first.
        refused: number of refused requests; last_refusal: the last of them; last_refused: its time [s].
        discarded: frames for it that were dropped because it read none.
        read_from: time before which no bytes are read [s].
        shared: the budget of frames shared by all clients of its address.
        older: connections of the same sensor, to be closed when silent.
        watched: the selector's events that the server waits for, 0: none.
    """

    def __init__(self, link: Link, session: Session, peer: str, address: str, *, on_tcp: bool = True) -> None:
        self.link = link
        self.session = session
        self.peer = peer
        self.address = address
        self.on_tcp = on_tcp
        self.sensor_id: int | None = None
        self.refused = 0
        self.last_refusal = ""
        self.last_refused = 0.0
        self.discarded = 0
        self.read_from = 0.0
        self.shared = UNLIMITED
        self.closed = False
        self.older: list[Client] = []
        self.watched = 0
        self._sensor_ids: set[int] = set()
        self._waiting: deque[bytes] = deque()
        self._waiting_bytes = 0
        self._is_begun = False  # the first frame that waits has its signature, and may be partly sent
        self._sent = 0
        self._last_sent = (-1, 0.0)  # bytes sent, and when that number was first seen
        self._lock = threading.Lock()

    @property
    def sensor(self) -> tuple[object, ...] | None:
        """Identity of the sensor: address, topics and sensor id; None before they are known."""
        if self.sensor_id is None:
            return None
        topics = frozenset((i, info.name, info.message_type) for i, (_, info) in self.session.incoming.items())
        return self.address, topics, self.sensor_id

    @property
    def wants_write(self) -> bool:
        """Whether frames wait to be sent."""
        return bool(self._waiting)

    def has_to_do(self, now: float) -> bool:
        """Whether there is something to send, or reading is to resume."""
        paused = not self.watched & selectors.EVENT_READ
        return bool(self._waiting) or self.session.has_output or (paused and self.read_from <= now)

    def note_message(self, md5: str, data: bytes) -> bool:
        """Read the sensor's id from an EspTrigger; returns whether it is new on this connection."""
        if md5 != ESP_TRIGGER_MD5 or len(data) != 2 or data[0] == self.sensor_id:
            return False
        self.sensor_id = data[0]
        if data[0] in self._sensor_ids:
            return False
        self._sensor_ids.add(data[0])
        return True

    def note_refusal(self, what: str, now: float) -> None:
        """Record a refused request."""
        self.refused += 1
        self.last_refusal = what[:200]
        self.last_refused = now

    def is_stuck(self, now: float) -> bool:
        """Whether it has read nothing for long although frames wait; call it regularly."""
        if not self._waiting or self._last_sent[0] != self._sent:
            self._last_sent = self._sent, now
        return now - self._last_sent[1] > STUCK_AFTER

    def put(self, topic_id: int, data: bytes) -> None:
        """Queue a message for the device, from any thread (`SerialServer.send` also wakes the server).

        Raises:
            ProtocolError: it is longer than a frame or than the device's buffer.
        """
        known = self.session.outgoing.get(topic_id)
        if known is not None and len(data) > known[1].buffer_size > 0:
            name, size = known[1].name, known[1].buffer_size
            raise ProtocolError(self.peer, f"a message of {len(data)} bytes on {name} exceeds its buffer of {size}")
        self._queue(encode(topic_id, data))

    def flush(self) -> None:
        """Send as much as the link accepts, each frame in one piece.

        Raises:
            OSError: the link is gone.
        """
        if self.session.has_output:
            for frame in self.session.take_output():
                self._queue(frame)
        if not self._waiting:
            return
        with self._lock:
            while self._waiting:
                if not self._is_begun:
                    plain = self._waiting[0]
                    self._waiting[0] = self.session.sign(plain)
                    self._waiting_bytes += len(self._waiting[0]) - len(plain)
                    self._is_begun = True
                frame = self._waiting[0]
                try:
                    sent = self.link.send(frame)
                except BlockingIOError:
                    return
                self._sent += sent
                self._waiting_bytes -= sent
                if sent < len(frame):
                    self._waiting[0] = frame[sent:]
                    return
                self._waiting.popleft()
                self._is_begun = False

    def _queue(self, frame: bytes) -> None:
        with self._lock:
            most = self.session.policy.max_waiting
            while len(self._waiting) > 1 and (
                len(self._waiting) >= MAX_WAITING or self._waiting_bytes + len(frame) > most
            ):
                self._waiting_bytes -= len(self._waiting[1])
                del self._waiting[1]  # the first may be partly sent
                self.discarded += 1
            self._waiting.append(frame)
            self._waiting_bytes += len(frame)


def peer_names(address: tuple[object, ...]) -> tuple[str, str]:
    """("HOST:PORT", "HOST") of a socket's address; an IPv4 address mapped into IPv6 is shown as IPv4."""
    host, port = str(address[0]), address[1]
    host = host.removeprefix("::ffff:") if "." in host else host
    return (f"[{host}]:{port}" if ":" in host else f"{host}:{port}"), host


def listen(port: int, host: str = "") -> socket.socket:
    """Listening socket for IPv4 and IPv6, or for IPv4 alone on a machine without IPv6.

    Raises:
        ProtocolError: the port is taken or may not be used.
    """
    choices = [(socket.AF_INET6, host or "::"), (socket.AF_INET, host or "0.0.0.0")]
    if host:
        choices = choices[:1] if ":" in host else choices[1:]
    problem: OSError | None = None
    for family, address in choices:
        dual = family == socket.AF_INET6 and not host
        try:
            listener = socket.create_server((address, port), family=family, backlog=512, dualstack_ipv6=dual)
        except ValueError:
            continue  # this machine has no dual stack
        except OSError as err:
            problem = err
            if err.errno in (errno.EAFNOSUPPORT, errno.EADDRNOTAVAIL):
                continue
            break
        listener.setblocking(False)
        return listener
    raise ProtocolError("", _why_not(port, problem)) from problem


def _why_not(port: int, problem: OSError | None) -> str:
    if problem is not None and problem.errno == errno.EADDRINUSE:
        return (
            f"TCP port {port} is already taken by another program (a second serial_node?); choose another ~tcp_port"
            " (bridge_port of the launch files)"
        )
    return f"TCP port {port} cannot be opened: {problem}"


def tune(link: socket.socket, *, restricted: bool) -> None:
    """Send small frames at once, detect a dead peer within about 11 s, and keep a stranger's buffers small."""
    link.setblocking(False)
    if restricted:
        link.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, SOCKET_BUFFER)
        link.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SOCKET_BUFFER)
    link.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    link.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
    link.setsockopt(socket.IPPROTO_TCP, socket.TCP_KEEPIDLE, 5)
    link.setsockopt(socket.IPPROTO_TCP, socket.TCP_KEEPINTVL, 2)
    link.setsockopt(socket.IPPROTO_TCP, socket.TCP_KEEPCNT, 3)
