"""One connection of the server: a link, its session, and the frames that wait to be sent."""

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
STUCK_AFTER = 15.0  # a client that takes nothing of what waits for it [s]
SOCKET_BUFFER = 32768  # of a restricted client, each way [bytes]


class Link(Protocol):
    """What the server needs of a socket or a serial device, both without waiting."""

    def fileno(self) -> int: ...  # noqa: D102
    def recv(self, size: int, /) -> bytes: ...  # noqa: D102
    def send(self, data: bytes, /) -> int: ...  # noqa: D102
    def close(self) -> None: ...  # noqa: D102


class Client:
    """A connected device.

    Attributes:
        peer: "ADDRESS:PORT" or the path of the serial device; address: the part that stays at a reconnect.
        on_tcp: whether it came over the network.
        sensor_id: the id that it last reported in its EspTriggers, None before the first.
        refused: things that it wanted and was not given; last_refusal: the last of them; last_refused: when [s].
        discarded: frames for it that were thrown away because it took none.
        read_from: no bytes are read before that time [s].
        shared: the budget of frames that it shares with the others of its address.
        older: connections of the same sensor, closed when they have fallen silent.
        watched: the selector's events that the server waits for, 0 for none.
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
        self._sent = 0
        self._last_sent = (-1, 0.0)  # how much, and when that was first seen
        self._lock = threading.Lock()

    @property
    def sensor(self) -> tuple[object, ...] | None:
        """Which sensor this is: address, topics and sensor id; None before they are known."""
        if self.sensor_id is None:
            return None
        topics = frozenset((i, info.name, info.message_type) for i, (_, info) in self.session.incoming.items())
        return self.address, topics, self.sensor_id

    @property
    def wants_write(self) -> bool:
        """Whether frames wait."""
        return bool(self._waiting)

    def has_to_do(self, now: float) -> bool:
        """Whether there is something to send, or reading is to begin again."""
        paused = not self.watched & selectors.EVENT_READ
        return bool(self._waiting) or self.session.has_output or (paused and self.read_from <= now)

    def note_message(self, md5: str, data: bytes) -> bool:
        """Learn the sensor's id from an EspTrigger; return whether it came on this connection for the first time."""
        if md5 != ESP_TRIGGER_MD5 or len(data) != 2 or data[0] == self.sensor_id:
            return False
        self.sensor_id = data[0]
        if data[0] in self._sensor_ids:
            return False
        self._sensor_ids.add(data[0])
        return True

    def note_refusal(self, what: str, now: float) -> None:
        """It wanted something that it was not given."""
        self.refused += 1
        self.last_refusal = what[:200]
        self.last_refused = now

    def is_stuck(self, now: float) -> bool:
        """Whether it has taken nothing for long of what waits for it; ask all the time."""
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
        """Send what the link takes, each frame in one piece.

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

    def _queue(self, frame: bytes) -> None:
        with self._lock:
            most = self.session.policy.max_waiting
            while len(self._waiting) > 1 and (
                len(self._waiting) >= MAX_WAITING or self._waiting_bytes + len(frame) > most
            ):
                self._waiting_bytes -= len(self._waiting[1])
                del self._waiting[1]  # the first may be half sent
                self.discarded += 1
            self._waiting.append(frame)
            self._waiting_bytes += len(frame)


def peer_names(address: tuple[object, ...]) -> tuple[str, str]:
    """("HOST:PORT", "HOST") of a socket's address; an IPv4 address mapped into IPv6 is shown as IPv4."""
    host, port = str(address[0]), address[1]
    host = host.removeprefix("::ffff:") if "." in host else host
    return (f"[{host}]:{port}" if ":" in host else f"{host}:{port}"), host


def listen(port: int, host: str = "") -> socket.socket:
    """A listening socket for IPv4 and IPv6, or for IPv4 alone where the machine has no IPv6.

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
    """No delay for small frames, a dead peer is noticed within about 11 s, and a stranger fills no large buffers."""
    link.setblocking(False)
    if restricted:
        link.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, SOCKET_BUFFER)
        link.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SOCKET_BUFFER)
    link.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    link.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
    link.setsockopt(socket.IPPROTO_TCP, socket.TCP_KEEPIDLE, 5)
    link.setsockopt(socket.IPPROTO_TCP, socket.TCP_KEEPINTVL, 2)
    link.setsockopt(socket.IPPROTO_TCP, socket.TCP_KEEPCNT, 3)
