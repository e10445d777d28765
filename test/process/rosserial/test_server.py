"""The server and virtual sensors over real TCP on the loopback."""

import contextlib
import os
import pty
import socket
import threading
import time

import pytest

from rosbot_patrol.errors import ProtocolError
from rosbot_patrol.rosserial.device.poor_link import LinkQuality
from rosbot_patrol.rosserial.device.tcp_client import EspClient
from rosbot_patrol.rosserial.protocol.packet import Parser, encode
from rosbot_patrol.rosserial.protocol.topics import (
    ESP_TRIGGER_MD5,
    REQUEST_TOPICS,
    TX_STOP,
    TopicId,
    TopicInfo,
    pack_topic_info,
)
from rosbot_patrol.rosserial.server.admission import Limits
from rosbot_patrol.rosserial.server.policy import TRUSTED, Policy
from rosbot_patrol.rosserial.server.server import TICK, SerialServer

ESP = TopicInfo(topic_id=125, name="motion_trigger", message_type="rosbot_patrol/EspTrigger", md5=ESP_TRIGGER_MD5)
ANNOUNCE = encode(TopicId.PUBLISHER, pack_topic_info(ESP))


class Recorder:
    def __init__(self):
        self.opened, self.messages, self.closed_peers, self.clients = [], [], [], []

    def open(self, client, kind, info):
        if info.md5 == "bad":
            raise ProtocolError("", "checksum does not match")
        self.opened.append((kind, info))
        self.clients.append(client)

    def receive(self, client, kind, info, data):
        self.messages.append(data)

    def flush(self):
        pass

    def tick(self):
        pass

    def closed(self, client):
        self.closed_peers.append(client.peer)

    def time(self):
        return 5, 6

    def device_log(self, client, level, text):
        self.messages.append(text)

    def parameter(self, name):
        raise ProtocolError("", f"parameter {name} is not set")


@contextlib.contextmanager
def serving(policy=None, **options):
    recorder = Recorder()
    server = SerialServer(recorder, policy or Policy(), **options)
    (port,) = server.listen([0])
    thread = threading.Thread(target=server.run)
    thread.start()
    try:
        yield recorder, server, port
    finally:
        server.stop()
        thread.join(3.0)
        server.close()


def wait_for(condition, timeout=4.0):
    until = time.monotonic() + timeout
    while not condition():
        assert time.monotonic() < until, "did not happen"
        time.sleep(0.01)


def connect(port, host="127.0.0.1"):
    link = socket.create_connection((host, port), timeout=3.0)
    assert link.recv(8) == REQUEST_TOPICS
    return link


def test_virtual_sensor_triggers_at_once_and_reconnects_after_a_reboot():
    with serving() as (recorder, _, port):
        sensor = EspClient("localhost", port, 3).start()
        assert sensor.wait_connected(3.0)
        wait_for(lambda: b"\x03\x00" in recorder.messages)
        sensor.set_motion(True)
        wait_for(lambda: b"\x03\x01" in recorder.messages, 0.4)
        sensor.set_motion(True)  # no edge
        sensor.reboot()
        wait_for(lambda: len(recorder.opened) == 2)
        sensor.set_motion(True)
        wait_for(lambda: recorder.messages.count(b"\x03\x01") == 2)
        sensor.stop()
        assert not sensor.connected


def test_trigger_raised_before_the_bridge_is_there_arrives():
    with socket.create_server(("127.0.0.1", 0)) as probe:
        port = probe.getsockname()[1]
    sensor = EspClient("127.0.0.1", port, 4).start()
    sensor.set_motion(True)
    recorder = Recorder()
    server = SerialServer(recorder, Policy())
    server.listen([port])
    thread = threading.Thread(target=server.run)
    thread.start()
    wait_for(lambda: b"\x04\x01" in recorder.messages, 6.0)
    sensor.stop()
    server.stop()
    thread.join(3.0)
    server.close()


def test_a_poor_link_delays_loses_and_breaks():
    with serving() as (recorder, _, port):
        sensor = EspClient("127.0.0.1", port, 6).start()
        assert sensor.wait_connected(3.0)
        sensor.set_link(LinkQuality(delay=0.8))
        sensor.trigger()
        began = time.monotonic()
        wait_for(lambda: b"\x06\x01" in recorder.messages)
        assert time.monotonic() - began > 0.6
        sensor.set_link(LinkQuality(loss=1.0))
        time.sleep(1.0)  # what was on its way
        count = len(recorder.messages)
        sensor.trigger()
        time.sleep(1.2)
        assert len(recorder.messages) == count
        sensor.set_link(LinkQuality(drop_every=0.2, seed=1))
        wait_for(lambda: len(recorder.opened) >= 3)
        sensor.set_link(LinkQuality())
        wait_for(lambda: sensor.connected, 6.0)
        sensor.trigger()  # and the one that got lost is reported again, as the bridge gave no receipt for it
        wait_for(lambda: recorder.messages.count(b"\x06\x01") >= 3, 6.0)
        sensor.stop()


