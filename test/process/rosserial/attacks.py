"""What a stranger may try on the bridge's port, each as a function that ends by itself after some seconds.

Used by the tests (test_attack.py, test/rostest/test_serial_attack.py) and by benchmarks/rosserial_attack.py. Only for a
bridge of one's own on the loopback: each attack comes from the loopback address that it is given.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import socket
import struct
import threading
import time
from collections.abc import Callable

from rosbot_patrol.rosserial.protocol.packet import SYNC, Parser, checksum, encode
from rosbot_patrol.rosserial.protocol.proof import Prover
from rosbot_patrol.rosserial.protocol.topics import ESP_TRIGGER_MD5, TopicId, TopicInfo, pack_log, pack_topic_info

TRIGGER = "rosbot_patrol/EspTrigger"


def announce(name: str, message_type: str, topic_id: int, md5: str = ESP_TRIGGER_MD5, kind: int = 0) -> bytes:
    """A frame that announces a topic."""
    info = TopicInfo(topic_id=topic_id, name=name, message_type=message_type, md5=md5)
    return encode(kind, pack_topic_info(info))


class Stranger:
    """One connection to the bridge; whatever the bridge does with it is no error here."""

    def __init__(self, port: int, source: str = "127.0.0.66", *, small: bool = False) -> None:
        self.link = socket.socket()
        if small:
            self.link.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 2048)
        self.link.settimeout(1.0)
        self.link.bind((source, 0))
        self.is_open = True
        try:
            self.link.connect(("127.0.0.1", port))
        except OSError:
            self.is_open = False

    def say(self, data: bytes) -> bool:
        """Send; return whether the bridge still takes it."""
        if self.is_open:
            try:
                self.link.sendall(data)
            except TimeoutError:
                return True  # it reads no more for now
            except OSError:
                self.is_open = False
        return self.is_open

    def hear(self, seconds: float = 1.0) -> bytes:
        """What the bridge says within that time; b"" where it has hung up."""
        self.link.settimeout(max(seconds, 0.001))
        try:
            data = self.link.recv(65536)
        except TimeoutError:
            return b""
        except OSError:
            data = b""
        if not data:
            self.is_open = False
        return data

    def close(self, *, abruptly: bool = False) -> None:
        """Hang up, by a reset where `abruptly`."""
        if abruptly:
            with contextlib.suppress(OSError):
                self.link.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        self.link.close()


def again_and_again(port: int, source: str, seconds: float, frames: Callable[[int], bytes]) -> int:
    """Send what `frames` gives, connecting anew whenever the bridge hangs up; return how often something was sent."""
    until, count, stranger = time.monotonic() + seconds, 0, Stranger(port, source)
    while time.monotonic() < until:
        stranger.link.settimeout(0.1)  # the bridge reads slowly who says much
        if stranger.say(frames(count)):
            count += 1
        else:
            stranger.close()
            time.sleep(0.01)
            stranger = Stranger(port, source)
    stranger.close()
    return count


def publish_cmd_vel(port: int, source: str, seconds: float) -> int:
    """Drive the robot."""
    hello = announce("cmd_vel", "geometry_msgs/Twist", 126, "9f195f881246fdfa2798d1d3eebca84a")
    hello += announce("/cmd_vel", "geometry_msgs/Twist", 127, "9f195f881246fdfa2798d1d3eebca84a")
    return again_and_again(
        port, source, seconds, lambda _: hello + (encode(126, bytes(48)) + encode(127, bytes(48))) * 5
    )


def wrong_type(port: int, source: str, seconds: float) -> int:
    """Give /motion_trigger another type, or another checksum, and subscribe, offer and call what is there."""
    frames = announce("motion_trigger", "std_msgs/Bool", 126, "8b94c1b53db61fb6aed406028ad6332a") + encode(126, b"\x01")
    frames += announce("motion_trigger", TRIGGER, 127, "0" * 32) + encode(127, b"\xc9\x01")
    frames += (
        announce("motion_trigger", TRIGGER, 10) + announce("motion_trigger\n", TRIGGER, 128) + encode(128, b"\xc9\x01")
    )
    frames += announce("/rosout", "rosgraph_msgs/Log", 100, "acffd30cd6b6de30f120938c17c593fb", 1)
    frames += b"".join(
        announce("/rosout/get_loggers", "roscpp/GetLoggers", 129, "0" * 32, kind) for kind in (2, 3, 4, 5)
    )
    return again_and_again(port, source, seconds, lambda _: frames)


def foreign_id(port: int, source: str, seconds: float, sensor_id: int = 7) -> int:
    """Speak for a sensor that one is not."""
    hello = announce("motion_trigger", TRIGGER, 125)
    return again_and_again(port, source, seconds, lambda _: hello + encode(125, bytes((sensor_id, 1))) * 20)


def valid_triggers(port: int, source: str, seconds: float) -> int:
    """As many triggers as go, as sensors that nobody has, on as many connections as go."""
    frames = encode(125, b"\xc9\x01") * 100
    strangers = [Stranger(port, source) for _ in range(100)]
    for stranger in strangers:
        stranger.say(announce("motion_trigger", TRIGGER, 125))
        stranger.link.settimeout(0.001)
    until, count = time.monotonic() + seconds, 0
    while time.monotonic() < until:
        count += sum(stranger.say(frames) for stranger in strangers if stranger.is_open)
        time.sleep(0.005)
    for stranger in strangers:
        stranger.close()
    return count


def large_frames(port: int, source: str, seconds: float) -> int:
    """Frames of 65 kB and of 32 kB with good checksums."""
    frames = []
    for size in (65535, 32767):
        length, body = struct.pack("<H", size), b"\x7d\x00" + bytes(size)
        frames.append(SYNC + length + bytes((checksum(length),)) + body + bytes((checksum(body),)))
    return again_and_again(port, source, seconds, lambda i: announce("motion_trigger", TRIGGER, 125) + frames[i % 2])


def many_topics(port: int, source: str, seconds: float, count: int = 1_000_000) -> int:
    """Up to a million topics under names of their own, on a new connection whenever the bridge reads no more."""
    until, sent = time.monotonic() + seconds, 0
    stranger = Stranger(port, source)
    while sent < count and time.monotonic() < until:
        names = range(sent, min(sent + 100, count))
        frames = b"".join(announce(f"t{n}_" + "x" * 180, "std_msgs/Bool", 200 + n % 60000) for n in names)
        stranger.link.settimeout(0.005)
        began = time.monotonic()
        is_taken = stranger.say(frames)
        sent += len(names)
        if not is_taken or time.monotonic() - began > 0.004:
            stranger.close(abruptly=True)
            stranger = Stranger(port, source)
    stranger.close()
    return sent


def slow_bytes(port: int, source: str, seconds: float) -> int:
    """Frames that arrive byte by byte and never end, on many connections."""
    frame = announce("motion_trigger", TRIGGER, 125) + encode(125, bytes(500))[:-1]
    strangers = [Stranger(port, source) for _ in range(100)]
    until, at = time.monotonic() + seconds, 0
    while time.monotonic() < until:
        for stranger in strangers:
            stranger.say(frame[at % len(frame) : at % len(frame) + 1])
        at += 1
        time.sleep(0.05)
    for stranger in strangers:
        stranger.close()
    return at


def half_open(port: int, source: str, seconds: float) -> int:
    """Connections on which nothing is ever said, a thousand at a time, and then reset."""
    until, count = time.monotonic() + seconds, 0
    while time.monotonic() < until:
        strangers = [Stranger(port, source) for _ in range(300)]
        count += len(strangers)
        time.sleep(0.3)
        for stranger in strangers:
            stranger.close(abruptly=True)
    return count


def connect_flood(port: int, source: str, seconds: float) -> int:
    """Connect and hang up as fast as it goes."""
    until, count = time.monotonic() + seconds, 0
    while time.monotonic() < until:
        Stranger(port, source).close(abruptly=True)
        count += 1
    return count


def never_read(port: int, source: str, seconds: float) -> int:
    """Ask for the time all the time, and never read the answer."""
    frames = encode(TopicId.TIME, bytes(8)) * 64
    strangers = [Stranger(port, source, small=True) for _ in range(30)]
    for stranger in strangers:
        stranger.say(announce("motion_trigger", TRIGGER, 125))
        stranger.link.settimeout(0.001)
    until, count = time.monotonic() + seconds, 0
    while time.monotonic() < until:
        count += sum(stranger.say(frames) for stranger in strangers)
        time.sleep(0.01)
    for stranger in strangers:
        stranger.close()
    return count


def garbage(port: int, source: str, seconds: float) -> int:
    """Bytes by chance, and bytes that look like the beginnings of frames."""
    pieces = [os.urandom(8192), SYNC * 4096, (SYNC + b"\x10\x00\xef") * 1600, b"GET / HTTP/1.1\r\n" * 500]
    return again_and_again(port, source, seconds, lambda i: pieces[i % len(pieces)])


def prying(port: int, source: str, seconds: float) -> int:
    """Ask for parameters, and write into the log what looks like somebody else's lines."""
    name = b"/rosbot/secret"
    frames = encode(TopicId.PARAMETER_REQUEST, len(name).to_bytes(4, "little") + name)
    frames += encode(TopicId.LOG, pack_log(4, "x\n[FATAL] [serial_node]: the house burns\x1b[2J"))
    return again_and_again(port, source, seconds, lambda _: frames * 10)


