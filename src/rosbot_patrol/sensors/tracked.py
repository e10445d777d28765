"""State of one motion sensor, and its present problems."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

from rosbot_patrol.sensors.problems import Kind, Link, duration
from rosbot_patrol.sensors.sensor_file import SensorSpec
from rosbot_patrol.sensors.settings import WatchTimes

FRESH = 3.0  # a peer heard within this time is active [s]
REGULAR = 10  # messages without a gap after which an unlisted sensor is known to send heartbeats
TALKER = 5  # messages without a gap after which a sender is more than a manual test
MAX_SENDERS = 8
NEW_FOR = 600.0  # time for which a new address is reported [s]
BEATS = 4  # number of missed heartbeats that make a gap


@dataclass
class _Run:
    """Uninterrupted messages of one sender."""

    heard: float
    count: int = 1


@dataclass
class _Peer:
    """A connection on a bridge; known `since`, last `heard` [s]."""

    link: Link
    since: float
    heard: float


class Tracked:
    """State of one sensor id.

    Args:
        spec: its entry in the file, None for an unknown id.
        began: when it was first expected or heard [s].
        is_listed: a file names it.

    Attributes:
        address: from which it speaks, if it has shown no key; "" before it was heard. A caller may set what it was.
    """

    def __init__(self, spec: SensorSpec | None, times: WatchTimes, began: float, *, is_listed: bool) -> None:
        self.spec = spec
        self.began = began
        self.is_listed = is_listed
        self.heard: float | None = None
        self.steady_since = began
        self.motion: float | None = None
        self.motion_since = began
        self.messages = 0
        self.triggers = 0
        self.bridge = ""
        self.address = ""
        self._moved: tuple[float, str] | None = None  # since when it has a new address, and the one before
        self._times = times
        self._run = 0
        self._is_regular = False
        self._is_silent = False
        self._is_flapping = False
        self._is_away = False
        self._drops: deque[float] = deque(maxlen=max(times.flap_count, 2))
        self._senders: dict[str, _Run] = {}
        self._peers: dict[tuple[str, str], _Peer] = {}

    # -- messages

    def hear(self, sender: str, now: float, *, move: bool) -> None:
        """Record a message, published by the node `sender`."""
        if self.heard is None or now - self.heard > self._gap:
            self.steady_since, self._run = now, 0
        self.heard = now
        self._is_away = False
        self._run += 1
        self._is_regular = self._is_regular or self._run >= REGULAR
        self.messages += 1
        if move:
            self.triggers += 1
            if self.motion is None or now - self.motion > self._times.motion_pause:
                self.motion_since = now
            self.motion = now
        run = self._senders.get(sender)
        if run is None:
            if len(self._senders) >= MAX_SENDERS:
                del self._senders[min(self._senders, key=lambda name: self._senders[name].heard)]
            self._senders[sender] = _Run(now)
        else:
            run.count = run.count + 1 if now - run.heard <= self._gap else 1
            run.heard = now

    def link(self, bridge: str, links: list[Link], now: float, *, is_settled: bool = True) -> None:
        """Record the connections over which a bridge hears this sensor now.

        Args:
            bridge: its name.
            links: all of this sensor's on it.
            now: time [s].
            is_settled: False shortly after the bridge's start: new connections are then no fault of the sensor.
        """
        kept = {key: peer for key, peer in self._peers.items() if key[0] != bridge}
        for link in links:
            key = (bridge, link.peer)
            heard = now - max(link.heard, 0.0)
            known = self._peers.get(key)
            if known is None and self._peers and is_settled and not self._is_heard_elsewhere(key, now):
                self._drop(now)  # a new connection in the place of the one before
            kept[key] = _Peer(link, known.since if known else now, heard)
            if heard >= max((p.heard for p in self._peers.values()), default=heard):
                self.bridge = bridge
        if kept or not self._peers:
            self._peers = kept
        else:  # remember the last connection, to recognise the next one as new
            self._peers = dict([max(self._peers.items(), key=lambda item: item[1].heard)])

    def _note_address(self, host: str, now: float) -> None:
        """Remember from where a sensor without a key speaks: anybody can take its id, but hardly its address."""
        if self.address and host != self.address:
            self._moved = now, self.address
        self.address = host

    def _is_heard_elsewhere(self, key: tuple[str, str], now: float) -> bool:
        return any(other != key and now - peer.heard < 1.0 for other, peer in self._peers.items())

    def _drop(self, now: float) -> None:
        if not self._drops or now - self._drops[-1] > self._gap:
            self._drops.append(now)

    @property
    def _heartbeat(self) -> float:
        return self.spec.heartbeat if self.spec is not None else 0.5

    @property
    def _gap(self) -> float:
        return max(self._times.gap, BEATS * self._heartbeat)

    @property
    def silence(self) -> float:
        """Time without a message after which it is silent [s]."""
        return max(self._times.silent_after, BEATS * self._heartbeat)

    # -- evaluation

    @property
    def is_watched(self) -> bool:
        """Whether its silence means anything: a file lists it, or it has sent heartbeats."""
        expected = self.spec is not None and self.spec.enabled and self.spec.heartbeat > 0.0
        return expected and (self.is_listed or self._is_regular)

    def is_waiting(self, now: float) -> bool:
        """Whether it has not been heard yet, within start_grace."""
        return self.heard is None and now - self.began <= self._times.start_grace

    def peers(self, now: float) -> list[_Peer]:
        """Active connections, the oldest first."""
        return sorted((p for p in self._peers.values() if now - p.heard < FRESH), key=lambda p: p.since)

    @property
    def last_link(self) -> Link | None:
        """Connection of the last message."""
        return max(self._peers.values(), key=lambda p: p.heard).link if self._peers else None

    def tick(self, now: float, *, bridge_is_there: bool) -> dict[Kind, tuple[float, str]]:
        """Present problems: kind -> (since, text).

        Args:
            now: time [s].
            bridge_is_there: False if its bridge is silent, which is no fault of the sensor.
        """
        if self.spec is None or not self.spec.enabled:
            return {}
        quiet = now - self.heard if self.heard is not None else 0.0
        if self.is_watched and not self._is_away and self.heard is not None and quiet > self._gap:
            self._is_away = True
            if bridge_is_there:
                self._drop(now)
        found: dict[Kind, tuple[float, str]] = {}
        self._find_silence(now, found)
        self._find_flapping(now, found)
        self._find_motion(now, found)
        self._find_peers(now, found)
        return found

    def _find_silence(self, now: float, found: dict[Kind, tuple[float, str]]) -> None:
        if not self.is_watched:
            return
        if self.heard is None:
            if not self.is_waiting(now):
                self._is_silent = True
                found[Kind.SILENT] = (self.began, "is silent: it has not been heard since the start")
            return
        if now - self.heard > self.silence:
            self._is_silent = True
        elif self._is_silent and self._is_steady(now):
            self._is_silent = False
        if self._is_silent:
            back = "" if now - self.heard > self._gap else ", and only now again"
            found[Kind.SILENT] = (self.heard, f"is silent: nothing was heard for more than {self.silence:.0f} s{back}")

    def _is_steady(self, now: float) -> bool:
        heard = self.heard is not None and now - self.heard <= self._gap
        return heard and now - self.steady_since >= self._times.steady_after

    def _find_flapping(self, now: float, found: dict[Kind, tuple[float, str]]) -> None:
        drops, t = self._drops, self._times
        if len(drops) >= t.flap_count and drops[-1] - drops[-t.flap_count] <= t.flap_window:
            self._is_flapping = True
        if drops and now - drops[-1] > t.flap_calm:
            self._is_flapping = False
            drops.clear()
        if self._is_flapping:
            within = duration(drops[-1] - drops[0])
            found[Kind.FLAPPING] = (drops[0], f"comes and goes: {len(drops)} drop-outs within {within}")

    def _find_motion(self, now: float, found: dict[Kind, tuple[float, str]]) -> None:
        t = self._times
        if any(peer.link.is_stuck for peer in self.peers(now)):
            since = self.motion if self.motion is not None else now
            text = "is stuck: its output stays high, and it reports no further motion"
            found[Kind.STUCK_ON] = (since, text)
        elif self.motion is not None and now - self.motion <= t.motion_pause:
            lasted = self.motion - self.motion_since
            if lasted >= t.stuck_after:
                text = f"reports motion without a pause, for more than {duration(t.stuck_after)}"
                found[Kind.STUCK_ON] = (self.motion_since, text)
        if t.no_motion_after > 0.0 and self.is_watched and Kind.SILENT not in found and self.heard is not None:
            last = self.motion if self.motion is not None else self.began
            if now - last > t.no_motion_after:
                text = f"has reported no motion for more than {duration(t.no_motion_after)}"
                found[Kind.NO_MOTION] = (last, text)

    def _find_peers(self, now: float, found: dict[Kind, tuple[float, str]]) -> None:
        fresh = self.peers(now)
        bridges = {bridge for bridge, _ in self._peers}
        others = [
            (run.heard, f"the node {name}")
            for name, run in self._senders.items()
            if name not in bridges and run.count >= TALKER and now - run.heard < FRESH
        ]
        speakers = [(p.since, p.link.peer) for p in fresh] + others
        if len(speakers) > 1:
            names = " and ".join(name for _, name in speakers[:4])
            found[Kind.DUPLICATE_ID] = (max(since for since, _ in speakers), f"is reported by two at a time: {names}")
        if self.spec is None:
            return
        for peer in fresh:
            if not self.spec.may_speak_from(peer.link.host):
                text = f"speaks from {peer.link.host}, which its file does not allow"
                found[Kind.WRONG_PEER] = (peer.since, text)
        if len(fresh) == 1 and not fresh[0].link.proven:  # of two at a time nobody knows which is the sensor
            self._note_address(fresh[0].link.host, now)
        if self._moved is not None and now - self._moved[0] > NEW_FOR:
            self._moved = None
        if self._moved is not None and not self.spec.peers:
            text = f"speaks from {self.address}, and spoke from {self._moved[1]} before; it has no key"
            found[Kind.NEW_ADDRESS] = (self._moved[0], text)
        for peer in fresh:
            offset = peer.link.clock_offset
            if offset is not None and abs(offset) > self._times.clock_limit:
                found[Kind.CLOCK_OFF] = (peer.since, f"has a clock that is {clock_words(offset)}")


def clock_words(offset: float) -> str:
    """Clock offset for people."""
    return f"{duration(abs(offset))} {'ahead' if offset > 0.0 else 'behind'}"