def test_many_sensors_on_one_port_with_a_stranger_and_a_stalled_reader_among_them():
    with serving() as (recorder, server, port):
        stranger, stalled = connect(port), connect(port)
        stalled.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        stalled.sendall(encode(10, bytes(8)) * 500)  # asks for the time and never reads
        stranger.sendall(os.urandom(3000))
        sensors = [EspClient("127.0.0.1", port, i).start() for i in range(1, 21)]
        assert all(sensor.wait_connected(4.0) for sensor in sensors)
        for sensor in sensors:
            sensor.set_motion(True)
        wait_for(lambda: {m[0] for m in recorder.messages if m[1]} == set(range(1, 21)))
        assert len(server.clients) == 22
        for sensor in sensors:
            sensor.stop()
        stranger.close()
        stalled.close()


def test_ipv4_and_ipv6_on_one_port():
    with serving() as (recorder, _, port):
        links = [connect(port, host) for host in ("127.0.0.1", "::1")]
        for number, link in enumerate(links):
            link.sendall(ANNOUNCE + encode(125, bytes((number, 1))))
        wait_for(lambda: sorted(recorder.messages) == [b"\x00\x01", b"\x01\x01"])
        for link in links:
            link.close()
        wait_for(lambda: len(recorder.closed_peers) == 2)
        assert {peer.rsplit(":", 1)[0] for peer in recorder.closed_peers} == {"127.0.0.1", "[::1]"}


def test_message_before_negotiation_makes_the_server_ask():
    with serving() as (_, _, port):
        link = connect(port)
        time.sleep(1.05)
        link.sendall(encode(125, b"\x01\x00"))
        assert link.recv(8) == REQUEST_TOPICS
        link.close()


def test_taken_port_is_one_sentence():
    with serving() as (_, _, port), pytest.raises(ProtocolError, match=f"TCP port {port} is already taken"):
        SerialServer(Recorder(), Policy()).listen([port])


def test_refused_definition_is_said_once(caplog):
    caplog.set_level("WARNING")
    with serving() as (recorder, _, port):
        link = connect(port)
        wrong = TopicInfo(topic_id=125, name="motion_trigger", message_type="rosbot_patrol/EspTrigger", md5="bad")
        link.sendall(encode(TopicId.PUBLISHER, pack_topic_info(wrong)) * 3 + encode(125, b"\x01\x01"))
        time.sleep(0.3)
        link.close()
        wait_for(lambda: recorder.closed_peers)
    assert [r.message.split(": ", 1)[1] for r in caplog.records] == ["refused checksum does not match"]
    assert recorder.messages == []


def test_silent_client_is_hung_up_on():
    with serving(silence_timeout=0.5) as (recorder, server, port):
        link = connect(port)
        wait_for(lambda: recorder.closed_peers, 2.0)
        assert link.recv(100) == b""
        assert not server.clients
        link.close()


def test_new_connection_replaces_the_silent_one_of_the_same_sensor_only():
    with serving() as (recorder, server, port):
        old, other, new = connect(port), connect(port), connect(port)
        old.sendall(ANNOUNCE + encode(125, b"\x02\x00"))
        other.sendall(ANNOUNCE + encode(125, b"\x05\x00"))
        time.sleep(1.0)
        new.sendall(ANNOUNCE + encode(125, b"\x02\x00"))
        wait_for(lambda: recorder.closed_peers, 3.0)
        assert recorder.closed_peers == ["{}:{}".format(*old.getsockname())]
        assert len(server.clients) == 2
        for link in (old, other, new):
            link.close()


def test_full_server_drops_a_stranger_for_a_newcomer_but_no_sensor(caplog):
    with serving(limits=Limits(clients=2)) as (recorder, server, port):
        sensor, stranger = connect(port), connect(port)
        sensor.sendall(ANNOUNCE)
        wait_for(lambda: recorder.opened)
        second = connect(port)
        assert stranger.recv(100) == b""
        second.sendall(ANNOUNCE)
        wait_for(lambda: len(recorder.opened) == 2)
        late = socket.create_connection(("127.0.0.1", port))
        assert late.recv(100) == b""
        assert len(server.clients) == 2
        for link in (sensor, stranger, second, late):
            link.close()
    assert "refused, 2 clients are connected" in caplog.text


