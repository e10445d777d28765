"""A bag of the bytes that devices sent, and its replay."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from made_bag import NOETIC, Maker, write_bag
from rosbags.typesys import get_types_from_msg

from rosbot_patrol.replay.bags.bag import Bag
from rosbot_patrol.replay.nodes.setup import Setup, build_replay
from rosbot_patrol.replay.results.tables import Result
from rosbot_patrol.replay.runner import run_replay
from rosbot_patrol.rosserial.protocol.packet import encode
from rosbot_patrol.rosserial.protocol.topics import ESP_TRIGGER_MD5, TopicId, TopicInfo, pack_topic_info

ROOT = Path(__file__).resolve().parents[3]
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
