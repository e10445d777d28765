"""Topics and services are named relative to the namespace, so that two guards on one master do not hear each other."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

ROS = Path(__file__).parents[2] / "src" / "rosbot_patrol" / "ros"

CALLS = {"Publisher", "Subscriber", "Service", "ServiceProxy", "SimpleActionClient", "SimpleActionServer"}
CALLS |= {"ActionServer", "ActionClient", "wait_for_service", "wait_for_message", "publisher"}

# What all guards of one master share, and what launch files remap, as tf2 and darknet_ros name it.
SHARED = {"/clock": "one time", "/diagnostics": "names there carry the namespace", "/tf": "tf2's name; remapped"}
SHARED["/tf_static"] = SHARED["/tf"]
# Programs that watch a guard at the root, as the tests do.
WATCHERS = {"campaign/watch.py", "campaign/crash.py", "campaign/patrol.py"}


def absolute_names(path: Path) -> list[str]:
    found = []
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if not isinstance(node, ast.Call) or not node.args:
            continue
        called = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
        name = node.args[0]
        if isinstance(name, ast.JoinedStr) and name.values:
            name = name.values[0]
        if called in CALLS and isinstance(name, ast.Constant) and str(name.value).startswith("/"):
            found.append(str(name.value))
    return found


def test_names_that_begin_at_the_root_are_found(tmp_path: Path) -> None:
    file = tmp_path / "node.py"
    file.write_text("rospy.Publisher('/scan', A)\nrospy.Service(f'/gazebo/{name}', B)\nrospy.Subscriber('map', C)\n")
    assert absolute_names(file) == ["/scan", "/gazebo/"]


@pytest.mark.parametrize("path", sorted(ROS.rglob("*.py")), ids=lambda p: p.relative_to(ROS).as_posix())
def test_no_name_begins_at_the_root(path: Path) -> None:
    if path.relative_to(ROS).as_posix() not in WATCHERS:
        assert [name for name in absolute_names(path) if name not in SHARED] == []


@pytest.mark.parametrize("file", ["simulation.yaml", "twist_mux.yaml", "tuned/costmap_common_params.yaml"])
def test_no_topic_of_our_configuration_begins_at_the_root(file: str) -> None:
    text = (ROS.parents[2] / "config" / file).read_text(encoding="utf-8")
    lines = [line.partition("#")[0] for line in text.splitlines() if "topic" in line]
    assert [line for line in lines if ": /" in line or '"/' in line or "[/" in line] == []
