"""foxglove before a real client of its protocol: topics with their definitions, latched ones for who comes later."""

import asyncio
import json
import struct
import subprocess

import pytest

rospy = pytest.importorskip("rospy", reason="needs ROS: source the workspace first")
pytest.importorskip("foxglove", reason="needs foxglove-sdk: scripts/bootstrap")
websockets = pytest.importorskip("websockets")

from patrol_house import wait_until  # noqa: E402


async def collect(url, topics, seconds=15.0):
    """What a viewer of topics gets: ({topic: (type, definition)}, {topic: payloads})."""
    channels, got = {}, {topic: [] for topic in topics}
    async with websockets.connect(url, subprotocols=["foxglove.sdk.v1"], max_size=None) as socket:
        subscribed = {}

        async def read():
            while not all(got.values()):
                message = await socket.recv()
                if isinstance(message, str):
                    tree = json.loads(message)
                    for channel in tree.get("channels", ()) if tree["op"] == "advertise" else ():
                        channels[channel["topic"]] = channel
                    new = [t for t in topics if t in channels and t not in subscribed.values()]
                    for topic in new:
                        subscribed[len(subscribed)] = topic
                        wanted = [{"id": len(subscribed) - 1, "channelId": channels[topic]["id"]}]
                        await socket.send(json.dumps({"op": "subscribe", "subscriptions": wanted}))
                elif message[0] == 1:
                    number, _ = struct.unpack_from("<IQ", message, 1)
                    got[subscribed[number]].append(bytes(message[13:]))

        await asyncio.wait_for(read(), seconds)
    return channels, got


def test_topics_are_shown_as_they_are_and_read_only_while_somebody_looks(house):
    import io

    from nav_msgs.msg import OccupancyGrid
    from std_msgs.msg import String

    latched = rospy.Publisher("/foxglove_map", OccupancyGrid, queue_size=1, latch=True)
    grid = OccupancyGrid(data=[0, 100, -1, 0])
    grid.info.width = grid.info.height = 2
    latched.publish(grid)
    word = rospy.Publisher("/foxglove_word", String, queue_size=1)
    timer = rospy.Timer(rospy.Duration(0.1), lambda _: word.publish("hello"))
    node = house._start(["rosrun", "rosbot_patrol", "foxglove"], {"port": 0})
    wait_until(lambda: "open ws://" in house.log(node), 20, "the server")
    url = house.log(node).partition("open ")[2].split()[0]
    for _ in range(2):  # the second viewer gets the latched map, too
        channels, got = asyncio.run(collect(url, ["/foxglove_map", "/foxglove_word"]))
        assert channels["/foxglove_map"]["schemaName"] == "nav_msgs/OccupancyGrid"
        assert "int8[] data" in channels["/foxglove_map"]["schema"]
        assert channels["/foxglove_map"]["encoding"] == "ros1"
        assert OccupancyGrid().deserialize(got["/foxglove_map"][0]).data == (0, 100, -1, 0)
        assert String().deserialize(got["/foxglove_word"][0]).data == "hello"
    wait_until(lambda: word.get_num_connections() == 0, 10, "nobody looks any more")
    buffer = io.BytesIO()
    grid.serialize(buffer)
    assert got["/foxglove_map"][0] == buffer.getvalue()
    timer.shutdown()
    for publisher in (latched, word):  # the tests of a process share a node
        publisher.unregister()


def test_a_taken_port_is_one_sentence(house):
    first = house._start(["rosrun", "rosbot_patrol", "foxglove", "__name:=foxglove1"], {"port": 18765})
    wait_until(lambda: "open ws://" in house.log(first), 20, "the server")
    command = ["rosrun", "rosbot_patrol", "foxglove", "__name:=foxglove2", "_port:=18765"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=30, check=False)
    assert done.returncode == 1
    assert "/port: 127.0.0.1:18765 cannot be used" in done.stdout + done.stderr
