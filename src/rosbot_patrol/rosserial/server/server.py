"""The rosserial server: many devices on TCP ports, or one on a serial device, in one thread. Knows no ROS.

Differs from rosserial_python's RosSerialServer: any number of clients per port, IPv4 and IPv6, topics are requested at
once, half-open links are detected (keepalive, silence), and no client can delay another by what it sends or fails to
read.
"""

from __future__ import annotations

import logging
import selectors
import socket
import time
from collections.abc import Callable, Sequence

from rosbot_patrol.rosserial.protocol.topics import TX_STOP
from rosbot_patrol.rosserial.server.admission import Door, Limits
from rosbot_patrol.rosserial.server.byte_recorder import Tap
from rosbot_patrol.rosserial.server.client import Client, Link, listen, peer_names, tune
from rosbot_patrol.rosserial.server.dispatch import Dispatcher, Handler
from rosbot_patrol.rosserial.server.journal import Journal
from rosbot_patrol.rosserial.server.policy import Policy
from rosbot_patrol.rosserial.server.serial_port import SerialPort, why_closed
from rosbot_patrol.rosserial.server.session import Session

log = logging.getLogger(__name__)

READ_SIZE = 4096
READ_SIZE_LIMITED = 1024  # from a restricted client at a time, so that the others are not delayed
NO_LIMITS = Limits()
TICK = 0.25
ROUND = 0.002  # maximum work between two polls [s]
REOPEN_PERIOD = 3.0
REPLACE_AFTER = 1.5  # silence after which an old connection is closed for a new one of the same sensor [s]


def _has_sent(ready: tuple[selectors.SelectorKey, int]) -> float:
    client = ready[0].data
    return client.shared.debt if isinstance(client, Client) else -1.0


