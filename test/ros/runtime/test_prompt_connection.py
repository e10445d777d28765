"""A publisher's connection sends at once, waits for nobody, and forgets the oldest of what waits."""

import socket
import threading
import time

import pytest

pytest.importorskip("rospy", reason="ROS is not on the path: `. scripts/env` first")

from rospy.exceptions import TransportException
from rospy.impl.tcpros_base import TCPROSTransport, TCPROSTransportProtocol

from rosbot_patrol.ros.runtime.connections import PromptConnection

SIZE = 1000


def message(number):
    return number.to_bytes(4, "little") * (SIZE // 4)


class Link:
    """A connection over TCP, and the subscriber's end of it."""

    def __init__(self, queue_size, timeout):
        with socket.create_server(("127.0.0.1", 0)) as server:
            self.far = socket.create_connection(server.getsockname())
            near, _ = server.accept()
        for end in (self.far, near):  # small, as the fuller ones of the kernel take long to fill
            end.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 14)
            end.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 1 << 14)
        near.settimeout(timeout)
        self.far.settimeout(20.0)
        self.got = b""
        self.transport = TCPROSTransport(TCPROSTransportProtocol("/clock", None), "/clock")
        self.transport.set_socket(near, "subscriber")
        self.sender = PromptConnection(self.transport, queue_size)

    def receive(self, count):
        """Numbers of the next messages; a torn one has four bytes that differ from the others."""
        size = count * SIZE
        while len(self.got) < size:
            part = self.far.recv(1 << 16)
            assert part, "the connection has ended"
            self.got += part
        found, self.got = self.got[:size], self.got[size:]
        messages = [found[i : i + SIZE] for i in range(0, size, SIZE)]
        assert all(one == one[:4] * (SIZE // 4) for one in messages)
        return [int.from_bytes(one[:4], "little") for one in messages]

    def close(self):
        self.transport.close()
        self.far.close()


@pytest.fixture(params=[None, 60.0], ids=["no time-out", "rospy's time-out"])
def make(request):
    made = []

    def build(queue_size):
        made.append(Link(queue_size, request.param))
        return made[-1]

    yield build
    for link in made:
        link.close()


def test_messages_leave_in_the_publishers_thread(make):
    link = make(1)
    before = threading.active_count()
    for number in range(5):
        link.sender.write_data(message(number))
    assert link.receive(5) == [0, 1, 2, 3, 4]
    assert threading.active_count() == before
    assert link.transport.stat_num_msg == 5
    assert link.transport.stat_bytes == 5 * SIZE


def test_a_subscriber_that_stands_still_holds_up_nobody_and_gets_whole_messages(make):
    link = make(3)
    began = time.monotonic()
    for number in range(20_000):
        link.sender.write_data(message(number))
    assert time.monotonic() - began < 15.0  # 20 MB into buffers of 16 kB: it waited for nobody
    found = []
    while not found or found[-1] != 19_999:
        found += link.receive(1)
    assert found == sorted(set(found))
    assert 3 < len(found) < 2000
    assert found[-3:] == [19_997, 19_998, 19_999]
    link.sender.write_data(message(7))
    assert link.receive(1) == [7]


def test_without_a_limit_nothing_is_lost(make):
    link = make(0)
    for number in range(3000):
        link.sender.write_data(message(number))
    assert link.receive(3000) == list(range(3000))


def test_a_large_message_is_left_to_a_thread_and_keeps_its_place(make):
    link = make(10)
    large = bytes(1_000_000)
    link.sender.write_data(message(1))
    link.sender.write_data(large)
    link.sender.write_data(message(2))
    assert link.receive(1002) == [1, *[0] * 1000, 2]


@pytest.mark.parametrize("is_waiting", [False, True], ids=["at rest", "with messages that wait"])
def test_a_subscriber_that_goes_is_told_to_the_publisher(make, is_waiting):
    link = make(5)
    for number in range(2000 * is_waiting):
        link.sender.write_data(message(number))
    link.far.close()
    with pytest.raises((TransportException, OSError)):
        send_on(link)


def send_on(link):
    for number in range(1000):
        link.sender.write_data(message(number))
        time.sleep(0.005)


def test_its_thread_ends_with_the_connection(make):
    link = make(5)
    for number in range(2000):
        link.sender.write_data(message(number))
    thread = next(t for t in threading.enumerate() if t.name == "relay /clock")
    link.far.close()
    link.transport.close()
    thread.join(5.0)
    assert not thread.is_alive()
    for _ in range(2):
        with pytest.raises((TransportException, OSError)):
            link.sender.write_data(message(1))
