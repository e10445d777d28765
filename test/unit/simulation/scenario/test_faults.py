"""Each fault as it is declared, and as it is seen in what the engine measures."""

from __future__ import annotations

import logging
import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from rosbot_patrol.errors import ParamError, WorldError
from rosbot_patrol.geometry import Pose2D, Twist2D
from rosbot_patrol.simulation.engine import STEP, Engine, EngineParams
from rosbot_patrol.simulation.robot.description import load_robot
from rosbot_patrol.simulation.robot.drive import DriveParams
from rosbot_patrol.simulation.scenario.faults import KINDS, Doorway, read_fault
from rosbot_patrol.simulation.scene.scene import Body, Collision, Shape
from rosbot_patrol.simulation.sdf.world import World
from rosbot_patrol.simulation.sensors.motion_sensors import MotionSensorParams, SensorPlace

ROOT = Path(__file__).parents[4]
SENSOR = SensorPlace(id=5, room=5, x=0.0, y=3.0, yaw=0.0)
REQUIRED = {
    "wheel_stuck": {"target": "left"},
    "motion_stuck": {"target": 5},
    "motion_silent": {"target": 5},
    "motion_flapping": {"target": 5},
    "motion_rebooting": {"target": 5},
    "doorway_blocked": {"target": "door"},
    "robot_carried": {"x": 2.0, "y": 1.0},
}


class FlatRenderer:
    """Pictures whose every colour is the number of the picture."""

    def __init__(self) -> None:
        self.count = 0
        self.bodies: list[str] = []

    def add(self, body: Body) -> None:
        self.bodies.append(body.name)

    def remove(self, name: str) -> None:
        self.bodies.remove(name)

    def move(self, name: str, pose: object) -> None:
        pass

    def pose_visuals(self, name: str, poses: object) -> None:
        pass

    def render(self, pose: object, camera: object) -> tuple[np.ndarray, np.ndarray]:
        self.count += 1
        return np.full((480, 640, 3), 10 * self.count, np.uint8), np.full((480, 640), 1.0, np.float32)

    def close(self) -> None:
        pass


@pytest.fixture
def engine() -> Iterator[Engine]:
    wall = Body(
        name="wall",
        kind="wall",
        pose=np.array([[1, 0, 0, -2.0], [0, 1, 0, 0], [0, 0, 1, 1.0], [0, 0, 0, 1]]),
        collisions=(Collision(shape=Shape(kind="box", size=(0.2, 4.0, 2.0))),),
    )
    engine = Engine(
        World(bodies=(wall,)),
        EngineParams(drive=DriveParams(slip=0.0, scrub=0.0), motion=MotionSensorParams(warm_up=10.0)),
        sensors=[SENSOR],
        doorways={"door": Doorway(x=2.0, y=0.0, yaw=math.pi / 2)},
        make_renderer=FlatRenderer,  # type: ignore[arg-type]
    )
    engine.spawn_robot(load_robot(ROOT / "urdf" / "rosbot.urdf"))
    yield engine
    engine.close()


def begin(engine: Engine, kind: str, **keys: object) -> None:
    engine.faults.begin(read_fault({"kind": kind, **keys}, source="test: "), engine.now)


def drive(engine: Engine, vx: float, seconds: float) -> None:
    for _ in range(round(seconds / STEP)):
        engine.command(Twist2D(vx, 0.0, 0.0))
        engine.step()


def wait(engine: Engine, seconds: float) -> None:
    for _ in range(round(seconds / STEP)):
        engine.step()


@pytest.mark.parametrize("kind", KINDS)
def test_each_kind_begins_ends_after_its_duration_and_is_logged(engine: Engine, kind: str, caplog) -> None:
    with caplog.at_level(logging.INFO):
        begin(engine, kind, **REQUIRED.get(kind, {}), duration=0.5)
        is_lasting = bool(engine.faults.active)
        assert is_lasting == (kind not in ("robot_carried", "motion_rebooting"))
        wait(engine, 0.49)
        assert bool(engine.faults.active) == is_lasting
        wait(engine, 0.02)
    assert not engine.faults.active
    said = [r.message for r in caplog.records if kind in r.message]
    assert [text.split(" at ")[0] for text in said] == (["fault begins", "fault ends"] if is_lasting else ["fault"])
    assert not is_lasting or said[1].startswith("fault ends at 0.50 s")


