"""What serial_node publishes of its devices' bytes, written into a bag, is what the replay takes in."""

import io
import types

import pytest

pytest.importorskip("rospy", reason="needs ROS: source the workspace first")

import rospy
from rosbags.rosbag1 import Writer
from rosbot_patrol.msg import SerialBytes

from rosbot_patrol.replay.bags.bag import Bag
from rosbot_patrol.replay.nodes.bridge import CLOSED, DATA, KINDS, OPENED
from rosbot_patrol.ros.bridge.report import SerialTap


@pytest.fixture
def published(monkeypatch):
    sent = []
    publisher = types.SimpleNamespace(publish=sent.append)
    monkeypatch.setattr(rospy, "Publisher", lambda topic, kind, queue_size: publisher)
    monkeypatch.setattr(rospy.Time, "now", staticmethod(lambda: rospy.Time(10, 500)))
    return sent


def test_the_bytes_of_a_connection_go_through_a_bag(published, tmp_path):
    tap, client = SerialTap(), types.SimpleNamespace(peer="10.0.0.7:4321", address="10.0.0.7")
    tap.opened(client)
    tap.data(client, b"\xff\xfe\x00\x01")
    tap.closed(client)
    with Writer(tmp_path / "a.bag") as writer:
        connection = writer.add_connection(
            "/serial_node/bytes",
            "rosbot_patrol/msg/SerialBytes",
            msgdef=SerialBytes._full_text,
            md5sum=SerialBytes._md5sum,
        )
        for i, message in enumerate(published):
            buffer = io.BytesIO()
            message.serialize(buffer)
            writer.write(connection, 10 * 10**9 + i, buffer.getvalue())
    with Bag(tmp_path / "a.bag") as bag:
        found = [record.content for record in bag.records(["/serial_node/bytes"], KINDS)]
    assert [(each.event, each.data) for each in found] == [(OPENED, b""), (DATA, b"\xff\xfe\x00\x01"), (CLOSED, b"")]
    assert {(each.peer, each.address) for each in found} == {("10.0.0.7:4321", "10.0.0.7")}
    assert (SerialBytes.OPENED, SerialBytes.DATA, SerialBytes.CLOSED) == (OPENED, DATA, CLOSED)
