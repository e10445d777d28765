"""A virtual ESP32 with a motion sensor: connects to the bridge over TCP as the tutorial's sketch does.

Publishes `motion_trigger` under id 125 (100 + the 25 subscribers that the sketch reserves): a heartbeat
`{id, move: false}` at 2 Hz, and `{id, move: true}` at once when motion begins.

Its frames may pass a poor link (`set_link`): they are delayed or lost, in real time, and the link breaks.

Differs: the sketch reports motion with the next heartbeat, up to 0.5 s late, and publishes before it has negotiated.
"""

from __future__ import annotations

import logging
import select
import socket
import threading
import time

from rosbot_patrol.rosserial.device.client_session import (
    Configured,
    DeviceEvent,
    DeviceSession,
    NotTrusted,
    Unconfigured,
)
from rosbot_patrol.rosserial.device.device_log import STUCK_AFTER, WARN, stuck_line
from rosbot_patrol.rosserial.device.poor_link import PERFECT, LinkQuality, PoorLink
from rosbot_patrol.rosserial.protocol.proof import Prover
from rosbot_patrol.rosserial.protocol.topics import ESP_TRIGGER_MD5, ESP_TRIGGER_TYPES, TopicInfo, pack_esp_trigger

log = logging.getLogger(__name__)

PUBLISHER_ID = 125
HEARTBEAT_PERIOD = 0.5
RETRY_FIRST, RETRY_LAST = 0.2, 3.0
CONNECT_TIMEOUT = 3.0
SEND_TIMEOUT = 5.0

_TOPIC = TopicInfo(topic_id=PUBLISHER_ID, name="motion_trigger", message_type=ESP_TRIGGER_TYPES[0], md5=ESP_TRIGGER_MD5)


def _readable(timeout: float, *sockets: socket.socket) -> list[socket.socket]:
    """Sockets that are readable within `timeout` [s]; uses poll, because select is limited to 1024 files."""
    poll = select.poll()
    by_fd = {sock.fileno(): sock for sock in sockets}
    for fd in by_fd:
        poll.register(fd, select.POLLIN)
    return [by_fd[fd] for fd, _ in poll.poll(max(timeout, 0.0) * 1000.0)]


