"""The rosserial bridge over a bag of the bytes that devices sent."""

from __future__ import annotations

from pathlib import Path

import pytest
from serial_bag import OTHER, announce, bag_of, replayed

from rosbot_patrol.replay.nodes.bridge import CLOSED, DATA, FIELDS, OPENED
from rosbot_patrol.replay.results.comparison import compare
from rosbot_patrol.rosserial.protocol import packet
from rosbot_patrol.rosserial.protocol.packet import encode


def session_bytes(triggers: int = 5) -> list[tuple[float, int, bytes]]:
    frames = [(10.2 + 0.5 * i, DATA, encode(125, bytes([2, i % 2]))) for i in range(triggers)]
    return [(10.0, OPENED, b""), (10.1, DATA, announce() + announce(OTHER)), *frames, (13.0, CLOSED, b"")]


def test_messages_topics_and_refusals(tmp_path: Path) -> None:
    result = replayed(bag_of(tmp_path, session_bytes()))
    assert result.tables["messages"]["topic"].tolist() == ["motion_trigger"] * 5
    assert len(set(result.tables["messages"]["digest"].tolist())) == 2
    assert result.tables["events"]["kind"].tolist() == ["Announced", "Refused"]
    assert "cmd_vel" in result.tables["events"]["text"][1]
    counts = result.counts
    assert (counts["connections"], counts["messages"], counts["refused"], counts["garbled"]) == (1, 5, 1, 0)


def test_frames_that_come_in_pieces(tmp_path: Path) -> None:
    whole = b"".join(data for _, event, data in session_bytes() if event == DATA)
    pieces = [(10.1 + 0.01 * i, DATA, whole[i : i + 3]) for i in range(0, len(whole), 3)]
    result = replayed(bag_of(tmp_path, [(10.0, OPENED, b""), *pieces]))
    assert result.counts["messages"] == 5
    assert result.counts["bytes"] == len(whole)


def test_garbage_silence_and_bytes_of_nobody(tmp_path: Path) -> None:
    happened = [
        (9.0, DATA, b"before the bag began"),
        (10.0, OPENED, b""),
        (10.1, DATA, b"GET / HTTP/1.1\r\n\r\n"),
        (40.0, DATA, announce()),
    ]
    result = replayed(bag_of(tmp_path, happened))
    assert result.counts["unopened"] == 2  # the last came after it was hung up on
    assert result.counts["garbled"] == 1
    assert result.tables["events"]["kind"].tolist()[-1] == "HangUp"


def test_the_same_bit_for_bit_and_a_planted_fault_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = bag_of(tmp_path, session_bytes())
    stored = replayed(path)
    assert replayed(path).digest == stored.digest
    real = packet.Parser.feed
    monkeypatch.setattr(packet.Parser, "feed", lambda self, data: real(self, data[:-1]))  # each read loses a byte
    names = [each.name for each in compare(stored, replayed(path), FIELDS)]
    assert "counts.messages" in names
    assert "messages.rows" in names
