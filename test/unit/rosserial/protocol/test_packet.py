import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rosbot_patrol.errors import ProtocolError
from rosbot_patrol.rosserial.protocol.packet import MAX_PAYLOAD, Packet, Parser, encode
from rosbot_patrol.rosserial.protocol.topics import (
    ESP_TRIGGER_MD5,
    REQUEST_TOPICS,
    TX_STOP,
    TopicInfo,
    pack_esp_trigger,
    pack_time,
    pack_topic_info,
)

TRIGGER = bytes.fromhex("fffe0200fd7d0002017f")
ESP_INFO = TopicInfo(topic_id=125, name="motion_trigger", message_type="rosbot_patrol/EspTrigger", md5=ESP_TRIGGER_MD5)


def test_byte_vectors_of_upstream():
    assert bytes.fromhex("fffe0000ff0000ff") == REQUEST_TOPICS
    assert bytes.fromhex("fffe0000ff0b00f4") == TX_STOP
    assert encode(125, pack_esp_trigger(2, True)) == TRIGGER
    assert encode(10, pack_time(0, 0)) == bytes.fromhex("fffe0800f70a000000000000000000f5")
    expected = (
        bytes.fromhex("fffe5800a70000" + "7d00" + "0e000000")
        + b"motion_trigger"
        + bytes.fromhex("18000000")
        + b"rosbot_patrol/EspTrigger"
        + bytes.fromhex("20000000")
        + b"95f4bf9b776b2424e3a9da1182e3a9d2"
        + bytes.fromhex("00020000d4")
    )
    assert encode(0, pack_topic_info(ESP_INFO)) == expected


def test_frame_in_single_bytes():
    parser = Parser()
    packets = [packet for byte in TRIGGER for packet in parser.feed(bytes([byte]))]
    assert packets == [Packet(125, b"\x02\x01")]
    assert parser.garbage == 0
    assert parser.pending == 0


def test_garbage_before_between_and_after():
    parser = Parser()
    assert len(parser.feed(b"hello" + TRIGGER + b"\xff\xff\xfe\x00" + TRIGGER + b"\xff")) == 2
    assert parser.garbage == 5 + 4
    assert parser.feed(TRIGGER[1:]) == [Packet(125, b"\x02\x01")]


def test_frame_cut_off_costs_itself_only():
    parser = Parser()
    torn = encode(125, bytes(30))[:20]
    assert len(parser.feed(torn + TRIGGER * 4)) == 4
    assert parser.bad_checksums == 1


def test_truncated_frame_is_given_up_and_the_frame_inside_it_found():
    parser = Parser()
    assert parser.feed(encode(125, bytes(500))[:8] + TRIGGER) == []
    assert parser.give_up() == [Packet(125, b"\x02\x01")]
    assert parser.give_up() == []


@pytest.mark.parametrize("position", range(2, len(TRIGGER)))
def test_any_flipped_bit_is_noticed(position):
    for bit in range(8):
        damaged = bytearray(TRIGGER)
        damaged[position] ^= 1 << bit
        parser = Parser(max_payload=64)
        assert Packet(125, b"\x02\x01") not in parser.feed(bytes(damaged))


def test_oversized_frame_is_not_buffered():
    parser = Parser(max_payload=512)
    assert parser.feed(encode(125, bytes(5000)) + TRIGGER) == [Packet(125, b"\x02\x01")]
    assert parser.oversized == 1
    assert parser.pending == 0


def test_longest_frame_and_one_more():
    assert Parser().feed(encode(200, bytes(MAX_PAYLOAD))) == [Packet(200, bytes(MAX_PAYLOAD))]
    with pytest.raises(ProtocolError, match="32768 bytes for topic id 200"):
        encode(200, bytes(MAX_PAYLOAD + 1))


@given(
    parts=st.lists(
        st.one_of(
            st.binary(max_size=40).map(lambda data: (None, data)),
            st.tuples(st.integers(0, 65535), st.binary(max_size=60)),
        ),
        max_size=12,
    ),
    cuts=st.integers(1, 17),
)
def test_any_bytes_are_bounded_and_cutting_changes_nothing(parts, cuts):
    stream = b"".join(data if topic is None else encode(topic, data) for topic, data in parts)
    whole, pieces = Parser(max_payload=128), Parser(max_payload=128)
    packets = whole.feed(stream)
    cut = [p for at in range(0, len(stream), cuts) for p in pieces.feed(stream[at : at + cuts])]
    assert cut == packets
    assert pieces.pending == whole.pending <= 128 + 8
    used = sum(len(encode(*packet)) for packet in packets)
    assert used + whole.garbage + whole.pending == len(stream)


@given(garbage=st.binary(max_size=200).filter(lambda data: b"\xff\xfe" not in data and not data.endswith(b"\xff")))
def test_every_frame_between_garbage_is_found(garbage):
    parser = Parser(max_payload=128)
    assert len(parser.feed(garbage + TRIGGER + garbage + TRIGGER)) == 2


def test_headers_without_end_cost_no_quadratic_time():
    header = encode(125, bytes(1000))[:5]
    parser = Parser(max_payload=1024)
    rng = random.Random(1)
    for _ in range(40):
        parser.feed(header * 800 + rng.randbytes(96))
    assert parser.pending <= 1024 + 8


def test_what_was_wrong_with_a_frame_is_told_with_what_would_be_right():
    parser = Parser(100)
    good = encode(125, b"\x02\x01")
    assert parser.feed(good[:-1] + bytes((good[-1] ^ 1,))) == []
    assert parser.fault == "2 bytes for topic id 125 with checksum 7e, it would be 7f"
    parser = Parser(100)
    parser.feed(encode(125, bytes(200)))
    assert parser.fault == "a frame of 200 bytes, at most 100 are taken"
