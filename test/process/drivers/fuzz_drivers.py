"""Feed the drivers' decoders damaged streams: whole streams of emulated devices, cut, spoilt and mixed anywhere.

usage: fuzz_drivers.py INPUTS [SEED]

A decoder may refuse what it cannot understand with ProtocolError or ImageError. Anything else ends the program with the
input as hexadecimal digits. Decoders of scans must also find good frames after the damage.
"""

from __future__ import annotations

import random
import sys
import time
from collections.abc import Callable, Iterator

import numpy as np

from rosbot_patrol.drivers.cameras.capture import jpeg_capture
from rosbot_patrol.drivers.cameras.multipart import PartReader
from rosbot_patrol.drivers.lds import lds01
from rosbot_patrol.drivers.rplidar.frames import FRAME_SIZES, FrameFinder
from rosbot_patrol.drivers.rplidar.protocol import AnswerReader, AnswerType, Command, descriptor, request
from rosbot_patrol.drivers.rplidar.samples import Decoder
from rosbot_patrol.drivers.rplidar.turns import Turns
from rosbot_patrol.errors import ImageError, ProtocolError
from rosbot_patrol.simulation.devices.rplidar import MODELS, RplidarDevice

Feed = Callable[[bytes], object]
BOUNDARY = "cut"
JPEG = b"\xff\xd8\xff\xe0\0\x10JFIF\0" + bytes(range(64)) + b"\xff\xd9"
PART = b"--cut\r\nContent-Type: image/jpeg\r\nContent-Length: %d\r\n\r\n" % len(JPEG) + JPEG + b"\r\n"


def ring(angle: np.ndarray) -> np.ndarray:
    """Distances [mm] by angle [degrees]."""
    return 1000.0 + angle


def scan_of(model: str) -> tuple[AnswerType, bytes]:
    """Kind and bytes of a stream of a few frames."""
    device = RplidarDevice(MODELS[model], ring)
    mode = device.kind.modes[device.kind.typical]
    device.feed(request(Command.EXPRESS_SCAN, bytes((device.kind.typical, 0, 0, 0, 0))), 0.0)
    return mode.answer, device.stream(0.05)


class ScanReader:
    """Frames, samples and turns of one kind."""

    def __init__(self, kind: AnswerType) -> None:
        self._finder, self._decoder, self._turns = FrameFinder(kind), Decoder(kind, 1e-4), Turns()

    def feed(self, data: bytes) -> int:
        """Decode; returns the good frames."""
        good = 0
        for frame in self._finder.feed(data):
            good += bool(frame)
            samples = self._decoder.feed(frame)
            if samples is not None:
                self._turns.feed(samples)
        return good


def targets() -> Iterator[tuple[str, bytes, Callable[[], Feed]]]:
    """Name, a good stream, and a maker of each decoder."""
    answers = descriptor(AnswerType.INFO, 20) + bytes(20) + descriptor(AnswerType.HEALTH, 3) + bytes(3)
    yield "answers", answers, lambda: AnswerReader().feed
    for model in ("A2", "A3", "C1", "S2", "HQ"):
        kind, stream = scan_of(model)
        yield f"scan of {model}", stream[: max(600, 2 * FRAME_SIZES[kind])], lambda kind=kind: ScanReader(kind).feed  # type: ignore[misc]
    room = np.linspace(0.5, 3.0, 360)
    yield "LDS-01", lds01.encode(room), lambda: lds01.TurnReader().feed
    yield "multipart", 4 * PART, lambda: PartReader(BOUNDARY, most=4096).feed
    yield "JPEG", JPEG, lambda: lambda data: jpeg_capture(data, 0.0)


def damaged(good: bytes, chance: random.Random) -> bytes:
    """A stream with some damage."""
    data = bytearray(good)
    for _ in range(chance.randrange(1, 5)):
        at = chance.randrange(len(data) + 1)
        what = chance.randrange(5)
        if what == 0 and at < len(data):
            data[at] ^= 1 << chance.randrange(8)
        elif what == 1:
            data[at:at] = chance.randbytes(chance.randrange(1, 20))
        elif what == 2:
            del data[at : at + chance.randrange(1, 60)]
        elif what == 3:
            data[at:] = data[chance.randrange(len(data) + 1) :]
        else:
            data[at:at] = good[chance.randrange(len(good)) :][:80]
    return bytes(data[:4000])


def pieces(data: bytes, chance: random.Random) -> list[bytes]:
    """The same, cut anywhere."""
    cuts = sorted(chance.randrange(len(data) + 1) for _ in range(chance.randrange(4)))
    return [data[a:b] for a, b in zip([0, *cuts], [*cuts, len(data)], strict=True)]


def main() -> None:
    """Run, and say how many inputs each decoder got."""
    inputs, seed = int(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 1
    chance, began = random.Random(seed), time.monotonic()
    known = list(targets())
    refused = dict.fromkeys((name for name, _, _ in known), 0)
    for number in range(inputs):
        name, good, make = known[number % len(known)]
        data, feed = damaged(good, chance), make()
        try:
            for piece in pieces(data, chance):
                feed(piece)
            if name.startswith(("scan", "LDS")) and not any(feed(good) for _ in range(3)):
                raise AssertionError("no good frame was found after the damage")
        except (ProtocolError, ImageError):
            refused[name] += 1
        except Exception:
            print(f"{name}, input {number} of seed {seed}: {data.hex()}", flush=True)
            raise
    share = ", ".join(f"{name} {count}" for name, count in refused.items())
    print(f"{inputs} inputs in {time.monotonic() - began:.0f} s, refused: {share}")


if __name__ == "__main__":
    main()
