"""Who is let in, and who leaves for a newcomer."""

import logging

from rosbot_patrol.rosserial.server.admission import KEPT_ADDRESSES, Door, Limits
from rosbot_patrol.rosserial.server.budget import Budget
from rosbot_patrol.rosserial.server.client import Client
from rosbot_patrol.rosserial.server.complaints import Complaints, printable
from rosbot_patrol.rosserial.server.journal import Journal
from rosbot_patrol.rosserial.server.policy import Policy
from rosbot_patrol.rosserial.server.session import Session


class Link:
    def __init__(self, takes=0):
        self.takes, self.sent = takes, b""

    def fileno(self):
        return -1

    def send(self, data):
        if not self.takes:
            raise BlockingIOError
        sent = data[: self.takes]
        self.sent += sent
        self.takes -= len(sent)
        return len(sent)


def client(address, link=None, **options):
    return Client(link or Link(), Session(Policy(**options), 0.0), f"{address}:1", address)


def enter(door, address, now=0.0):
    reason, leaver = door.ask(address, now)
    if leaver is not None:
        door.leave(leaver)
    if reason is not None:
        return reason
    new = client(address)
    door.enter(new, now)
    return new


def test_strangers_of_one_address_leave_in_the_order_in_which_they_came():
    door = Door(Limits(strangers=2))
    first, second = enter(door, "a"), enter(door, "a")
    assert door.ask("b", 0.0) == (None, None)
    assert door.ask("a", 0.0) == (None, first)
    door.settle(first)
    third = enter(door, "a")
    assert door.ask("a", 0.0) == (None, second)
    assert door.strangers == 2
    door.leave(second)
    door.leave(third)
    assert door.strangers == 0


def test_sensors_of_one_address_are_limited_and_nobody_leaves_for_them():
    door = Door(Limits(per_address=2))
    for _ in range(2):
        door.settle(enter(door, "a"))
    assert enter(door, "a") == "2 clients of its address are connected"
    stranger = enter(door, "b")
    assert isinstance(stranger, Client)


def test_full_bridge_lets_its_oldest_stranger_go_but_first_one_of_the_same_address():
    door = Door(Limits(clients=3))
    sensor, old, own = enter(door, "s"), enter(door, "a"), enter(door, "b")
    door.settle(sensor)
    assert door.ask("b", 0.0) == (None, own)
    assert door.ask("c", 0.0) == (None, old)
    door.settle(old)
    door.settle(own)
    assert door.ask("c", 0.0) == ("3 clients are connected", None)
    door.leave(old)
    assert door.ask("c", 0.0) == (None, None)


def test_who_connects_all_the_time_is_let_in_no_more_for_a_while():
    door = Door(Limits(rate=100.0))
    taken = 0
    while not isinstance(new := enter(door, "a"), str):
        door.leave(new)
        taken += 1
    assert new == "its address connects or sends too often"
    assert taken == 7
    assert door.ask("b", 0.0) == (None, None)
    assert door.ask("a", 0.5) == (None, None)
    assert enter(door, "a", 2.0).shared.spend(100.0, 2.0) > 0.7


def test_addresses_that_have_gone_are_forgotten():
    door = Door(Limits(clients=10))
    for number in range(5 * KEPT_ADDRESSES):
        door.leave(enter(door, str(number)))
    assert len(door._crowds) <= KEPT_ADDRESSES + 10


def test_one_key_is_worth_few_connections():
    door = Door(Limits())
    clients = [enter(door, str(number)) for number in range(5)]
    assert [door.prove(each, 2) for each in clients] == [True] * 4 + [False]
    for each in clients:
        each.session._voice.prove(2)
        door.leave(each)
    assert door.prove(enter(door, "x"), 2)


def test_budget_fills_up_to_one_second():
    budget = Budget(100.0, 0.0)
    assert budget.spend(100.0, 0.0) == 0.0
    assert budget.spend(50.0, 0.0) == 0.5
    assert budget.spend(0.0, 0.5) == 0.0
    assert budget.spend(150.0, 100.0) == 0.5
    assert Budget(0.0, 0.0).spend(1e9, 0.0) == 0.0


def test_what_waits_for_a_client_is_bounded_in_bytes_and_the_half_sent_frame_stays():
    link = Link(takes=5)
    it = client("a", link, max_waiting=1000, max_payload=1024)
    it.flush()
    for number in range(100):
        it.put(125, bytes((number,)) * 90)
    assert it.discarded > 80
    link.takes = 10**6
    it.flush()
    assert len(link.sent) <= 1000 + 98
    assert link.sent.startswith(b"\xff\xfe\0\0\xff\0\0\xff")
    assert link.sent.endswith(bytes((99,)) * 90 + link.sent[-1:])
    assert not it.wants_write


def test_a_client_that_reads_nothing_is_noticed():
    link = Link()
    it = client("a", link)
    it.flush()
    assert not any(it.is_stuck(now) for now in (1001.0, 1010.0, 1015.9))
    assert it.is_stuck(1016.1)
    link.takes = 3
    it.flush()
    assert not it.is_stuck(1017.0)
    link.takes = 100
    it.flush()
    assert not it.is_stuck(1100.0)
    it.put(125, b"1")
    assert not it.is_stuck(1101.0)


def test_lines_about_a_peer_are_limited_and_that_is_said_once():
    said = Complaints()
    heard = [(said.may_speak("a", 0.1 * i, limit=3), said.left_out) for i in range(6)]
    assert heard == [(True, False)] * 3 + [(False, True)] + [(False, False)] * 2
    assert said.may_speak("a", 61.0, limit=3)


def test_log_is_not_flooded_however_many_come(caplog):
    journal = Journal()
    for number in range(2000):
        journal.turn_away(f"10.0.{number}:1", f"10.0.{number}", "its address is not on the list", 0.01 * number)
        journal.refuse(client(f"10.1.{number}"), f"topic {number}", 0.01 * number)
        journal.refuse(client("10.2.0.1"), f"topic {number}", 0.01 * number)
        journal.say(client("10.3.0.1"), logging.WARNING, 0.01 * number, "connected")
    assert (journal.turned_away, journal.refused) == (2000, 4000)
    assert len(caplog.records) <= 124
    for name in ("strangers", "refusals of 10.2.0.1", "10.3.0.1"):
        assert caplog.text.count(f"{name}: more than ") <= 1
    assert "strangers: more than 120 lines within a minute, the rest of them is left out" in caplog.text


def test_who_tries_again_and_again_is_told_of_once(caplog):
    caplog.set_level("INFO")
    journal = Journal()
    for number in range(20):
        device = client("10.0.0.9", keys={2: bytes(range(32))})
        journal.come(device, 3.0 * number)
        journal.go(device, "it closed the connection", 3.0 * number)
    assert [record.message for record in caplog.records] == [
        "10.0.0.9:1: connected",
        "10.0.0.9:1: disconnected, it closed the connection, without a proof (has it a key?)",
    ]


def test_what_a_stranger_says_stays_one_line():
    assert printable("a\n[ERROR] b\x1b[2J\u202e").replace("\N{REPLACEMENT CHARACTER}", "?") == "a?[ERROR] b?[2J?"
    assert printable("x" * 300) == "x" * 200 + "..."
