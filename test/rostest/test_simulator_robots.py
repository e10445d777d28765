"""simulator before a real master with a robot that is no ROSbot: its frames and joints, and a mesh that is gone."""

from pathlib import Path

import pytest

pytest.importorskip("rospy", reason="needs ROS: source the workspace first")

from ros_processes import wait_for

ROOT = Path(__file__).resolve().parents[2]
URDF = ROOT / "test/unit/simulation/data/two_wheeler_description/urdf/two_wheeler.urdf"
FRAMES = {
    "/scan": ("sensor_msgs/LaserScan", "base_scan"),
    "/rosbot/imu": ("sensor_msgs/Imu", "imu_link"),
    "/battery": ("sensor_msgs/BatteryState", "base_footprint"),
    "/camera/rgb/camera_info": ("sensor_msgs/CameraInfo", "camera_rgb_optical_frame"),
}


@pytest.fixture
def ros(sim_ros):
    return sim_ros


def test_a_robot_on_two_wheels_drives_and_speaks_of_its_own_frames(ros):
    probe = ros.probe()
    for topic, (kind, _) in FRAMES.items():
        probe.tell(subscribe=[topic, kind])
    probe.tell(subscribe=["/joint_states", "sensor_msgs/JointState"])
    probe.tell(subscribe=["/odom", "nav_msgs/Odometry"], advertise=["/cmd_vel", "geometry_msgs/Twist"])
    ros.node("simulator", f"_urdf:={URDF}", "_rate:=3.0").says("motion sensors", 20.0)
    for topic, (_, frame) in FRAMES.items():
        said = probe.expect(lambda s, topic=topic: s.get("topic") == topic, 15.0)
        assert f'frame_id: "{frame}"' in said["header"], topic
    joints = probe.expect(lambda s: s.get("topic") == "/joint_states", 15.0)
    assert "wheel_left_joint" in joints["name"]
    assert "caster_swivel_joint" in joints["name"]

    def drives():
        probe.tell(publish=["/cmd_vel", {"linear": {"x": 0.2}}])
        return [s for s in probe.heard(topic="/odom") if s["child_frame_id"] == "base_footprint"]

    wait_for(drives, 15.0, "odometry of base_footprint")
    ros.stop_nodes()


def test_a_mesh_that_is_missing_is_one_sentence_with_file_and_link(ros, tmp_path):
    path = tmp_path / "robot.urdf"
    text = URDF.read_text(encoding="utf-8").replace("package://two_wheeler_description", "package://nowhere")
    path.write_text(text.replace("../meshes", "."), encoding="utf-8")
    node = ros.node("simulator", f"_urdf:={path}")
    node.says(
        f"{path}: link 'base_link', mesh 'package://nowhere/meshes/body.obj': package 'nowhere': is not found", 20.0
    )
