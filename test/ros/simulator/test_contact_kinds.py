"""/ground_truth/contacts tells apart what the robot drives into: the kind of each thing in a world, in the message."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

pytest.importorskip("rospy", reason="needs ROS: source the workspace first")

from rosbot_patrol.geometry import Pose2D, Twist2D
from rosbot_patrol.ros.simulator.messages import contacts_msg
from rosbot_patrol.simulation.actors.doors import plain_door
from rosbot_patrol.simulation.engine import STEP, Engine
from rosbot_patrol.simulation.robot.description import load_robot
from rosbot_patrol.simulation.sdf.world import load_world

ROOT = Path(__file__).resolve().parents[3]
MODEL = """<model name="{name}"><pose>0.6 0 0.5 0 0 0</pose><link name="link"><collision name="c"><geometry>
<box><size>0.2 1 1</size></box></geometry></collision></link></model>"""


def put(engine: Engine, kind: str) -> None:
    ahead = Pose2D(0.6, 0.0, math.pi)
    if kind == "door":
        engine.population.spawn_door(plain_door("it", Pose2D(0.6, -0.4, math.pi / 2.0)))
    elif kind == "object":
        engine.population.place_box("it", ahead, (0.3, 0.3, 0.3))
    elif kind in ("person", "hydrant", "cat", "dog"):
        engine.population.spawn_actor("it", {"hydrant": "fire_hydrant"}.get(kind, kind), "", ahead)


@pytest.mark.parametrize(
    ("what", "kind"),
    [("Wall_3", "wall"), ("wardrobe", "furniture"), ("person", "person"), ("hydrant", "hydrant"), ("cat", "pet"),
     ("dog", "pet"), ("door", "door"), ("object", "object")],
)  # fmt: skip
def test_a_contact_says_what_was_touched(tmp_path: Path, what: str, kind: str) -> None:
    file = tmp_path / "some.world"
    model = MODEL.format(name=what) if what in ("Wall_3", "wardrobe") else ""
    file.write_text(f"<sdf version='1.6'><world name='w'>{model}</world></sdf>")
    engine = Engine(load_world(file))
    engine.spawn_robot(load_robot(ROOT / "urdf" / "rosbot.urdf"))
    put(engine, what)
    for _ in range(round(4.0 / STEP)):
        engine.command(Twist2D(0.3, 0.0, 0.0))
        engine.step()
    sent = contacts_msg(engine.touches(), engine.now, "base_link").contacts
    engine.close()
    assert {c.kind for c in sent} == {kind}
    assert {c.other for c in sent} == {what if model else "it"}
    assert all(c.normal.x < -0.5 for c in sent), "it is pushed back"