class SerialServer:
    """Serves devices until closed: call `run`, or `poll` in a loop.

    Attributes:
        clients: connected devices by their links; door: admission; journal: log about clients.

    Args:
        handler: the other side.
        policy: what devices may do.
        silence_timeout: silence after which a TCP client is disconnected [s].
        limits: on TCP clients.
        clock: monotonic time [s].
        tap: observer of all received bytes.
    """

    def __init__(
        self,
        handler: Handler,
        policy: Policy,
        *,
        silence_timeout: float = 15.0,
        limits: Limits = NO_LIMITS,
        clock: Callable[[], float] = time.monotonic,
        tap: Tap | None = None,
    ) -> None:
        self._tap = tap
        self.clients: dict[Link, Client] = {}
        self.journal = Journal()
        self._handler = handler
        self._policy = policy
        self._silence_timeout = silence_timeout
        self.door = Door(limits)
        self._read_size = READ_SIZE if policy.max_rate <= 0.0 else READ_SIZE_LIMITED
        self._dispatcher = Dispatcher(
            handler, policy, self.door, self.journal, hang_up=self._lose, on_new_sensor=self._find_older
        )
        self._clock = clock
        self._listeners: list[socket.socket] = []
        self._serial: tuple[str, int] | None = None
        self._serial_due = 0.0
        self._tick_due = 0.0
        self._accept_from = 0.0
        self._stopping = False
        self._left: list[tuple[selectors.SelectorKey, int]] = []  # ready at the last poll, but not served yet
        self._selector = selectors.DefaultSelector()
        self._wake_read, self._wake_write = socket.socketpair()
        self._wake_read.setblocking(False)
        self._wake_write.setblocking(False)
        self._selector.register(self._wake_read, selectors.EVENT_READ)

    def listen(self, ports: Sequence[int], host: str = "") -> list[int]:
        """Open TCP ports (0: any free one); returns them. Raises ProtocolError if one is not available."""
        for port in ports:
            listener = listen(port, host)
            self._listeners.append(listener)
            self._selector.register(listener, selectors.EVENT_READ)
        return [listener.getsockname()[1] for listener in self._listeners]

    def attach(self, path: str, baud: int) -> None:
        """Serve a serial device: at once when it appears, and every 3 s while it cannot be opened."""
        self._serial = (path, baud)

    def run(self) -> None:
        """Serve until `stop`."""
        while not self._stopping:
            self.poll(TICK)

    def stop(self) -> None:
        """Make `run` return; callable from any thread."""
        self._stopping = True
        self._wake()

    def send(self, client: Client, topic_id: int, data: bytes) -> None:
        """Queue a message for a device, from any thread; raises ProtocolError if it is too long."""
        client.put(topic_id, data)
        self._wake()

    def close(self) -> None:
        """Tell all devices to stop, and close everything."""
        for client in list(self.clients.values()):
            try:
                client.link.send(TX_STOP)
            except OSError as err:
                log.debug("%s: %s", client.peer, err)
            self._drop(client)
        for listener in self._listeners:
            listener.close()
        self._listeners.clear()
        self._selector.close()
        self._wake_read.close()
        self._wake_write.close()

    def poll(self, timeout: float) -> None:
        """Wait for at most `timeout` [s], and serve the clients that are ready.

        Clients of the address that has sent least come first. After a few milliseconds the sockets are polled again, so
        that a flood delays the others by no more. Clients not served yet come before others with the same count.
        """
        ready = self._selector.select(0.0 if self._left else timeout)
        if self._left:
            files = {key.fd for key, _ in self._left}
            ready = self._left + [each for each in ready if each[0].fd not in files]
            self._left = []
        if len(ready) > 1:
            ready.sort(key=_has_sent)
        until = self._clock() + ROUND
        for number, (key, mask) in enumerate(ready, start=1):
            self._serve(key, mask)
            if self._clock() > until:
                self._left = ready[number:]
                break
        now = self._clock()
        if now >= self._tick_due:
            self._tick_due = now + TICK
            self._tick(now)

    def _serve(self, key: selectors.SelectorKey, mask: int) -> None:
        if key.fileobj is self._wake_read:
            self._woken()
        elif isinstance(key.data, Client):
            if not key.data.closed and mask & selectors.EVENT_READ:
                self._read(key.data)
            self._flush(key.data)
        elif isinstance(key.fileobj, socket.socket):
            self._accept(key.fileobj)

    def _tick(self, now: float) -> None:
        if self._serial is not None and not self.clients and now >= self._serial_due:
            self._open_serial(*self._serial, now)
        if self._accept_from and now >= self._accept_from:
            self._accept_from = 0.0
            for listener in self._listeners:
                self._selector.register(listener, selectors.EVENT_READ)
        for client in list(self.clients.values()):
            if events := client.session.tick(now):
                self._dispatcher.take(client, events, now)
            if client.older:
                self._replace_older(client, now)
            if client.on_tcp and client.is_stuck(now):
                self._lose(client, "it reads nothing of what is sent to it")
            if client.has_to_do(now):
                self._flush(client)
        self._handler.tick()

    def _wake(self) -> None:
        try:
            self._wake_write.send(b"\0")
        except (BlockingIOError, OSError):
            return  # a wake-up is pending, or the server is closed

    def _woken(self) -> None:
        try:
            self._wake_read.recv(4096)
        except BlockingIOError:
            return
        for client in list(self.clients.values()):
            if client.wants_write:
                self._flush(client)

    def _open_serial(self, path: str, baud: int, now: float) -> None:
        self._serial_due = now + REOPEN_PERIOD
        try:
            port = SerialPort(path, baud)
        except OSError as err:
            is_absent = isinstance(err, FileNotFoundError)
            if is_absent:
                self._serial_due = now
            if self.journal.is_new("serial", now):
                then = "it is opened once it is there" if is_absent else f"trying again every {REOPEN_PERIOD:.0f} s"
                log.error("%s; %s", why_closed(path, err, device="the board", parameter="port"), then)
            return
        log.info("connected to %s at %d baud", path, baud)
        session = Session(self._policy, now, silence_timeout=None)
        self._add(Client(port, session, path, path, on_tcp=False), now)

    def _accept(self, listener: socket.socket) -> None:
        now = self._clock()
        try:
            link, address = listener.accept()
        except (BlockingIOError, ConnectionError):
            return
        except OSError as err:  # no file descriptors left: the listener would be reported as ready again and again
            if self.journal.is_new("accept", now):
                log.error("no further sensor can connect for now: %s", err)
            self._accept_from = now + 1.0
            for each in self._listeners:
                self._selector.unregister(each)
            return
        peer, host = peer_names(address)
        reason = self._turn_away(host, now)
        if reason is not None:
            link.close()
            self.journal.turn_away(peer, host, reason, now)
            return
        tune(link, restricted=self._policy.restricted)
        session = Session(self._policy, now, address=host, silence_timeout=self._silence_timeout)
        client = Client(link, session, peer, host)
        self.journal.come(client, now)
        self._add(client, now)

    def _turn_away(self, host: str, now: float) -> str | None:
        """Reason why a new connection is refused; None if it is accepted, after making room for it."""
        if not self._policy.may_connect(host):
            return "its address is not on the list (~allow_peers)"
        reason, leaver = self.door.ask(host, now)
        if leaver is not None:
            self.journal.turned_away += 1
            self.journal.refuse(leaver, "to wait any longer without a proof or a topic: others come", now)
            self._drop(leaver)
        return reason

    def _add(self, client: Client, now: float) -> None:
        self.clients[client.link] = client
        self.door.enter(client, now)
        if self._tap is not None:
            self._tap.opened(client)
        self._watch(client, selectors.EVENT_READ)
        self._flush(client)

    def _read(self, client: Client) -> None:
        now = self._clock()
        if wait := client.shared.spend(0.0, now):  # the other clients of its address have sent too much
            client.read_from = now + wait
            return
        try:
            data = client.link.recv(self._read_size)
        except BlockingIOError:
            return
        except OSError as err:
            self._lose(client, str(err))
            return
        if not data:
            self._lose(client, "it closed the connection")
            return
        if self._tap is not None:
            self._tap.data(client, data)
        self._dispatcher.take(client, client.session.receive(data, now), now)
        self._handler.flush()
        if not client.closed:
            of_address = client.shared.spend(client.session.cost, now)
            client.read_from = now + max(client.session.pause(now), of_address)

    def _flush(self, client: Client) -> None:
        """Send what can be sent, and update the selector's events."""
        if client.closed:
            return
        try:
            client.flush()
        except OSError as err:
            self._lose(client, str(err))
            return
        wanted = selectors.EVENT_WRITE if client.wants_write else 0
        if client.read_from <= self._clock():
            wanted |= selectors.EVENT_READ
        self._watch(client, wanted)

    def _watch(self, client: Client, wanted: int) -> None:
        if client.watched == wanted:
            return
        if client.watched and wanted:
            self._selector.modify(client.link, wanted, client)
        elif client.watched:
            self._selector.unregister(client.link)
        else:
            self._selector.register(client.link, wanted, client)
        client.watched = wanted

    def _lose(self, client: Client, reason: str | None) -> None:
        if client.closed:
            return
        if reason is not None and not self._stopping:
            self.journal.go(client, reason, self._clock())
        self._drop(client)

    def _drop(self, client: Client) -> None:
        client.closed = True
        if self._tap is not None:
            self._tap.closed(client)
        self._watch(client, 0)
        self.clients.pop(client.link, None)
        self.door.leave(client)
        client.link.close()
        self._handler.closed(client)

    def _find_older(self, client: Client) -> None:
        sensor = client.sensor
        same_id = [c for c in self.clients.values() if c.sensor_id == client.sensor_id and c.address == client.address]
        client.older = [c for c in same_id if c is not client and c.sensor == sensor]

    def _replace_older(self, client: Client, now: float) -> None:
        """Close stale connections of the same sensor, left after a loss of power or network."""
        for older in client.older:
            if not older.closed and now - older.session.last_frame > REPLACE_AFTER:
                self._lose(older, f"its sensor {older.sensor_id} came back as {client.peer}")
        client.older = [older for older in client.older if not older.closed]