def test_stop_tells_the_devices():
    with serving() as (_, _, port):
        link = connect(port)
    assert link.recv(8) == TX_STOP
    link.close()


def test_messages_to_the_device_and_their_limit():
    with serving(TRUSTED) as (recorder, server, port):
        link = connect(port)
        led = TopicInfo(topic_id=100, name="led", message_type="std_msgs/Bool", md5="x", buffer_size=4)
        link.sendall(encode(TopicId.SUBSCRIBER, pack_topic_info(led)))
        wait_for(lambda: recorder.clients)
        server.send(recorder.clients[0], 100, b"\x01")
        assert link.recv(100) == encode(100, b"\x01")
        with pytest.raises(ProtocolError, match="5 bytes on led exceeds its buffer of 4"):
            server.send(recorder.clients[0], 100, bytes(5))
        link.close()


def test_serial_device_over_a_pseudo_terminal():
    main, other = pty.openpty()
    recorder = Recorder()
    server = SerialServer(recorder, TRUSTED)
    server.attach(os.ttyname(other), 525000)
    server.poll(0.05)
    assert os.read(main, 100) == REQUEST_TOPICS
    anything = TopicInfo(topic_id=125, name="battery", message_type="sensor_msgs/BatteryState", md5="x")
    os.write(main, b"boot\r\n" + encode(TopicId.PUBLISHER, pack_topic_info(anything)) + encode(125, b"\x11\x13\r\n"))
    os.write(main, encode(10, bytes(8)))
    for _ in range(5):
        server.poll(0.05)
    assert recorder.messages == [b"\x11\x13\r\n"]
    assert Parser().feed(os.read(main, 100))[0].data == b"\x05\0\0\0\x06\0\0\0"
    os.close(other)
    os.close(main)
    for _ in range(3):
        server.poll(0.05)
    assert recorder.closed_peers
    server.close()


def test_missing_serial_device_is_said_once_and_opened_when_it_appears(caplog, tmp_path):
    caplog.set_level("INFO")
    now, device = [0.0], tmp_path / "base"
    server = SerialServer(Recorder(), TRUSTED, clock=lambda: now[0])
    server.attach(str(device), 57600)
    for now[0] in (0.0, 1.0, 4.0, 8.0):
        server.poll(0.0)
    assert [record.levelname for record in caplog.records] == ["ERROR"]
    assert f"{device} is not there: plug the board in, or set port" in caplog.text
    assert "it is opened once it is there" in caplog.text
    main, other = pty.openpty()
    device.symlink_to(os.ttyname(other))
    now[0] += TICK
    server.poll(0.0)
    assert f"connected to {device} at 57600 baud" in caplog.text
    server.close()
    os.close(main)
    os.close(other)


KEYS = {2: bytes(range(32)), 3: bytes(range(1, 33))}


def test_sensor_with_a_key_is_known_and_one_without_or_with_another_is_not(caplog):
    caplog.set_level("INFO")
    with serving(Policy(keys=KEYS)) as (recorder, _, port):
        good = EspClient("127.0.0.1", port, 2, key=KEYS[2], insist=True).start()
        plain, wrong = EspClient("127.0.0.1", port, 3).start(), EspClient("127.0.0.1", port, 3, key=KEYS[2]).start()
        assert good.wait_connected(3.0)
        good.trigger()
        wait_for(lambda: b"\x02\x01" in recorder.messages)
        wait_for(lambda: "a wrong proof for sensor 3" in caplog.text)
        wait_for(lambda: "did not take the proof" in caplog.text)
        wait_for(lambda: "the bridge asks for a key, and this sensor has none" in caplog.text)
        time.sleep(1.0)  # and tries again
        assert caplog.text.count("refused a wrong proof for sensor 3") == 1
        assert {m[0] for m in recorder.messages} == {2}
        assert not plain.connected
        assert not wrong.connected
        for sensor in (good, plain, wrong):
            sensor.stop()


def test_sensor_that_insists_talks_to_no_bridge_without_keys(caplog):
    with serving() as (recorder, _, port):
        sensor = EspClient("127.0.0.1", port, 2, key=KEYS[2], insist=True).start()
        wait_for(lambda: "did not show that it has this sensor's key" in caplog.text)
        easy = EspClient("127.0.0.1", port, 3, key=KEYS[3]).start()
        assert easy.wait_connected(3.0)
        wait_for(lambda: recorder.messages)
        assert {m[0] for m in recorder.messages} == {3}
        sensor.stop()
        easy.stop()


