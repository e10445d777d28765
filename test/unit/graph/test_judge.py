"""What is wrong with a ROS graph: drivers, strangers, links, settings, open ports."""

from __future__ import annotations

from typing import Any

import pytest

from rosbot_patrol.graph.judge import GONE, MUTE, SETTLED, Expected, Fault, Finding, Judge
from rosbot_patrol.graph.snapshot import Snapshot, digests

MINE = "http://localhost:40001/"
EXPECTED = Expected(
    driven="/cmd_vel",
    witnessed={"/camera": "the camera"},
    published={"/camera": "the camera"},
    subscribed={"/motion_trigger": "the patrol's ear"},
    is_known_host=lambda host: host == "localhost",
)


def graph(**changes: Any) -> Snapshot:
    publishers = {"/cmd_vel": frozenset({"/twist_mux"}), "/camera": frozenset({"/usb_cam"})}
    values = {"publishers": publishers, "subscribers": {"/motion_trigger": frozenset({"/patrol"})}}
    return Snapshot(**{**values, "uris": {"/twist_mux": MINE}, **changes})


def faults(found: list[Finding]) -> list[Fault]:
    return [each.fault for each in found]


@pytest.fixture
def judge() -> Judge:
    return Judge(EXPECTED)


def test_a_graph_as_it_should_be(judge: Judge) -> None:
    assert judge.look(graph(parameters={"/patrol": digests({"x": 1})}, listening=frozenset()), 0.0) == []


def test_a_second_driver_is_named(judge: Judge) -> None:
    (found,) = judge.look(graph(publishers={"/cmd_vel": frozenset({"/twist_mux", "/thief"})}), 0.0)
    assert found.fault is Fault.SECOND_DRIVER
    assert "/thief, /twist_mux" in found.what


def test_a_second_camera_is_named(judge: Judge) -> None:
    publishers = {"/cmd_vel": frozenset({"/twist_mux"}), "/camera": frozenset({"/usb_cam", "/liar"})}
    (found,) = judge.look(graph(publishers=publishers), 0.0)
    assert (found.fault, found.subject) == (Fault.SECOND_WITNESS, "topic /camera")
    assert found.what == "has 2 publishers where the camera alone may speak: /liar, /usb_cam"


def test_a_node_of_a_strange_machine(judge: Judge) -> None:
    (found,) = judge.look(graph(uris={"/x": "http://10.77.0.3:4000/"}), 0.0)
    assert (found.fault, found.subject) == (Fault.STRANGE_NODE, "node /x")
    assert "10.77.0.3" in found.what


@pytest.mark.parametrize("side", ["publishers", "subscribers"])
def test_a_link_that_was_there_and_is_gone(judge: Judge, side: str) -> None:
    judge.look(graph(), 0.0)
    judge.look(graph(), SETTLED)
    without = graph(**{side: {"/cmd_vel": frozenset({"/twist_mux"})} if side == "publishers" else {}})
    assert judge.look(without, SETTLED + GONE - 1.0) == []  # a node that starts again
    assert faults(judge.look(without, SETTLED + GONE)) == [Fault.LINK_GONE]
    assert judge.look(graph(), SETTLED + GONE + 1.0) == []


def test_what_was_never_there_for_long_is_not_missed(judge: Judge) -> None:
    judge.look(graph(), 0.0)
    assert judge.look(graph(publishers={}), GONE + 1.0) == []


def test_settings_that_differ_from_the_start(judge: Judge) -> None:
    first = {"/patrol": digests({"email_to": "me@home", "url": "a"}, frozenset({"url"}))}
    assert judge.look(graph(parameters=first), 0.0) == []
    now = {"/patrol": digests({"email_to": "thief@evil", "url": "b"}, frozenset({"url"}))}
    (found,) = judge.look(graph(parameters=now), 1.0)
    assert found.fault is Fault.SETTINGS_CHANGED
    assert "email_to changed" in found.what
    assert "thief" not in found.what  # no value is told
    assert faults(judge.look(graph(), 2.0)) == [Fault.SETTINGS_CHANGED]  # not asked this time
    assert judge.look(graph(parameters=first), 3.0) == []


def test_open_ports_of_master_and_nodes(judge: Judge) -> None:
    (found,) = judge.look(graph(listening=frozenset({11311, 40001, 22})), 0.0)
    assert found.fault is Fault.GRAPH_OPEN
    assert "the ROS master (11311) and 1 node: /twist_mux (40001)" in found.what
    assert judge.look(graph(listening=frozenset({22})), 1.0) == []


def test_a_master_that_does_not_answer(judge: Judge) -> None:
    assert judge.no_answer(0.0, []) == []
    before = judge.look(graph(publishers={}, run_id="a"), 1.0)
    assert judge.no_answer(5.0, before) == before
    (found,) = judge.no_answer(1.0 + MUTE, before)
    assert (found.fault, found.subject) == (Fault.MASTER_GONE, "the ROS master")
    assert judge.look(graph(run_id="a"), 20.0) == []


def test_a_master_that_was_started_anew_is_told_alone(judge: Judge) -> None:
    judge.look(graph(run_id="a", parameters={"/patrol": digests({"x": 1})}), 0.0)
    (found,) = judge.look(graph(run_id="b", publishers={}, subscribers={}, parameters={"/patrol": {}}), 100.0)
    assert found.fault is Fault.MASTER_GONE
    assert "started anew" in found.what
