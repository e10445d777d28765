"""What a real server taps is replayed."""

from __future__ import annotations

import socket
from pathlib import Path

from serial_bag import announce, bag_of, replayed

from rosbot_patrol.replay.nodes.bridge import CLOSED, DATA, OPENED
from rosbot_patrol.rosserial.protocol.packet import encode
from rosbot_patrol.rosserial.server.server import SerialServer
from rosbot_patrol.rosserial.server.settings import SerialNodeParams


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
