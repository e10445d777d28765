"""What the simulator sends of which robot and when, and that a sensor nobody listens to costs nothing."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rospy", reason="ROS is not on the path: `. scripts/env` first")

from rosbot_patrol.ros.simulator import messages
from rosbot_patrol.ros.simulator import outputs as simulator_outputs
from rosbot_patrol.ros.simulator.outputs import STEPS_PER_TICK, Outputs, is_due
from rosbot_patrol.ros.simulator.pace import SharedClock
from rosbot_patrol.ros.simulator.readings import RateParams, Readings
from rosbot_patrol.simulation.engine import Engine
from rosbot_patrol.simulation.robot.description import load_robot
from rosbot_patrol.simulation.scene.scene import Body
from rosbot_patrol.simulation.sdf.world import World

ROOT = Path(__file__).parents[3]
TWO_WHEELER = ROOT / "test/unit/simulation/data/two_wheeler_description/urdf/two_wheeler.urdf"


class Wire:
    """A publisher that keeps what is sent; `heard` are the topics that somebody listens to."""

    heard: set[str] = set()
    sent: dict[str, list[Any]] = {}

    def __init__(self, topic: str, *_: object, **__: object) -> None:
        self.topic = simulator_outputs.rospy.resolve_name(topic)
        Wire.sent.setdefault(self.topic, [])

    def get_num_connections(self) -> int:
        return int(self.topic in Wire.heard)

    def publish(self, message: Any) -> None:
        Wire.sent[self.topic].append(message)


class CountingRenderer:
    """Draws nothing, and counts how often."""

    renders = 0

    def add(self, body: Body) -> None:
        pass

    def close(self) -> None:
        pass

    def render(self, _: object, view: Any) -> tuple[np.ndarray, np.ndarray]:
        CountingRenderer.renders += 1
        shape = (view.height, view.width)
        return np.zeros((*shape, 3), np.uint8), np.full(shape, 2.0, np.float32)


@pytest.fixture
def casts(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """How many beams each cast had."""
    Wire.heard, Wire.sent, CountingRenderer.renders = set(), {}, 0
    monkeypatch.setattr(simulator_outputs.rospy, "Publisher", Wire)
    from rosbot_patrol.simulation.scene.slices import Slice

    counted: list[int] = []
    cast = Slice.cast

    def counting(self: Slice, *args: Any, longest: float) -> Any:
        counted.append(args[4])
        return cast(self, *args, longest=longest)

    monkeypatch.setattr(Slice, "cast", counting)
    return counted


def run(
    urdf: Path, seconds: float, *topics: str, rates: RateParams | None = None, shared: SharedClock | None = None
) -> Engine:
    engine = Engine(World(), make_renderer=CountingRenderer)  # type: ignore[arg-type]
    engine.spawn_robot(load_robot(urdf))
    Wire.heard = set(topics)
    rates = rates or RateParams()
    outputs = Outputs(engine, rates, Readings(engine, rates), shared=shared)
    for tick in range(1, round(seconds / simulator_outputs.TICK) + 1):
        for _ in range(STEPS_PER_TICK):
            engine.step()
        outputs.publish(tick)
    engine.close()
    return engine


def test_a_sensor_nobody_listens_to_costs_nothing(casts: list[int]) -> None:
    run(ROOT / "urdf" / "rosbot.urdf", 1.0)
    assert (casts, CountingRenderer.renders) == ([], 0)
    assert {topic for topic, sent in Wire.sent.items() if sent} == {"/clock", "/tf"}


@pytest.mark.parametrize(
    ("topic", "beams", "renders"),
    [
        ("/scan", [720] * 10, 0),
        ("/range/fl", [5] * 4 * 5, 0),
        ("/camera/rgb/image_raw", [], 10),
        ("/camera/depth/points", [], 10),
        ("/camera/rgb/camera_info", [], 0),
        ("/rosbot/imu", [], 0),
    ],
)
def test_one_listener_is_one_measurement_each(casts: list[int], topic: str, beams: list[int], renders: int) -> None:
    run(ROOT / "urdf" / "rosbot.urdf", 1.0, topic)
    assert (casts, CountingRenderer.renders) == (beams, renders)
    assert Wire.sent[topic]


def test_with_a_clock_of_another_node_there_is_none_of_its_own_and_stamps_are_of_that(casts: list[int]) -> None:
    shared = SharedClock(lambda: 500.0)
    shared.restart(0.0)
    run(ROOT / "urdf" / "rosbot.urdf", 1.0, "/scan", "/odom", "/rosbot/imu", "/battery", shared=shared)
    assert "/clock" not in Wire.sent
    for topic in ("/scan", "/odom", "/rosbot/imu", "/battery"):
        stamps = [message.header.stamp.to_sec() for message in Wire.sent[topic]]
        assert 500.0 < stamps[0] <= stamps[-1] <= 501.001, topic
    assert Wire.sent["/tf"][-1].transforms[0].header.stamp.to_sec() == pytest.approx(501.0)


def test_another_robot_speaks_of_its_own_frames(casts: list[int]) -> None:
    heard = ("/odom", "/scan", "/rosbot/imu", "/joint_states", "/battery", "/camera/rgb/image_raw", "/range/fl")
    run(TWO_WHEELER, 1.0, *heard)
    last = {topic: sent[-1] for topic, sent in Wire.sent.items() if sent}
    assert last["/tf"].transforms[0].child_frame_id == "base_footprint"
    assert last["/odom"].child_frame_id == "base_footprint"
    assert last["/scan"].header.frame_id == "base_scan"
    assert last["/camera/rgb/image_raw"].header.frame_id == "camera_rgb_optical_frame"
    assert last["/rosbot/imu"].header.frame_id == "imu_link"
    assert last["/battery"].header.frame_id == "base_footprint"
    joints = last["/joint_states"]
    assert joints.name == ["wheel_left_joint", "wheel_right_joint", "caster_swivel_joint", "caster_wheel_joint"]
    assert not any(topic.startswith("/range/") for topic in Wire.sent)


def test_wheels_turn_about_the_axis_that_the_file_gives() -> None:
    message = messages.joints_msg(load_robot(TWO_WHEELER), (1.0, 2.0), (3.0, 4.0), 1.0)
    assert message.position == [1.0, -2.0, 0.0, 0.0]  # the right wheel's axis points to the right
    assert message.velocity == [3.0, -4.0, 0.0, 0.0]


def test_a_robot_without_sensors_sends_none(casts: list[int], tmp_path: Path) -> None:
    bare = "".join(
        f"<link name='{n}'><collision><geometry><sphere radius='0.05'/></geometry></collision></link>"
        f"<joint name='{n}_joint' type='continuous'><origin xyz='0 {y} 0'/><parent link='body'/>"
        f"<child link='{n}'/></joint>"
        for n, y in (("left", 0.1), ("right", -0.1))
    )
    path = tmp_path / "bare.urdf"
    path.write_text(f"<robot name='bare'><link name='body'/>{bare}</robot>", encoding="utf-8")
    run(path, 0.5, "/scan", "/rosbot/imu", "/camera/rgb/image_raw", "/camera/depth/image_raw", "/joint_states")
    assert {topic for topic, sent in Wire.sent.items() if sent} == {"/clock", "/tf", "/joint_states"}


def test_forty_scans_a_second_of_720_beams(casts: list[int]) -> None:
    run(ROOT / "urdf" / "rosbot.urdf", 2.0, "/scan", rates=RateParams(scan=40.0))
    assert casts == [720] * 80
    stamps = [m.header.stamp.to_sec() for m in Wire.sent["/scan"]]
    assert np.diff(stamps).min() > 0.019
    assert np.diff(stamps).max() < 0.031


@pytest.mark.parametrize("rate", [0.5, 1.0, 3.0, 10.0, 30.0, 40.0, 100.0])
def test_what_has_a_rate_is_due_that_often(rate: float) -> None:
    assert sum(is_due(tick, rate) for tick in range(1, 1001)) == 10 * rate