def test_strangers_of_one_address_are_few_and_keep_no_sensor_out():
    with serving(Policy(keys=KEYS), limits=Limits(strangers=4)) as (_, server, port):
        links = [socket.create_connection(("127.0.0.1", port), timeout=3.0) for _ in range(10)]
        wait_for(lambda: links[5].recv(100)[5:6] == b"\x08" and links[5].recv(100) == b"")
        wait_for(lambda: len(server.clients) == 4)
        sensor = EspClient("127.0.0.1", port, 2, key=KEYS[2]).start()
        assert sensor.wait_connected(3.0)
        more = [socket.create_connection(("127.0.0.1", port)) for _ in range(10)]
        time.sleep(0.3)
        assert sensor.connected
        sensor.stop()
        for link in links + more:
            link.close()


def test_who_does_not_prove_itself_in_time_is_let_go(monkeypatch, caplog):
    monkeypatch.setattr("rosbot_patrol.rosserial.protocol.proof.PROOF_TIMEOUT", 0.3)
    with serving(Policy(keys=KEYS)) as (_, server, port):
        link = socket.create_connection(("127.0.0.1", port), timeout=3.0)
        assert Parser().feed(link.recv(100))[0].topic_id == TopicId.CHALLENGE
        link.sendall(ANNOUNCE + encode(10, bytes(8)))
        assert link.recv(100) == b""
        assert not server.clients
        link.close()
    assert "no proof within" in caplog.text


def test_messages_are_handed_on_before_the_device_is_answered():
    """So that the answer to a request for the time is a receipt for the triggers before it."""
    with serving() as (recorder, _, port), connect(port) as link:
        recorder.flush = lambda: (recorder.messages.append("handed on"), time.sleep(0.2))
        link.sendall(ANNOUNCE + encode(125, b"\x02\x01") + encode(TopicId.TIME, bytes(8)))
        began = time.monotonic()
        assert [packet.topic_id for packet in Parser().feed(link.recv(100))] == [TopicId.TIME]
        assert time.monotonic() - began >= 0.2
        assert recorder.messages[:2] == [b"\x02\x01", "handed on"]


def test_trigger_that_the_server_never_read_is_reported_again():
    with socket.create_server(("127.0.0.1", 0)) as hung:  # takes the bytes and reads none
        sensor = EspClient("127.0.0.1", hung.getsockname()[1], 4, heartbeat_period=0.05).start()
        link, _ = hung.accept()
        link.sendall(REQUEST_TOPICS)
        assert sensor.wait_connected(2.0)
        sensor.trigger()
        time.sleep(0.1)
        link.close()
        link, _ = hung.accept()
        link.settimeout(3.0)
        link.sendall(REQUEST_TOPICS)
        parser, packets = Parser(), []
        while b"\x04\x01" not in [p.data for p in packets]:
            packets += parser.feed(link.recv(4096))
        link.sendall(encode(TopicId.TIME, bytes(8)) * 9)  # it has it now
        time.sleep(0.1)
        link.close()
        link, _ = hung.accept()
        link.settimeout(3.0)
        link.sendall(REQUEST_TOPICS)
        packets = []
        while len(packets) < 6:
            packets += parser.feed(link.recv(4096))
        assert b"\x04\x01" not in [p.data for p in packets]
        link.close()
        sensor.stop()


def test_who_has_sent_least_comes_first_and_nobody_is_left_out(monkeypatch):
    monkeypatch.setattr("rosbot_patrol.rosserial.server.server.ROUND", -1.0)  # one turn between two looks
    recorder = Recorder()
    server = SerialServer(recorder, Policy(), limits=Limits(rate=1000.0))
    (port,) = server.listen([0])
    links = []
    for number in (66, 66, 2):  # two of a flooder, and a sensor
        link = socket.create_connection(("127.0.0.1", port), 3.0, (f"127.0.0.{number}", 0))
        while len(server.clients) <= len(links):
            server.poll(0.1)
        link.sendall(ANNOUNCE)
        links.append(link)
    while len(recorder.opened) < 3:
        server.poll(0.1)
    for link in links[:2]:
        link.sendall(encode(125, b"\x42\x01") * 50)
    while len(recorder.messages) < 100:
        server.poll(0.1)
    recorder.messages.clear()
    for number, link in zip((66, 67, 2), links, strict=True):
        link.sendall(encode(125, bytes((number, 1))))
    server.poll(0.1)
    assert recorder.messages == [b"\x02\x01"]
    links[2].sendall(encode(125, b"\x02\x00"))
    server.poll(0.1)
    assert recorder.messages[1:] == [b"\x02\x00"]
    for _ in range(2):
        server.poll(0.1)
    assert sorted(recorder.messages[2:]) == [b"\x42\x01", b"\x43\x01"]
    for link in links:
        link.close()
    server.close()