def test_a_frozen_camera_shows_the_same_picture_and_goes_on_afterwards(engine: Engine) -> None:
    before = engine.picture()
    begin(engine, "camera_frozen", duration=1.0)
    first = engine.picture()
    wait(engine, 0.5)
    assert np.array_equal(first.colour, engine.picture().colour)
    assert not np.array_equal(first.colour, before.colour)
    wait(engine, 0.6)
    assert not np.array_equal(first.colour, engine.picture().colour)


def test_a_black_camera_sees_nothing_and_a_silent_one_says_so(engine: Engine) -> None:
    begin(engine, "camera_black")
    picture = engine.picture()
    assert picture.colour.shape == (480, 640, 3)
    assert not picture.colour.any()
    assert np.isnan(picture.depth).all()
    assert not engine.faults.is_silent("camera")
    begin(engine, "camera_silent")
    begin(engine, "lidar_silent", duration=1.0)
    assert engine.faults.is_silent("camera")
    assert engine.faults.is_silent("lidar")
    wait(engine, 1.01)
    assert not engine.faults.is_silent("lidar")


def test_wheels_that_slip_turn_and_the_odometry_believes_them(engine: Engine) -> None:
    begin(engine, "odometry_slip", factor=0.25)
    drive(engine, 0.2, 5.0)
    assert engine.pose.x == pytest.approx(0.25, abs=0.02)
    assert engine.robot.odometry.pose.x == pytest.approx(1.0, abs=0.03)


@pytest.mark.parametrize(("side", "turn"), [("left", 1.0), ("right", -1.0)])
def test_a_stuck_wheel_makes_it_drive_in_a_circle_about_it(engine: Engine, side: str, turn: float) -> None:
    begin(engine, "wheel_stuck", target=side)
    drive(engine, 0.1, 3.0)
    assert engine.robot.wheels[0][0 if side == "left" else 1] == 0.0
    assert engine.pose.yaw == pytest.approx(turn * 0.1 / 0.2 * 3.0, abs=0.1)


def test_a_stuck_and_a_flapping_motion_sensor(engine: Engine) -> None:
    begin(engine, "motion_stuck", target=5, duration=2.0)
    assert engine.motion_sensors.changes(engine.now) == [(5, True)]
    wait(engine, 1.9)
    assert engine.motion_sensors.changes(engine.now) == []
    wait(engine, 0.2)
    assert engine.motion_sensors.changes(engine.now) == [(5, False)]
    begin(engine, "motion_flapping", target=5, period=2.0)
    edges = []
    for _ in range(round(7.9 / STEP)):
        edges += [(round(engine.now, 2), level) for _, level in engine.motion_sensors.changes(engine.now)]
        engine.step()
    assert [level for _, level in edges] == [True, False] * 4
    assert np.diff([at for at, _ in edges]) == pytest.approx(1.0)


def test_a_sensor_that_reboots_is_blind_while_it_warms_up(engine: Engine) -> None:
    begin(engine, "motion_rebooting", target=5)
    assert engine.motion_sensors.restarted() == [5]
    assert engine.motion_sensors.restarted() == []
    engine.population.spawn_actor("bob", "person", "", Pose2D(3.0, 1.0, 0.0))
    engine.population.move_actor("bob", [Pose2D(3.0, 5.0, 0.0), Pose2D(3.0, 1.0, 0.0)], 1.0, True)
    rises = []
    for _ in range(round(12.0 / STEP)):
        engine.step()
        rises += [engine.now for _, level in engine.motion_sensors.changes(engine.now) if level]
    assert 10.0 <= rises[0] < 13.0
    begin(engine, "motion_rebooting", target=5, every=1.0, duration=3.5)
    wait(engine, 4.0)
    assert engine.motion_sensors.restarted() == [5] * 4


def test_what_is_wrong_with_a_link(engine: Engine) -> None:
    assert engine.faults.link(5) is None
    begin(engine, "link_poor", loss=0.2, delay=1.5)
    link = engine.faults.link(5)
    assert link is not None
    assert (link.loss, link.delay) == (0.2, 1.5)
    begin(engine, "motion_silent", target=5)
    assert engine.faults.link(5).loss == 1.0
    assert engine.faults.clear(engine.now, "motion_silent", "5")
    assert engine.faults.link(5).loss == 0.2


