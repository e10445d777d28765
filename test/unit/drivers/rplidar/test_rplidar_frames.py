"""Requests, answers and frames, byte by byte, by vectors that Slamtec's own SDK confirmed."""

from __future__ import annotations

import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rosbot_patrol.drivers.rplidar import ultra
from rosbot_patrol.drivers.rplidar.frames import FRAME_SIZES, FrameFinder, capsule_checksum
from rosbot_patrol.drivers.rplidar.protocol import Answer, AnswerReader, AnswerType, Command, descriptor, request
from rosbot_patrol.drivers.rplidar.samples import Decoder
from rosbot_patrol.errors import ProtocolError


@pytest.mark.parametrize(
    ("command", "payload", "expected"),
    [
        (Command.STOP, b"", "a5 25"),
        (Command.RESET, b"", "a5 40"),
        (Command.GET_INFO, b"", "a5 50"),
        (Command.GET_HEALTH, b"", "a5 52"),
        (Command.SCAN, b"", "a5 20"),
        (Command.EXPRESS_SCAN, bytes(5), "a5 82 05 00 00 00 00 00 22"),
        (Command.EXPRESS_SCAN, bytes((2, 0, 0, 0, 0)), "a5 82 05 02 00 00 00 00 20"),
        (Command.SET_MOTOR_PWM, struct.pack("<H", 660), "a5 f0 02 94 02 c1"),
        (Command.SET_MOTOR_RPM, struct.pack("<H", 600), "a5 a8 02 58 02 55"),
        (Command.GET_MOTOR_FLAGS, bytes(4), "a5 ff 04 00 00 00 00 5e"),
        (Command.GET_CONF, struct.pack("<I", 0x70), "a5 84 04 70 00 00 00 55"),
    ],
)
def test_requests(command: Command, payload: bytes, expected: str) -> None:
    assert request(command, payload).hex(" ") == expected


def test_a_request_that_cannot_be_made_is_refused() -> None:
    with pytest.raises(ProtocolError, match="0x25 takes no payload"):
        request(Command.STOP, b"x")
    with pytest.raises(ProtocolError, match="at most 255 bytes, not 256"):
        request(Command.GET_CONF, bytes(256))


@pytest.mark.parametrize(
    ("kind", "expected"),
    [
        (AnswerType.NODES, "a5 5a 05 00 00 40 81"),
        (AnswerType.EXPRESS, "a5 5a 54 00 00 40 82"),
        (AnswerType.ULTRA, "a5 5a 84 00 00 40 84"),
        (AnswerType.DENSE, "a5 5a 54 00 00 40 85"),
        (AnswerType.ULTRA_DENSE, "a5 5a aa 00 00 40 86"),
        (AnswerType.HQ, "a5 5a 0d 03 00 40 83"),
    ],
)
def test_descriptors_of_streams(kind: AnswerType, expected: str) -> None:
    assert descriptor(kind, FRAME_SIZES[kind], is_stream=True).hex(" ") == expected


INFO = descriptor(AnswerType.INFO, 4) + b"\x18\x1d\x01\x05"
HEALTH = descriptor(AnswerType.HEALTH, 3) + b"\0\0\0"
NOISE = b"\xa5\xa5\x5arubbish\xa5"  # holds what looks like a descriptor of a huge answer


@pytest.mark.parametrize("split", range(len(NOISE + INFO + HEALTH) + 1))
def test_answers_are_found_behind_noise_wherever_the_stream_is_cut(split: int) -> None:
    reader = AnswerReader()
    sent = NOISE + INFO + HEALTH
    found = reader.feed(sent[:split]) + reader.feed(sent[split:])
    assert found == [Answer(AnswerType.INFO, b"\x18\x1d\x01\x05"), Answer(AnswerType.HEALTH, b"\0\0\0")]
    assert reader.skipped == len(NOISE)


def test_what_follows_the_descriptor_of_a_stream_is_the_stream() -> None:
    reader = AnswerReader()
    begin = descriptor(AnswerType.EXPRESS, 84, is_stream=True)
    assert reader.feed(INFO + begin + b"abc")[1] == Answer(AnswerType.EXPRESS, b"abc", is_stream=True)
    assert reader.feed(INFO) == [Answer(AnswerType.EXPRESS, INFO, is_stream=True)]
    reader.reset()
    assert reader.feed(INFO) == [Answer(AnswerType.INFO, b"\x18\x1d\x01\x05")]


