#!/usr/bin/env python3
"""Forged frames of a motion sensor with a key: how many are believed.

    benchmarks/forged_frames.py [--json FILE] [--frames 1000000] [--seed N]

Somebody between sensor and bridge sees all frames of this connection and of an earlier one, and has no key. Each forged
frame of a kind is checked where the bridge waits for the next true one. In the bridge the first one ends the connection
(test/process/rosserial/test_in_between.py); here the check goes on, so that every frame has its chance. A true frame
follows each thousand forged ones, and has to pass.
"""

from __future__ import annotations

import in_workspace  # noqa: F401 - first: it finds the interpreter

# isort: split
import argparse
import json
import random
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path

from rosbot_patrol.errors import ProtocolError
from rosbot_patrol.rosserial.protocol.packet import HEADER, encode
from rosbot_patrol.rosserial.protocol.signed import (
    FROM_BRIDGE,
    FROM_SENSOR,
    OVERHEAD,
    TAG_SIZE,
    Checker,
    Signer,
    session_key,
)

TOPIC = 125  # of motion triggers, the first that a sensor publishes
EVERY = 1000  # forged frames before each true one


class Wire:
    """Payloads that the attacker has seen, of both directions and of an earlier connection."""

    def __init__(self, draw: random.Random) -> None:
        self.draw = draw
        key = draw.randbytes(32)
        session = session_key(key, draw.randbytes(16), draw.randbytes(16), 3)
        earlier = session_key(key, draw.randbytes(16), draw.randbytes(16), 3)
        self.checker = Checker(session, FROM_SENSOR)
        self._signers = Signer(session, FROM_SENSOR), Signer(session, FROM_BRIDGE), Signer(earlier, FROM_SENSOR)
        self.past: list[bytes] = []
        self.next, self.reflected, self.earlier = self._sent()
        self.later = self._sent()[0]

    def go_on(self) -> None:
        """Let the true frame pass."""
        data = self.checker.check(TOPIC, self.next)
        assert data == self.next[:-OVERHEAD]
        self.past.append(self.next)
        self.next = self.later
        self.later, self.reflected, self.earlier = self._sent()

    def _sent(self) -> tuple[bytes, bytes, bytes]:
        frame = encode(TOPIC, bytes((3, self.draw.randrange(2))))
        sent = (signer.sign(frame)[HEADER:-1] for signer in self._signers)
        return next(sent), next(sent), next(sent)


def guessed(wire: Wire) -> tuple[int, bytes]:
    """The next frame with the opposite message and a drawn tag."""
    data = bytes((wire.next[0], wire.next[1] ^ 1))
    return TOPIC, data + wire.next[len(data) : -TAG_SIZE] + wire.draw.randbytes(TAG_SIZE)


def flipped(wire: Wire) -> tuple[int, bytes]:
    """The next frame with one bit changed."""
    frame = bytearray(wire.next)
    frame[wire.draw.randrange(len(frame))] ^= 1 << wire.draw.randrange(8)
    return TOPIC, bytes(frame)


def repeated(wire: Wire) -> tuple[int, bytes]:
    """One of the frames that came before."""
    return TOPIC, wire.draw.choice(wire.past)


def renumbered(wire: Wire) -> tuple[int, bytes]:
    """One of the frames before, with the number that is expected."""
    frame = wire.draw.choice(wire.past)
    return TOPIC, frame[:-OVERHEAD] + wire.next[-OVERHEAD:-TAG_SIZE] + frame[-TAG_SIZE:]


def early(wire: Wire) -> tuple[int, bytes]:
    """The frame after the next."""
    return TOPIC, wire.later


def elsewhere(wire: Wire) -> tuple[int, bytes]:
    """The next frame on another topic."""
    topic = wire.draw.randrange(1, 1 << 16)
    return topic + (topic == TOPIC), wire.next


def cut(wire: Wire) -> tuple[int, bytes]:
    """The next frame cut short, or with bytes added."""
    size = wire.draw.randrange(len(wire.next))
    return TOPIC, wire.next[:size] if wire.draw.random() < 0.5 else wire.next + wire.draw.randbytes(size + 1)


def reflected(wire: Wire) -> tuple[int, bytes]:
    """The bridge's own frame of the same number."""
    return TOPIC, wire.reflected


def earlier(wire: Wire) -> tuple[int, bytes]:
    """The frame of the same number of an earlier connection."""
    return TOPIC, wire.earlier


KINDS: tuple[Callable[[Wire], tuple[int, bytes]], ...] = (
    guessed,
    flipped,
    repeated,
    renumbered,
    early,
    elsewhere,
    cut,
    reflected,
    earlier,
)


def main() -> int:
    """Forge, count and print; the exit status is 1 if one was believed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", type=Path)
    parser.add_argument("--frames", type=int, default=1_000_000)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    draw = random.Random(options.seed)
    wire = Wire(draw)
    wire.go_on()
    tried, believed = Counter[str](), Counter[str]()
    start = time.perf_counter()
    for number in range(options.frames):
        if number % EVERY == EVERY - 1:
            wire.go_on()
        forge = KINDS[number % len(KINDS)]
        tried[forge.__name__] += 1
        try:
            wire.checker.check(*forge(wire))
        except ProtocolError:
            continue
        believed[forge.__name__] += 1
        wire = Wire(draw)  # its counter went on
        wire.go_on()
    for forge in KINDS:
        print(f"  {forge.__doc__:70} {tried[forge.__name__]:7} tried, {believed[forge.__name__]} believed")
    print(f"{options.frames} forged frames in {time.perf_counter() - start:.0f} s: {believed.total()} believed")
    if options.json:
        options.json.write_text(json.dumps({"forged_believed": believed.total()}))
    return 1 if believed else 0


if __name__ == "__main__":
    raise SystemExit(main())
