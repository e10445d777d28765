"""An attacker on the port of a real server, over TCP: nothing gets through, and the sensors beside do not notice."""

import contextlib
import threading
import time
from dataclasses import replace

import attacks
import pytest
from attacks import Stranger, announce
from test_server import serving, wait_for

from rosbot_patrol.rosserial.device.tcp_client import EspClient
from rosbot_patrol.rosserial.protocol.packet import encode
from rosbot_patrol.rosserial.protocol.proof import VERSION, Prover
from rosbot_patrol.rosserial.server.admission import Limits
from rosbot_patrol.rosserial.server.policy import Policy, parse_sensors

KEYS = {2: bytes(range(32)), 3: bytes(range(1, 33))}
LISTS = Policy(sensors=parse_sensors(["127.0.0.2 2", "127.0.0.3 3", "127.0.0.66 201"], ""))
LIMITS = Limits(per_address=64, strangers=32, rate=2000.0)
SOURCE = "127.0.0.66"


@contextlib.contextmanager
def house(policy, **options):
    """A server with the sensors 2 and 3, each at its own address; in the end each must never have lost its link."""
    with serving(policy, limits=LIMITS, **options) as (recorder, server, port):
        keys = policy.keys
        sensors = [EspClient("127.0.0.1", port, i, key=keys.get(i), source=f"127.0.0.{i}").start() for i in (2, 3)]
        assert all(sensor.wait_connected(3.0) for sensor in sensors)
        wait_for(lambda: {m[0] for m in recorder.messages} == {2, 3})
        links = list(server.clients.values())
        yield recorder, server, port
        assert len(links) == 2
        assert not any(link.closed for link in links)
        for sensor in sensors:
            before = len(recorder.messages)
            sensor.trigger()
            wait_for(lambda i=sensor.sensor_id, n=before: bytes((i, 1)) in recorder.messages[n:], 3.0)
            sensor.stop()


@pytest.mark.parametrize("name", [name for name in attacks.ATTACKS if "proof" not in name])
def test_a_stranger_without_a_key_before_a_bridge_with_lists(name, caplog):
    with house(LISTS) as (recorder, server, port):
        threads = set(threading.enumerate())
        assert attacks.ATTACKS[name](port, SOURCE, 0.3) > 0
        assert {info.name for _, info in recorder.opened} == {"motion_trigger"}
        heard = {m[0] for m in recorder.messages if isinstance(m, bytes)}
        assert heard <= ({2, 3, 201} if name.startswith(("valid", "wrong", "frames")) else {2, 3})
        assert len(server.clients) <= 2 + LIMITS.per_address
        assert set(threading.enumerate()) <= threads  # one of an earlier test may end meanwhile
    assert len(caplog.records) < 40


@pytest.mark.parametrize("name", attacks.ATTACKS)
def test_a_stranger_before_a_bridge_with_keys(name, caplog):
    with house(Policy(keys=KEYS)) as (recorder, server, port):
        attacks.ATTACKS[name](port, SOURCE, 0.2)
        assert {client.address for client in recorder.clients} == {"127.0.0.2", "127.0.0.3"}
        assert {m[0] for m in recorder.messages} == {2, 3}
        assert len(server.clients) <= 2 + LIMITS.strangers
    assert len(caplog.records) < 40


def test_a_replayed_proof_and_one_for_another_id(caplog):
    with house(Policy(keys=KEYS)) as (recorder, _, port):
        honest = Stranger(port, "127.0.0.2")
        overheard = Prover(2, KEYS[2], VERSION).answer(attacks.challenge_of(honest))
        honest.say(overheard)
        assert honest.hear()[5:6] == b"\x09"  # so it was a good one
        attacks.false_proofs(port, SOURCE, 0.5, overheard, KEYS[2])
        honest.say(announce("motion_trigger", attacks.TRIGGER, 125))
        honest.say(encode(125, b"\x07\x01") + encode(125, b"\x02\x01"))
        wait_for(lambda: b"\x02\x01" in recorder.messages)
        honest.close()
        assert {m[0] for m in recorder.messages} == {2, 3}
        assert SOURCE not in {client.address for client in recorder.clients}
    for text in (
        "a wrong proof for sensor 2 (another key, or an old proof sent again)",
        "a proof for sensor 7, which has no key here",
        "what it says for sensor 7: it has proved to be sensor 2",
    ):
        assert caplog.text.count(text) == 1


def test_sensor_2_does_not_speak_for_sensor_7(caplog):
    with house(LISTS) as (recorder, _, port):
        attacks.foreign_id(port, "127.0.0.2", 0.3)
        assert {m[0] for m in recorder.messages} == {2, 3}
    assert caplog.text.count("refused what it says for sensor 7: the list has it as another sensor") == 1


def test_slow_bytes_are_cut_off_and_strangers_who_say_nothing_are_let_go(caplog):
    with house(replace(LISTS, max_frame_time=1.0), silence_timeout=2.0) as (_, server, port):
        slow, silent = Stranger(port), Stranger(port)
        wait_for(lambda: len(server.clients) == 4)
        slow.say(announce("motion_trigger", attacks.TRIGGER, 125))
        until = time.monotonic() + 4.0
        while slow.is_open and time.monotonic() < until:
            slow.hear(0.1)
            slow.say(b"\xff")
        wait_for(lambda: len(server.clients) == 2)
        assert "refused a frame that does not end within 1 s" in caplog.text
        silent.close()


def test_rate_of_an_address_is_shared_by_its_connections():
    with house(Policy(max_rate=1000.0)) as (recorder, _, port):
        began = time.monotonic()
        attacks.valid_triggers(port, SOURCE, 1.0)
        count = sum(m == b"\xc9\x01" for m in recorder.messages)
        assert count < LIMITS.rate * (2.0 + time.monotonic() - began)
        assert count > 500