def capsule(body: bytes) -> bytes:
    total = capsule_checksum(bytes(2) + body)
    return bytes((0xA0 | total & 15, 0x50 | total >> 4)) + body


def express_vector(*, is_new_scan: bool = True) -> bytes:
    start = 350 * 64 | (0x8000 if is_new_scan else 0)
    cabins = b"".join(struct.pack("<HHB", (4000 + k * 8) | 1, (8000 + k * 8) | 2, 0x21) for k in range(16))
    return capsule(struct.pack("<H", start) + cabins)


NEXT = capsule(struct.pack("<H", 2 * 64) + bytes(80))


def test_the_vector_of_an_express_capsule() -> None:
    decoder = Decoder(AnswerType.EXPRESS, 250e-6)
    frame = express_vector(is_new_scan=True)
    assert frame.hex().startswith("a75580d7a10f421f21a90f4a1f21")
    assert decoder.feed(frame).is_new_scan
    samples = decoder.feed(NEXT)
    angle_q6 = [22264, 22152, 22312, 22200]
    assert samples.angle[:4].tolist() == [(each << 8) // 90 for each in angle_q6]
    assert samples.distance[:4].tolist() == [4000, 8000, 4008, 8008]
    assert np.flatnonzero(samples.is_first).tolist() == [26]
    assert (int(samples.angle[26]), int(samples.distance[26])) == ((22888 << 8) // 90, 4104)
    assert set(samples.quality.tolist()) == {0x2F << 2}


@pytest.mark.parametrize(
    ("distance", "code", "decoded"),
    [(511, 511, 511), (513, 512, 512), (2047, 1279, 2046), (4095, 1791, 4092), (20000, 3554, 20000)],
)
def test_distances_of_ultra_capsules(distance: int, code: int, decoded: int) -> None:
    assert ultra.encode(np.array([distance]))[0].tolist() == [code]
    assert ultra.decode(np.array([code]))[0].tolist() == [decoded]


@pytest.mark.parametrize("spoilt", [False, True])
def test_a_spoilt_capsule_costs_two_and_not_the_scan(spoilt: bool) -> None:
    frames = [express_vector(is_new_scan=False)] * 5
    if spoilt:
        frames[2] = frames[2][:40] + bytes((frames[2][40] ^ 0xFF,)) + frames[2][41:]
    finder, decoder = FrameFinder(AnswerType.EXPRESS), Decoder(AnswerType.EXPRESS, 250e-6)
    decoded = [decoder.feed(each) for each in finder.feed(b"".join(frames))]
    assert sum(each is not None for each in decoded) == (2 if spoilt else 4)
    assert finder.spoilt >= spoilt


@pytest.mark.parametrize("cut", range(1, 84, 7))
def test_half_a_capsule_is_skipped(cut: int) -> None:
    finder = FrameFinder(AnswerType.EXPRESS)
    whole = express_vector()
    found = [each for each in finder.feed(whole[cut:] + whole + whole) if each]
    assert found == [whole, whole]


@pytest.mark.parametrize("skipped", range(1, 5))
def test_standard_nodes_are_found_again_after_lost_bytes(skipped: int) -> None:
    finder = FrameFinder(AnswerType.NODES)
    nodes = b"".join(struct.pack("<BHH", 0x3E, at << 1 | 1, 4000) for at in range(2, 40))
    block = b"".join(finder.feed(nodes[skipped:]))
    assert block.endswith(nodes[-100:])
    assert len(block) % 5 == 0


@given(st.binary(max_size=600), st.sampled_from(sorted(FRAME_SIZES)), st.integers(1, 80))
def test_noise_is_no_frame_and_never_an_error(noise: bytes, kind: AnswerType, cut: int) -> None:
    reader, finder, decoder = AnswerReader(), FrameFinder(kind), Decoder(kind, 1e-4)
    reader.feed(noise)
    for at in range(0, len(noise), cut):
        for frame in finder.feed(noise[at : at + cut]):
            decoder.feed(frame)
