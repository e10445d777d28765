"""The server on a serial line: a pseudo-terminal below a path that stays, as udev's /dev/ttyUSB0 does."""

import contextlib
import os
import pty
import socket
import tty

import pytest

from rosbot_patrol.errors import ProtocolError
from rosbot_patrol.rosserial.protocol.packet import Parser, encode
from rosbot_patrol.rosserial.protocol.topics import REQUEST_TOPICS, TX_STOP, TopicId, TopicInfo, pack_topic_info
from rosbot_patrol.rosserial.server.client import Client, listen, tune
from rosbot_patrol.rosserial.server.policy import TRUSTED
from rosbot_patrol.rosserial.server.server import SerialServer
from rosbot_patrol.rosserial.server.session import Session

BATTERY = TopicInfo(topic_id=125, name="battery", message_type="sensor_msgs/BatteryState", md5="a")
SONAR = TopicInfo(topic_id=125, name="sonar", message_type="sensor_msgs/Range", md5="b")


def announce(info):
    return encode(TopicId.PUBLISHER, pack_topic_info(info))


class Recorder:
    """What the server hands on."""

    def __init__(self):
        self.heard, self.gone = [], 0

    def open(self, client, kind, info):
        pass

    def receive(self, client, kind, info, data):
        self.heard.append((info.name, data))

    def closed(self, client):
        self.gone += 1

    def flush(self):
        pass

    def tick(self):
        pass

    def time(self):
        return 5, 6

    def device_log(self, client, level, text):
        pass

    def parameter(self, name):
        raise ProtocolError("", f"parameter {name} is not set")


class Line:
    """A device on a wire that can be pulled, and a server whose clock is ours."""

    def __init__(self, folder):
        self.path = folder / "ttyUSB0"
        self.now = 0.0
        self.recorder = Recorder()
        self.server = SerialServer(self.recorder, TRUSTED, clock=lambda: self.now)
        self.server.attach(str(self.path), 57600)
        self._device = self._other = None

    def plug(self):
        self._device, self._other = pty.openpty()
        tty.setraw(self._other)
        os.set_blocking(self._device, False)
        self.path.unlink(missing_ok=True)
        self.path.symlink_to(os.ttyname(self._other))

    def pull(self):
        os.close(self._other)
        os.close(self._device)
        self.path.unlink()

    def write(self, *frames):
        for frame in frames:
            os.write(self._device, frame)
        self.poll()

    def read(self):
        with contextlib.suppress(BlockingIOError):
            return os.read(self._device, 4096)
        return b""

    def poll(self, seconds=0.0):
        """Let time go by."""
        for _ in range(int(seconds / 0.25) + 1):
            for _ in range(3):
                self.server.poll(0.01)
            self.now += 0.25


@pytest.fixture
def line(tmp_path):
    line = Line(tmp_path)
    yield line
    line.server.close()


def test_device_pulled_out_in_mid_frame_and_plugged_in_again(line, caplog):
    caplog.set_level("INFO")
    line.poll(4.0)
    assert caplog.text.count("ttyUSB0") == 1  # it is not there: said once, and looked for
    line.plug()
    line.poll(0.25)
    assert line.read() == REQUEST_TOPICS
    line.write(announce(BATTERY), encode(125, b"full"))
    assert line.recorder.heard == [("battery", b"full")]
    line.write(encode(125, b"half of a frame")[:12])
    line.pull()
    line.poll(5.0)
    assert line.recorder.gone == 1
    assert "disconnected" in caplog.text
    line.plug()
    line.poll(0.25)
    assert line.read() == REQUEST_TOPICS
    line.write(announce(BATTERY), encode(125, b"empty"))
    assert line.recorder.heard[1:] == [("battery", b"empty")]


def test_device_reset_in_mid_frame_comes_back_with_other_firmware(line):
    line.plug()
    line.poll()
    line.write(announce(BATTERY), encode(125, bytes(400))[:200])
    line.write(b"ets Jun  8 2016\r\nrst:0x1 (POWERON_RESET)\r\n", announce(SONAR), encode(125, b"near"))
    line.poll(1.5)  # the bytes of the frame that began are not waited for
    assert line.recorder.heard == [("sonar", b"near")]
    line.write(encode(125, b"far"))
    assert line.recorder.heard == [("sonar", b"near"), ("sonar", b"far")]
    assert line.recorder.gone == 0


def test_device_that_speaks_at_another_speed_is_asked_again_and_told_off_once(line, caplog):
    line.plug()
    line.poll()
    assert line.read() == REQUEST_TOPICS
    for _ in range(14):
        line.write(bytes.fromhex("80f8007e1c") * 20)
        line.poll(0.5)
    assert set(Parser().feed(line.read())) == set(Parser().feed(REQUEST_TOPICS))
    assert caplog.text.count("no frame") == 1
    assert line.recorder.gone == 0


def test_device_is_told_when_the_server_ends(line):
    line.plug()
    line.poll()
    line.read()
    line.server.close()
    assert line.read() == TX_STOP
    line.server = SerialServer(line.recorder, TRUSTED)


class OneByOne:
    """A link that notes what each `send` was given."""

    def __init__(self):
        self.sent = []

    def send(self, data):
        self.sent.append(data)
        return len(data)


def test_each_frame_is_sent_in_one_piece_of_its_own():
    """The sketch reads only twice a second and gives up a frame after 20 ms: one frame must be one TCP segment."""
    link = OneByOne()
    client = Client(link, Session(TRUSTED, 0.0), "peer:1", "peer")
    client.put(100, b"\x01" * 300)
    client.put(101, b"\x02")
    client.flush()
    assert link.sent == [encode(100, b"\x01" * 300), encode(101, b"\x02"), REQUEST_TOPICS]


def test_tcp_links_do_not_delay_and_notice_a_dead_peer():
    with listen(0) as listener, socket.create_connection(("127.0.0.1", listener.getsockname()[1])) as near:
        tune(near, restricted=True)
        options = (socket.TCP_NODELAY, socket.TCP_KEEPIDLE, socket.TCP_KEEPINTVL, socket.TCP_KEEPCNT)
        assert [near.getsockopt(socket.IPPROTO_TCP, option) for option in options] == [1, 5, 2, 3]
        assert near.getsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE) == 1
