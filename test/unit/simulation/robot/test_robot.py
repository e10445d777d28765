"""URDF robots: the shipped one, one on two wheels with casters and meshes, and the sentence for what cannot be."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from rosbot_patrol.errors import WorldError
from rosbot_patrol.geometry import Pose2D, Twist2D
from rosbot_patrol.simulation.engine import STEP, Engine, EngineParams
from rosbot_patrol.simulation.robot.description import FrameParams, RobotDescription, load_robot, parse_robot
from rosbot_patrol.simulation.robot.drive import DriveParams
from rosbot_patrol.simulation.robot.odometry import OdometryParams
from rosbot_patrol.simulation.scene.matrices import from_xyz_rpy, to_pose2d
from rosbot_patrol.simulation.scene.scene import Body, Collision, Shape
from rosbot_patrol.simulation.sdf.world import World

URDF = Path(__file__).parents[4] / "urdf" / "rosbot.urdf"
TWO_WHEELER = Path(__file__).parents[1] / "data" / "two_wheeler_description" / "urdf" / "two_wheeler.urdf"
EXACT = {
    "drive": DriveParams(slip=0.0, scrub=0.0),
    "encoder": OdometryParams(radius_error=0.0, track_error=0.0, ticks_per_turn=1e6),
}


def two_wheels(extra: str = "", *, right: str = "-0.1") -> str:
    joints = "".join(
        f"<joint name='{side}_joint' type='continuous'><origin xyz='0 {y} 0'/><parent link='base'/>"
        f"<child link='{side}'/></joint><link name='{side}'><collision><geometry>"
        f"<cylinder radius='0.05' length='0.02'/></geometry></collision></link>"
        for side, y in (("left", "0.1"), ("right", right))
    )
    return f"<robot name='r'><link name='base'/>{joints}{extra}</robot>"


def fitted(robot: RobotDescription, left: tuple[str, ...] = (), right: tuple[str, ...] = ()) -> RobotDescription:
    return robot.fitted(left, right, FrameParams())


def drive(engine: Engine, vx: float, wz: float, seconds: float) -> None:
    for _ in range(round(seconds / STEP)):
        engine.command(Twist2D(vx, 0.0, wz))
        engine.step()


def test_the_rosbot_has_its_figures() -> None:
    robot = load_robot(URDF)
    assert robot.mass == pytest.approx(7.01)
    assert robot.track == pytest.approx(0.192)
    assert robot.base_height == pytest.approx(0.04)
    assert robot.is_skid_steered
    assert [(w.x, w.y) for w in robot.wheels] == [(0.05, 0.11), (0.05, -0.11), (-0.055, 0.11), (-0.055, -0.11)]
    assert robot.laser is not None
    assert robot.laser.frame == "laser"
    assert to_pose2d(robot.laser.pose) == pytest.approx((0.02, 0.0, 3.14159265))
    assert robot.laser.pose[2, 3] == pytest.approx(0.058 + 0.06)  # link, and the beams above it
    assert robot.camera is not None
    assert robot.camera.frame == "camera_depth_frame"
    assert robot.camera.pose[:3, 2] == pytest.approx((1.0, 0.0, 0.0), abs=1e-6)  # z looks ahead
    assert robot.camera.pose[:3, 1] == pytest.approx((0.0, 0.0, -1.0), abs=1e-6)  # y looks down
    assert [m.frame for m in robot.ranges] == ["range_fl", "range_fr", "range_rl", "range_rr"]
    drive = DriveParams().fitted(robot)
    assert (drive.wheel_radius, drive.effective_track) == pytest.approx((0.04, 0.2), rel=0.002)


def test_a_robot_on_two_wheels_with_a_caster_and_meshes_is_found_out() -> None:
    robot = load_robot(TWO_WHEELER)
    assert robot.base == "base_footprint"
    assert (robot.left, robot.right) == (("wheel_left_joint",), ("wheel_right_joint",))
    assert robot.wheel_radius == pytest.approx(0.033, abs=1e-5)
    assert robot.track == pytest.approx(0.16)
    assert robot.base_height == pytest.approx(0.0, abs=1e-5)
    assert [h.joint for h in robot.hinges] == [
        "wheel_left_joint", "wheel_right_joint", "caster_swivel_joint", "caster_wheel_joint",
    ]  # fmt: skip
    assert [h.forward for h in robot.wheels] == [1, -1]
    assert (robot.laser.frame, robot.camera.frame, robot.imu.frame) == (
        "base_scan", "camera_rgb_optical_frame", "imu_link",
    )  # fmt: skip
    assert robot.ranges == ()
    body = next(v for v in robot.body.visuals if v.shape.kind == "mesh")
    assert np.ptp(body.shape.vertices * body.shape.size[0], axis=0) == pytest.approx((0.2, 0.2, 0.08))
    drive = DriveParams().fitted(robot)
    assert (drive.wheel_radius, drive.effective_track) == pytest.approx((0.033, 0.16), abs=1e-5)


def test_the_robot_on_two_wheels_drives_as_told_sees_and_is_stopped_by_a_wall() -> None:
    shape = Shape(kind="box", size=(0.2, 4.0, 1.0))
    wall = Body(name="wall", kind="wall", pose=from_xyz_rpy((1.6, 0.0, 0.5)), collisions=(Collision(shape=shape),))
    engine = Engine(World(bodies=(wall,)), EngineParams(**EXACT))
    engine.spawn_robot(load_robot(TWO_WHEELER))
    drive(engine, 0.2, 0.0, 3.0)
    assert engine.pose.x == pytest.approx(0.585, abs=0.005)  # less the start
    assert engine.robot.odometry.pose == pytest.approx(engine.pose, abs=0.005)
    assert engine.robot.wheels[0] == pytest.approx((engine.pose.x / 0.033,) * 2, rel=0.02)
    assert engine.scan().ranges[360] == pytest.approx(1.5 - engine.pose.x + 0.032, abs=0.05)
    assert engine.ranges() == {}
    drive(engine, 0.0, 0.5, math.tau / 0.5)
    assert engine.pose.yaw == pytest.approx(-0.07, abs=0.03)  # less the start
    engine.carry(Pose2D(0.6, 0.0, 0.0))
    drive(engine, 0.3, 0.0, 6.0)
    assert engine.pose.x == pytest.approx(1.5 - 0.08, abs=0.015)  # the round body, 0.1 about 0.02 behind the axle
    assert {t.other for t in engine.touches()} == {"wall"}
    engine.close()


def test_wheels_and_frames_can_be_named() -> None:
    robot = load_robot(URDF)
    front = fitted(robot, ("front_left_wheel_hinge",), ("front_right_wheel_hinge",))
    assert [w.joint for w in front.wheels] == ["front_left_wheel_hinge", "front_right_wheel_hinge"]
    assert not front.is_skid_steered
    two = load_robot(TWO_WHEELER).fitted((), (), FrameParams(camera="camera_link", laser="mast", ranges=("imu_link",)))
    assert two.laser.frame == "mast"
    assert two.camera.frame == "camera_link"
    assert two.camera.pose[:3, 2] == pytest.approx((1.0, 0.0, 0.0), abs=1e-6)  # a link that looks along x
    assert [m.frame for m in two.ranges] == ["imu_link"]


@pytest.mark.parametrize(
    ("left", "frames", "words"),
    [
        (("wheel_joint",), FrameParams(), "drive.left_joints names 'wheel_joint'.*there: wheel_left_joint"),
        (("wheel_right_joint",), FrameParams(), "on one side only"),
        ((), FrameParams(laser="lidar"), "frames.laser names 'lidar', which is no link of robot 'two_wheeler'"),
    ],
)
def test_names_that_are_not_there(left: tuple[str, ...], frames: FrameParams, words: str) -> None:
    with pytest.raises(WorldError, match=words):
        load_robot(TWO_WHEELER).fitted(left, (), frames)


def test_a_robot_without_lidar_and_camera_lives_and_says_so(caplog: pytest.LogCaptureFixture) -> None:
    engine = Engine(World())
    with caplog.at_level("INFO"):
        engine.spawn_robot(parse_robot(two_wheels()))
    told = [r.getMessage() for r in caplog.records if "has no" in r.getMessage()]
    assert told == ["robot 'r' has no lidar and no camera and no inertial unit: nothing is sent of it"]
    drive(engine, 0.2, 0.0, 1.0)
    assert engine.pose.x > 0.1
    engine.warm_up()
    with pytest.raises(WorldError, match="has no lidar"):
        engine.scan()
    with pytest.raises(WorldError, match="has no camera"):
        engine.picture()
    engine.close()


def test_a_wheel_without_a_shape_needs_its_radius_told() -> None:
    bare = parse_robot(two_wheels().replace("<collision>", "<inertial><x>").replace("</collision>", "</x></inertial>"))
    with pytest.raises(WorldError, match=r"give drive\.wheel_radius"):
        DriveParams().fitted(fitted(bare))
    assert DriveParams(wheel_radius=0.03).fitted(fitted(bare)).wheel_radius == 0.03


def test_what_the_gazebo_part_says_of_the_sensors_goes_first() -> None:
    extra = (
        "<link name='head'/><joint name='neck' type='fixed'><origin xyz='0.1 0 0.2'/><parent link='base'/>"
        "<child link='head'/></joint><link name='laser'/><joint name='l' type='fixed'><parent link='base'/>"
        "<child link='laser'/></joint><gazebo reference='head'><sensor type='gpu_ray' name='s'>"
        "<pose>0 0 0.05 0 0 0</pose></sensor></gazebo>"
    )
    robot = parse_robot(two_wheels(extra))
    assert robot.laser.frame == "head"
    assert robot.laser.pose[:3, 3] == pytest.approx((0.1, 0.0, 0.25))


def test_a_drive_s_plug_in_tells_which_wheels_are_driven() -> None:
    plugin = "<gazebo><plugin name='d' filename='x.so'><{0}>{1}</{0}><{2}>{3}</{2}></plugin></gazebo>"
    text = URDF.read_text(encoding="utf-8")
    front = plugin.format("leftJoint", "front_left_wheel_hinge", "rightJoint", "front_right_wheel_hinge")
    robot = parse_robot(text.replace("</robot>", f"{front}</robot>"))
    assert [w.joint for w in robot.wheels] == ["front_left_wheel_hinge", "front_right_wheel_hinge"]
    gone = plugin.format("leftJoint", "gone", "rightJoint", "front_right_wheel_hinge")
    assert len(parse_robot(text.replace("</robot>", f"{gone}</robot>")).wheels) == 4


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("<robot name='r'><link name='a'/></robot>", "no wheels"),
        (two_wheels(right="0.2"), "on one side only"),
        ("<robot", "is not XML"),
        ("<sdf/>", "is no URDF"),
        ("<robot name='r'/>", "has no links"),
        (two_wheels("<link name='loose'/>"), "no single tree"),
        (two_wheels("<joint name='j' type='fixed'><parent link='base'/><child link='gone'/></joint>"), "'gone'"),
        (two_wheels("<joint name='j' type='fixed'><parent link='base'/></joint>"), "joint 'j' has no <child>"),
        (two_wheels().replace("0 0.1 0", "0 up 0"), "expected 3 numbers"),
        (two_wheels().replace("cylinder radius='0.05'", "cone radius='0.05'"), "unknown geometry <cone>"),
        (two_wheels().replace("radius='0.05'", "radius='-1'"), "negative size"),
    ],
)
def test_what_cannot_be_driven_is_told(text: str, words: str) -> None:
    with pytest.raises(WorldError, match="robot_description") as caught:
        fitted(parse_robot(text))
    assert words in str(caught.value)


def test_meshes_are_found_by_package_by_model_and_beside_the_file(tmp_path: Path) -> None:
    text = TWO_WHEELER.read_text(encoding="utf-8").replace("package://two_wheeler_description", "model://bot")
    (tmp_path / "urdf").mkdir()
    path = tmp_path / "urdf" / "bot.urdf"
    path.write_text(text.replace("../meshes", "model://bot/meshes"), encoding="utf-8")
    asked = []

    def find(name: str) -> Path:
        asked.append(name)
        return TWO_WHEELER.parents[1]

    assert load_robot(path, find).wheel_radius == pytest.approx(0.033, abs=1e-5)
    assert set(asked) == {"bot"}


def test_a_robot_whose_meshes_are_missing_drives_on_what_is_left(caplog: pytest.LogCaptureFixture) -> None:
    lost = two_wheels().replace("<cylinder radius='0.05' length='0.02'/>", "<mesh filename='package://far/a.stl'/>")
    body = "<link name='base'><visual><geometry><mesh filename='no.stl'/></geometry></visual>{}</link>".format(
        "<collision><geometry><box size='0.3 0.2 0.1'/></geometry></collision>"
    )
    robot = parse_robot(
        lost.replace("<link name='base'/>", body).replace("0 0.1 0", "0 0.1 0.04").replace("0 -0.1 0", "0 -0.1 0.04")
    )
    assert "link 'left', mesh 'package://far/a.stl': package 'far': is not found" in caplog.text
    assert "3 meshes are left out" in caplog.text
    assert [v.shape.kind for v in robot.body.visuals] == ["box"]  # the base shows its collision shape
    assert robot.wheel_radius == pytest.approx(0.04)  # the base stands on the floor
    assert "wheel 'left_joint' has no shape" in caplog.text
    engine = Engine(World())
    engine.spawn_robot(robot)
    drive(engine, 0.2, 0.0, 1.0)
    assert engine.pose.x > 0.1
    engine.close()


def test_today_s_rosbot_has_range_sensors_that_are_no_lidar() -> None:
    """Names and sensors as in husarion/rosbot_ros: a lidar with one beam is a range sensor."""
    joint = "<joint name='{0}_j' type='fixed'><parent link='base'/><child link='{0}'/></joint><link name='{0}'/>"
    ray = (
        "<gazebo reference='{0}'><sensor type='{1}' name='{0}'><ray><scan><horizontal><samples>1</samples>"
        "<min_angle>{2}</min_angle><max_angle>{3}</max_angle></horizontal></scan></ray></sensor></gazebo>"
    )
    extra = "".join(joint.format(n) for n in ("fl_range", "fr_range", "tof", "orange", "laser"))
    extra += ray.format("fl_range", "gpu_lidar", -0.01, 0.01) + ray.format("tof", "ray", -0.2, 0.2)
    robot = parse_robot(two_wheels(extra + ray.format("laser", "gpu_lidar", -3.14, 3.14)))
    assert robot.laser is not None
    assert robot.laser.frame == "laser"
    assert [m.frame for m in robot.ranges] == ["fl_range", "fr_range", "tof"]
