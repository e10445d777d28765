"""The rosserial bridge over a bag of the bytes that devices sent."""

from __future__ import annotations

import socket
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from made_bag import NOETIC, Maker, write_bag
from rosbags.typesys import get_types_from_msg

from rosbot_patrol.replay.bags.bag import Bag
from rosbot_patrol.replay.nodes.bridge import CLOSED, DATA, FIELDS, OPENED
from rosbot_patrol.replay.nodes.setup import Setup, build_replay
from rosbot_patrol.replay.results.comparison import compare
from rosbot_patrol.replay.results.tables import Result
from rosbot_patrol.replay.runner import run_replay
from rosbot_patrol.rosserial.protocol import packet
from rosbot_patrol.rosserial.protocol.packet import encode
from rosbot_patrol.rosserial.protocol.topics import ESP_TRIGGER_MD5, TopicId, TopicInfo, pack_topic_info
from rosbot_patrol.rosserial.server.server import SerialServer
from rosbot_patrol.rosserial.server.settings import SerialNodeParams

ROOT = Path(__file__).resolve().parents[4]
BYTES = "rosbot_patrol/msg/SerialBytes"
if BYTES not in NOETIC.types:
    text = (ROOT / "msg" / "SerialBytes.msg").read_text().replace("\nHeader header", "\nstd_msgs/Header header")
    NOETIC.register(get_types_from_msg(text, BYTES))

ESP = TopicInfo(topic_id=125, name="motion_trigger", message_type="rosbot_patrol/EspTrigger", md5=ESP_TRIGGER_MD5)
OTHER = TopicInfo(topic_id=126, name="cmd_vel", message_type="geometry_msgs/Twist", md5="x")
PEER, TOPIC = "10.0.0.7:4321", "/serial_node/bytes"


def announce(info: TopicInfo = ESP) -> bytes:
    return encode(TopicId.PUBLISHER, pack_topic_info(info))


def bag_of(folder: Path, happened: Sequence[tuple[float, int, bytes]], peer: str = PEER) -> Path:
    maker = Maker()
    messages = [
        (when, TOPIC, maker.new(BYTES, maker.header(when, ""), event, peer, "10.0.0.7", np.frombuffer(data, np.uint8)))
        for when, event, data in happened
    ]
    return write_bag(folder / "bridge.bag", messages)


def replayed(path: Path) -> Result:
    with Bag(path) as bag:
        return run_replay(bag, build_replay(Setup(node="serial_node")))


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


class Nobody:
    """The other side of a server, which says nothing."""

    def __getattr__(self, name: str) -> object:
        return lambda *args, **more: None


class Recorder:
    """A tap that writes down what rosbag would."""

    def __init__(self) -> None:
        self.happened: list[tuple[float, int, bytes]] = []

    def opened(self, client: object) -> None:
        self._note(OPENED, b"")

    def data(self, client: object, data: bytes) -> None:
        self._note(DATA, data)

    def closed(self, client: object) -> None:
        self._note(CLOSED, b"")

    def _note(self, event: int, data: bytes) -> None:
        self.happened.append((10.0 + 0.1 * len(self.happened), event, data))


def test_what_a_real_server_taps_is_replayed(tmp_path: Path) -> None:
    tap = Recorder()
    server = SerialServer(Nobody(), SerialNodeParams(port="tcp").policy(""), tap=tap)
    (port,) = server.listen([0], "127.0.0.1")
    with socket.create_connection(("127.0.0.1", port)) as device:
        device.sendall(announce() + encode(125, b"\x02\x01"))
        for _ in range(100):
            server.poll(0.01)
            if any(event == DATA for _, event, _ in tap.happened):
                break
    for _ in range(100):
        server.poll(0.01)
        if tap.happened[-1][1] == CLOSED:
            break
    server.close()
    assert [event for _, event, _ in tap.happened] == [OPENED, DATA, CLOSED]
    result = replayed(bag_of(tmp_path, tap.happened))
    assert result.tables["messages"]["topic"].tolist() == ["motion_trigger"]


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