class EspClient:
    """One sensor on its own thread; every method may be called from any thread, and none blocks.

    Args:
        host: name or address of the bridge, IPv4 or IPv6; port: its TCP port.
        sensor_id: 0 to 255, the room that it watches.
        heartbeat_period: wall time between two heartbeats [s].
        stuck_after: time after which a high output is logged as stuck [s].
        key: 32 bytes that prove the sensor's identity to a bridge with keys.
        insist: talk only to a bridge that has proved that it has the key.
        source: address to connect from, empty: the system's choice.
    """

    def __init__(
        self,
        host: str,
        port: int,
        sensor_id: int,
        *,
        heartbeat_period: float = HEARTBEAT_PERIOD,
        key: bytes | None = None,
        insist: bool = False,
        source: str = "",
        stuck_after: float = STUCK_AFTER,
    ) -> None:
        if not 0 <= sensor_id <= 255:
            raise ValueError(f"sensor id {sensor_id} does not fit into a byte")
        self.host, self.port, self.sensor_id = host, port, sensor_id
        self._heartbeat_period = heartbeat_period
        self._key = key
        self._insist = insist
        self._source = (source, 0) if source else None
        self._logged_reason = ""
        self._stuck_after = stuck_after
        self._high_since = 0.0
        self._is_stuck_logged = False  # on this connection
        self._lock = threading.Lock()
        self._motion = False
        self._pending = False  # a motion not sent yet
        self._receipt: int | None = None  # of a sent motion, until the bridge has acknowledged it
        self._stopping = False
        self._reboot = False
        self._quality = PERFECT
        self._line = PoorLink(PERFECT, time.monotonic())
        self._connected = threading.Event()
        self._wake_read, self._wake_write = socket.socketpair()
        self._wake_read.setblocking(False)
        self._wake_write.setblocking(False)
        self._thread = threading.Thread(target=self._run, name=f"esp{sensor_id}", daemon=True)

    def start(self) -> EspClient:
        """Start connecting; return self."""
        self._thread.start()
        return self

    def stop(self, timeout: float = 2.0) -> None:
        """Disconnect and end the thread."""
        self._stopping = True
        self._wake()
        if self._thread.is_alive() and threading.current_thread() is not self._thread:
            self._thread.join(timeout)

    @property
    def connected(self) -> bool:
        """Whether the bridge knows the sensor's topic, so that a trigger is sent at once."""
        return self._connected.is_set()

    def wait_connected(self, timeout: float) -> bool:
        """Wait until `connected`; return whether it is."""
        return self._connected.wait(timeout)

    def set_motion(self, active: bool) -> None:
        """Set the level of the sensor's output; a rising edge is reported at once, or when connected."""
        with self._lock:
            rising = active and not self._motion
            self._motion = active
            if rising:
                self._pending = True
                self._high_since = time.monotonic()
            self._is_stuck_logged = self._is_stuck_logged and active
        if rising:
            self._wake()

    def trigger(self) -> None:
        """Report one motion, whatever the level is."""
        with self._lock:
            self._pending = True
        self._wake()

    def reboot(self) -> None:
        """Drop the link without closing it and forget everything but the id, as a reset does."""
        with self._lock:
            self._pending = self._motion = False
            self._receipt = None
        self._reboot = True
        self._wake()

    def set_link(self, quality: LinkQuality) -> None:
        """Send over a link of this quality from now on."""
        self._quality = quality
        self._wake()

    def _wake(self) -> None:
        try:
            self._wake_write.send(b"\0")
        except (BlockingIOError, OSError):
            return  # a wake-up is already pending, or the client has stopped

    def _drain_wake(self) -> None:
        try:
            self._wake_read.recv(64)
        except BlockingIOError:
            return

    def _run(self) -> None:
        retry = RETRY_FIRST
        while not self._stopping:
            try:
                link = socket.create_connection((self.host, self.port), CONNECT_TIMEOUT, self._source)
            except OSError as err:
                log.debug("sensor %d: %s:%d: %s", self.sensor_id, self.host, self.port, err)
                self._pause(retry)
                retry = min(retry * 1.6, RETRY_LAST)
                continue
            began = time.monotonic()
            try:
                self._serve(link)
            except OSError as err:
                log.debug("sensor %d: link to %s:%d lost: %s", self.sensor_id, self.host, self.port, err)
            finally:
                self._connected.clear()
                link.close()
                self._report_again()
            retry = RETRY_FIRST if time.monotonic() - began > RETRY_LAST else min(retry * 1.6, RETRY_LAST)
            if not self._stopping:
                self._pause(retry)
        self._wake_read.close()
        self._wake_write.close()

    def _pause(self, seconds: float) -> None:
        """Wait, but return at once when the client is stopped."""
        until = time.monotonic() + seconds
        while not self._stopping and (left := until - time.monotonic()) > 0:
            if _readable(left, self._wake_read):
                self._drain_wake()
                if self._pending:
                    return

    def _serve(self, link: socket.socket) -> None:
        """Communicate until the link ends, or the client is stopped or rebooted."""
        self._reboot = False
        link.settimeout(SEND_TIMEOUT)
        link.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        link.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
        prover = Prover(self.sensor_id, self._key) if self._key is not None else None
        session = DeviceSession([_TOPIC], prover=prover, insist=self._insist)
        self._line.begin(time.monotonic())
        self._is_stuck_logged = False
        heartbeat_due = time.monotonic()
        while not self._stopping and not self._reboot:
            now = time.monotonic()
            events = session.tick(now)
            heartbeat_due = self._publish_due(session, now, heartbeat_due)
            self._send(link, session, now)
            if self._line.breaks(now):
                log.debug("sensor %d: the link breaks, as it is told to", self.sensor_id)
                return
            due = min(heartbeat_due if session.configured else now + 1.0, self._line.next_event)
            wait = max(due - time.monotonic(), 0.0)
            ready = _readable(wait, link, self._wake_read)
            if self._wake_read in ready:
                self._drain_wake()
            if link in ready:
                try:
                    data = link.recv(4096)
                except ConnectionResetError:
                    data = b""
                if not data:
                    self._note(session.closed())
                    return
                events += session.receive(data, time.monotonic())
            if not self._note(events):
                return

    def _send(self, link: socket.socket, session: DeviceSession, now: float) -> None:
        """Send the frames that have passed the link."""
        self._line.change(self._quality, now)
        for frame in session.take_output():
            self._line.put(frame, now)
        for frame in self._line.take(now):
            link.sendall(frame)

    def _report_again(self) -> None:
        """Repeat a motion sent just before the link ended: better twice than never."""
        with self._lock:
            self._pending = self._pending or self._receipt is not None
            self._receipt = None

    def _publish_due(self, session: DeviceSession, now: float, heartbeat_due: float) -> float:
        """Send what is due; return the time of the next heartbeat."""
        if not session.configured:
            return now
        with self._lock:
            is_motion, self._pending = self._pending, False
            if is_motion:
                session.publish(PUBLISHER_ID, pack_esp_trigger(self.sensor_id, True))
                self._receipt = session.request_receipt(now)
            elif self._receipt is not None and session.has_receipt(self._receipt):
                self._receipt = None
        if not is_motion:
            if now < heartbeat_due:
                return heartbeat_due
            session.publish(PUBLISHER_ID, pack_esp_trigger(self.sensor_id, False))
            self._tell_stuck(session, now)
        return now + self._heartbeat_period

    def _tell_stuck(self, session: DeviceSession, now: float) -> None:
        """Log a stuck output once per connection."""
        lasted = now - self._high_since
        if self._motion and not self._is_stuck_logged and lasted > self._stuck_after:
            self._is_stuck_logged = session.log(WARN, stuck_line(self.sensor_id, lasted))

    def _note(self, events: list[DeviceEvent]) -> bool:
        """Process an event; returns whether to keep this connection."""
        for event in events:
            if isinstance(event, Configured):
                self._connected.set()
                self._logged_reason = ""
            elif isinstance(event, NotTrusted):
                if event.reason != self._logged_reason:  # log it once, as the next attempt will fail in the same way
                    self._logged_reason = event.reason
                    log.warning("sensor %d: %s:%d: %s", self.sensor_id, self.host, self.port, event.reason)
                return False
            elif isinstance(event, Unconfigured):
                self._connected.clear()
                log.info("sensor %d: %s", self.sensor_id, event.reason)
                if event.is_gone:  # frames still held are sent on the next link
                    return False
        return True
