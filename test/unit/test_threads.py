"""Every thread that a node cannot do without is a `Worker`: where it fails, the node ends and starts again."""

from __future__ import annotations

import ast
from pathlib import Path

ROS = Path(__file__).parents[2] / "src" / "rosbot_patrol" / "ros"

# Plain threads whose failure leaves no node half dead, and why.
PLAIN = {
    "runtime/node.py": "ends the node on a signal",
    "runtime/greeting.py": "one a link; ends with it",
    "runtime/connections.py": "one a subscriber; what fails there is raised where the node publishes next",
    "runtime/by_hand.py": "asks the master before a tool is a node",
    "campaign/mail_sink.py": "a server of the standard library in a program that is no node",
}


def plain_threads(path: Path) -> int:
    calls = [node.func for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, ast.Call)]
    names = {"Thread", "Timer"}
    return sum(
        (isinstance(call, ast.Attribute) and call.attr in names and ast.unparse(call.value) == "threading")
        or (isinstance(call, ast.Name) and call.id in names)
        for call in calls
    )


def test_no_node_has_a_thread_that_dies_in_silence() -> None:
    found = {path.relative_to(ROS).as_posix() for path in ROS.rglob("*.py") if plain_threads(path)}
    assert found <= set(PLAIN), f"use Worker of ros/runtime/node.py in {sorted(found - set(PLAIN))}"
    assert "runtime/node.py" in found