def test_a_blocked_doorway_is_met_by_lidar_camera_and_bumper_until_it_is_clear(engine: Engine) -> None:
    free = engine.scan().ranges
    engine.picture()
    begin(engine, "doorway_blocked", target="door")
    assert np.count_nonzero((engine.scan().ranges < 2.2) & (free > 2.2)) > 20
    engine.picture()
    assert "doorway_blocked door" in engine._camera.renderer.bodies
    drive(engine, 0.4, 6.0)
    assert {t.other for t in engine.touches()} == {"doorway_blocked door"}
    assert engine.pose.x == pytest.approx(1.75, abs=0.03)
    assert [str(f) for f in engine.faults.clear(engine.now, "doorway_blocked")] == ["doorway_blocked door (2.00, 0.00)"]
    engine.picture()
    assert "doorway_blocked door" not in engine._camera.renderer.bodies
    drive(engine, 0.4, 2.0)
    assert engine.pose.x > 2.3


def test_no_box_where_the_robot_stands(engine: Engine) -> None:
    with pytest.raises(WorldError, match=r"cannot stand at \(0.00, 0.10\), the robot is there"):
        begin(engine, "doorway_blocked", x=0.0, y=0.1)
    assert not engine.faults.active
    drive(engine, 0.2, 2.0)
    assert engine.pose.x > 0.3


def test_a_carried_robot_is_elsewhere_and_its_odometry_knows_nothing(engine: Engine) -> None:
    drive(engine, 0.2, 1.0)
    believed = engine.robot.odometry.pose
    begin(engine, "robot_carried", x=3.0, y=1.0, yaw=1.0)
    engine.step()
    assert engine.pose == pytest.approx((3.0, 1.0, 1.0), abs=1e-6)
    assert engine.robot.odometry.pose == believed
    with pytest.raises(WorldError, match="'wall' is there"):
        begin(engine, "robot_carried", x=-2.0, y=0.0)
    assert engine.pose == pytest.approx((3.0, 1.0, 1.0), abs=1e-6)


def test_the_same_seed_and_the_same_faults_give_the_same_data() -> None:
    def run() -> list[np.ndarray]:
        engine = Engine(World(), EngineParams(seed=3))
        engine.spawn_robot(load_robot(ROOT / "urdf" / "rosbot.urdf"))
        begin(engine, "odometry_slip", factor=0.5, duration=1.0)
        drive(engine, 0.2, 2.0)
        begin(engine, "doorway_blocked", x=3.0, y=0.0, duration=1.0)
        data = [engine.scan().ranges, np.array(engine.pose)]
        drive(engine, 0.3, 1.5)
        data += [engine.scan().ranges, np.array(engine.pose)]
        engine.close()
        return data

    for a, b in zip(run(), run(), strict=True):
        assert np.array_equal(a, b)


@pytest.mark.parametrize(
    ("tree", "sentence"),
    [
        ({"kind": "camera_forzen"}, "f: kind: 'camera_forzen' is not known here, did you mean 'camera_frozen'?"),
        ({}, "f: kind: is missing"),
        ({"kind": "odometry_slip", "facter": 1}, "f: facter: 'facter' is not known here, did you mean 'factor'?"),
        ({"kind": "odometry_slip", "factor": 2}, "f: factor: is 2.0, expected at most 1.0"),
        ({"kind": "lidar_silent", "duration": -1}, "f: duration: is -1.0, expected at least 0.0 s"),
        ({"kind": "lidar_silent", "at": math.inf}, "f: at: is inf, expected a finite number"),
        ({"kind": "wheel_stuck", "target": "front"}, "f: target: is 'front', expected one of left, right"),
        ({"kind": "motion_stuck"}, "f: target: is missing, expected a whole number"),
        ({"kind": "doorway_blocked", "x": 1.0}, "f: target: is missing: name a doorway, or say x and y"),
        ({"kind": "robot_carried", "x": math.nan, "y": 0}, "f: x: expected a number [m], got nan"),
    ],
)
def test_a_fault_that_is_wrong_is_said_in_a_sentence(tree: dict[str, object], sentence: str) -> None:
    with pytest.raises(ParamError) as caught:
        read_fault(tree, source="f: ")
    assert str(caught.value).startswith(sentence)


@pytest.mark.parametrize(
    ("kind", "keys", "sentence"),
    [
        ("motion_stuck", {"target": 9}, "there is no motion sensor 9 (there: 5)"),
        ("doorway_blocked", {"target": "dor"}, "did you mean 'door'?"),
    ],
)
def test_a_target_that_is_not_there(engine: Engine, kind: str, keys: dict[str, object], sentence: str) -> None:
    with pytest.raises(WorldError) as caught:
        begin(engine, kind, **keys)
    assert sentence in str(caught.value)
