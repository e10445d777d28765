"""Connections of rospy between nodes: one to each publisher of a topic, and messages sent by the thread that has them.

One to each: the master announces a new publisher several times, and rospy connects for each announcement on a thread of
its own. Two such threads can both open a connection. Then the subscriber drops one of them, the publisher drops the
other, and rospy opens no third: the topic stays silent although its publisher lives.

Sent at once: rospy has a thread for each subscriber, wakes it for each message and yields to it. A clock of 100 Hz with
28 subscribers so cost a quarter of the simulator's time.
"""

from __future__ import annotations

import select
import socket
import threading
from collections import deque
from typing import Any

import rospy.topics
from rospy.exceptions import TransportException, TransportTerminated
from rospy.impl.masterslave import ROSHandler

_connect = ROSHandler._connect_topic
_busy: set[tuple[str, str]] = set()  # topics and publishers to which a thread connects now
_changed = threading.Condition()

_LARGE = 1 << 16  # longer messages are left to a thread [bytes]


def install() -> None:
    """Connect one at a time to each publisher of a topic, and send at once; call before `rospy.init_node`."""
    ROSHandler._connect_topic = _connect_in_turn
    rospy.topics.QueuedConnection = PromptConnection


def _connect_in_turn(handler: Any, topic: str, publisher: str) -> Any:
    link = topic, publisher
    with _changed:
        _changed.wait_for(lambda: link not in _busy)
        _busy.add(link)
    try:
        return _connect(handler, topic, publisher)  # does nothing if there is a connection
    finally:
        with _changed:
            _busy.discard(link)
            _changed.notify_all()


class PromptConnection:
    """A publisher's connection to one subscriber, in place of rospy's QueuedConnection.

    `write_data` sends at once what the socket takes without waiting. The rest, and whatever comes before that has left,
    waits for a thread in a queue that forgets its oldest message when it is full. So no subscriber, however slow, holds
    up the publisher. All else is the wrapped transport's.

    Args:
        connection: the transport.
        queue_size: of waiting messages, 0 for any number.
    """

    def __init__(self, connection: Any, queue_size: int) -> None:
        self._connection = connection
        self._queue_size = queue_size
        self._changed = threading.Condition()
        self._queue: deque[bytes] = deque()
        self._rest = b""  # of a message that has left in part
        self._is_relaying = False  # the thread sends, or has something to send
        self._thread: threading.Thread | None = None
        self._error: Exception | None = None
        connection.set_cleanup_callback(self._wake)

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        return getattr(self._connection, name)

    def write_data(self, data: bytes) -> bool:
        """Send a message, or let it wait; raises what the last one failed with."""
        with self._changed:
            if self._error is not None:
                error, self._error = self._error, None
                raise error
            if self._connection.done:
                raise TransportTerminated("connection closed")
            if not self._is_relaying and len(data) <= _LARGE:
                self._rest = data[self._send(data) :]
                if not self._rest:
                    return True
            elif self._queue_size and len(self._queue) == self._queue_size:
                self._queue.popleft()
                self._queue.append(data)
            else:
                self._queue.append(data)
            self._hand_over()
        return True

    def _send(self, data: bytes) -> int:
        """Number of bytes that the socket takes now."""
        link = self._connection
        try:
            # with a time-out, which rospy sets for its calls to the master, a socket waits in spite of MSG_DONTWAIT
            if link.socket.gettimeout() is not None and not _is_writable(link.socket):
                return 0
            sent = int(link.socket.send(data, socket.MSG_DONTWAIT))
        except BlockingIOError:
            return 0
        except (OSError, ValueError, AttributeError):  # the last two: it was closed meanwhile
            link.write_data(data)  # raises the error that the publisher expects
            return len(data)
        link.stat_bytes += sent
        link.stat_num_msg += sent == len(data)
        return sent

    def _hand_over(self) -> None:
        self._is_relaying = True
        if self._thread is None:
            self._thread = threading.Thread(target=self._relay, name=f"relay {self._connection.name}", daemon=True)
            self._thread.start()
        self._changed.notify()

    def _wake(self, _connection: Any) -> None:
        with self._changed:
            self._changed.notify()

    def _relay(self) -> None:
        while (data := self._next()) is not None:
            try:
                self._connection.write_data(data)
            except (TransportException, OSError, ValueError, AttributeError) as err:  # the last two: it was closed
                with self._changed:
                    self._error = err

    def _next(self) -> bytes | None:
        """Wait for a message to send; None when the connection has ended."""
        with self._changed:
            while not (self._rest or self._queue or self._connection.done):
                self._is_relaying = False
                self._changed.wait()
            if self._connection.done:
                return None
            if self._rest:
                data, self._rest = self._rest, b""
                return data
            return self._queue.popleft()


def _is_writable(sock: socket.socket) -> bool:
    poll = select.poll()
    poll.register(sock, select.POLLOUT)
    return bool(poll.poll(0))