def challenge_of(stranger: Stranger) -> bytes:
    """What the bridge wants answered."""
    packets = Parser().feed(stranger.hear())
    return packets[0].data if packets else b""


def false_proofs(port: int, source: str, seconds: float, overheard: bytes = b"", key: bytes = bytes(range(32))) -> int:
    """Proofs: overheard ones again, by another key, for another id, cut off, and none at all before the topics."""
    until, count = time.monotonic() + seconds, 0
    while time.monotonic() < until:
        stranger = Stranger(port, source)
        challenge = challenge_of(stranger)
        if len(challenge) == 33:
            tries = [
                overheard or Prover(2, key).answer(bytes((1,)) + bytes(32)),
                Prover(2, key[::-1]).answer(challenge),
                Prover(7, key).answer(challenge),
                Prover(2, key).answer(challenge)[:-20],
                announce("motion_trigger", TRIGGER, 125) + encode(125, b"\x02\x01"),
            ]
            stranger.say(tries[count % len(tries)])
            stranger.say(announce("motion_trigger", TRIGGER, 125) + encode(125, b"\x02\x01") + encode(10, bytes(8)))
            count += 1
        stranger.close()
    return count


ATTACKS: dict[str, Callable[[int, str, float], int]] = {
    "publish /cmd_vel": publish_cmd_vel,
    "wrong type, checksum, direction": wrong_type,
    "another sensor's id": foreign_id,
    "valid triggers, 100 connections": valid_triggers,
    "frames of 65 kB": large_frames,
    "a million topics": many_topics,
    "slow bytes, 100 connections": slow_bytes,
    "half-open, 300 connections": half_open,
    "connect and hang up": connect_flood,
    "never reads, 30 connections": never_read,
    "garbage": garbage,
    "parameters and log lines": prying,
    "false and replayed proofs": false_proofs,
}


def main() -> None:
    """Attack a bridge on the loopback: all at once, or one after the other."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("port", type=int)
    parser.add_argument("--source", default="127.0.0.66", help="loopback address to come from (default: %(default)s)")
    parser.add_argument("--seconds", type=float, default=5.0, help="of each attack")
    parser.add_argument("--sources", type=int, default=1, help="from so many addresses, the next ones too")
    parser.add_argument("--only", choices=sorted(ATTACKS), help="one of them instead of all at once")
    options = parser.parse_args()
    names = [options.only] if options.only else list(ATTACKS)
    first, last = options.source.rsplit(".", 1)
    sources = [f"{first}.{int(last) + i}" for i in range(options.sources)]
    counts = dict.fromkeys(names, 0)

    def run(name: str, source: str) -> None:
        counts[name] += ATTACKS[name](options.port, source, options.seconds)

    threads = [threading.Thread(target=run, args=(n, source), daemon=True) for n in names for source in sources]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(options.seconds + 30.0)
    for name, count in counts.items():
        print(f"{name}: {count}", flush=True)


if __name__ == "__main__":
    main()
