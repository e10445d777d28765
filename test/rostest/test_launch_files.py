"""Every launch file parses, and each of its programs exists exactly once."""

from __future__ import annotations

import os
import re
import shlex
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest

pytest.importorskip("roslaunch", reason="ROS is not on the path: `. scripts/env` first")
import roslaunch.config
import roslaunch.xmlloader
import roslib.packages

from rosbot_patrol.patrol.mission.params import NodeParams

ROOT = Path(__file__).parents[2]
OURS = sorted((ROOT / "launch").glob("*.launch"))
FORWARDED = sorted((ROOT / "drop_in").glob("*/launch/*.launch"))
TUTORIAL = [
    "gmapping_only",
    "move_base_only",
    "amcl_only",
    "simulation_gmapping",
    "simulation_world",
    "darknet_yolo_only",
    "darknet_yolo_simulation_only",
    "rosbot_all_hardware",
    "rosbot_all_algorithms",
    "rosbot_gmapping",
    "esp_connector",
    "rosbot_patrol",
    "rosbot_patrol_pc",
]


def parse(path: Path, *arguments: str, robot: bool = False) -> roslaunch.config.ROSLaunchConfig:
    before = os.environ.pop("ROSBOT_VER", None)
    if robot:
        os.environ["ROSBOT_VER"] = "ROSBOT_2.0"
    try:
        config = roslaunch.config.ROSLaunchConfig()
        loader = roslaunch.xmlloader.XmlLoader(resolve_anon=True)
        loader.load(str(path), config, argv=list(arguments), verbose=False)
        return config
    finally:
        os.environ.pop("ROSBOT_VER", None)
        if before is not None:
            os.environ["ROSBOT_VER"] = before


def names(config: roslaunch.config.ROSLaunchConfig) -> dict[str, tuple[str, str]]:
    return {node.namespace.strip("/") + node.name: (node.package, node.type) for node in config.nodes}


def check_programs(config: roslaunch.config.ROSLaunchConfig) -> None:
    for node in config.nodes:
        if node.package == "tutorial_pkg":
            continue  # the old firmware's own programs
        found = roslib.packages.find_node(node.package, node.type)
        ours = node.package == "rosbot_patrol" or (ROOT / "drop_in" / node.package).is_dir()
        assert len(found) == 1 if ours else found, f"{node.package}/{node.type}: {found}"


@pytest.mark.parametrize("path", OURS, ids=lambda p: p.name)
def test_every_argument_is_documented(path: Path) -> None:
    tree = ElementTree.parse(path)
    missing = [tag.get("name") for tag in tree.getroot().findall("arg") if not tag.get("doc")]
    assert missing == []


@pytest.mark.parametrize("path", OURS + FORWARDED, ids=lambda p: f"{p.parts[-3]}/{p.name}")
def test_parses(path: Path) -> None:
    arguments = ["world_name:=x"] if path.name == "empty_world.launch" else []
    config = parse(path, *arguments)
    check_programs(config)


def test_a_turtlebot3_has_its_own_drivers_size_and_speed() -> None:
    guard = parse(ROOT / "launch" / "rosbot_patrol.launch", "robot:=turtlebot3_burger", robot=True)
    assert {"hlds_laser_publisher", "base_adapter", "serial_node", "camera_driver"} <= set(names(guard))
    assert not {"rplidarNode", "rosbot_ekf", "msgs_conversion"} & set(names(guard))
    values = {name: param.value for name, param in guard.params.items()}
    assert values["/move_base/local_costmap/footprint"] == values["/move_base/global_costmap/footprint"]
    assert values["/move_base/local_costmap/footprint"][0] == [0.041, 0.105]
    assert values["/move_base/TrajectoryPlannerROS/max_vel_x"] == 0.2
    assert values["/twist_mux/collision_guard/half_width"] == 0.105
    assert values["/patrolling_node/battery_topic"] == "battery_state"
    with pytest.raises(roslaunch.core.RLException, match="simulation-hardware-emulates-a-rosbot-not-turtlebot3_waffle"):
        parse(ROOT / "launch" / "rosbot_patrol.launch", "robot:=turtlebot3_waffle", "simulation:=hardware")


def test_image_transports_republish_is_ours() -> None:
    """As the tutorial's launch files name it; Debian's knows no compressed transport."""
    first = roslib.packages.find_node("image_transport", "republish")[0]
    assert "rosbot_patrol.ros.detector.republish_node" in Path(first).read_text(encoding="utf-8")


def test_the_tutorials_files_are_all_there() -> None:
    assert {p.stem for p in OURS} >= set(TUTORIAL)


def test_simulation_by_default_and_the_robot_where_its_version_is_set() -> None:
    simulated = names(parse(ROOT / "launch" / "rosbot_patrol.launch"))
    assert "simulator" in simulated
    assert {"patrolling_node", "move_base", "amcl", "map_server", "darknet_ros", "rgb_compress"} <= set(simulated)
    assert "sensor_watch" in simulated
    assert {"esp_client1", "esp_client2", "esp_client3", "teleop_twist_keyboard", "laser_broadcaster"} <= set(simulated)
    robot = names(parse(ROOT / "launch" / "rosbot_patrol.launch", robot=True))
    assert "simulator" not in robot
    assert {"laser_publisher", "imu_publisher", "camera_publisher", "patrolling_node"} <= set(robot)


def test_a_real_rosbot_ekf_brings_the_imus_publisher_itself() -> None:
    path = ROOT / "launch" / "rosbot_patrol.launch"
    assert "imu_publisher" not in names(parse(path, "imu_publisher:=false", robot=True))
    for launch in ("rosbot_all_hardware", "rosbot_gmapping"):
        assert "imu_publisher" in names(parse(ROOT / "launch" / f"{launch}.launch"))
    assert "imu_publisher" not in names(parse(ROOT / "drop_in" / "rosbot_ekf" / "launch" / "all.launch"))
    both = parse(ROOT / "drop_in" / "rosbot_ekf" / "launch" / "all.launch", "rosbot_pro:=true", "mecanum:=true")
    assert names(both)["rosbot_ekf"] == ("robot_localization", "ekf_localization_node")
    assert both.params["/serial_node/port"].value == "/dev/ttyS4"
    assert "mecanum_wheels" in names(both)
    one = parse(ROOT / "drop_in" / "rosbot_ekf" / "launch" / "all.launch")
    assert one.params["/serial_node/port"].value == "/dev/ttyS1"
    assert one.params["/serial_node/baud"].value == 525000


@pytest.mark.parametrize(
    "path", sorted((ROOT / "drop_in" / "rplidar_ros" / "launch").glob("*.launch")), ids=lambda p: p.stem
)
def test_each_lidars_launch_file(path: Path) -> None:
    config = parse(path, "frame_id:=laser")
    assert names(config)["rplidarNode"] == ("rplidar_ros", "rplidarNode")
    assert config.params["/rplidarNode/frame_id"].value == "laser"


def test_another_robots_battery() -> None:
    path = ROOT / "launch" / "rosbot_patrol.launch"
    given = parse(path, "battery_topic:=battery_state", "battery_voltage_first:=true").params
    assert given["/patrolling_node/battery_topic"].value == "battery_state"
    assert given["/patrolling_node/battery_voltage_first"].value is True
    assert parse(path).params["/patrolling_node/battery_voltage_first"].value is False


def test_detector_on_the_pc() -> None:
    robot = names(parse(ROOT / "launch" / "rosbot_patrol.launch", "detector:=pc"))
    assert "darknet_ros" not in robot
    assert "esp_client1" not in robot
    assert "sensor_watch" in robot
    assert "darknet_ros_standby" in robot
    assert "darknet_ros_standby" not in names(
        parse(ROOT / "launch" / "rosbot_patrol.launch", "detector:=pc", "standby:=false")
    )
    assert "darknet_ros_standby" not in names(parse(ROOT / "launch" / "rosbot_patrol.launch"))
    computer = names(parse(ROOT / "launch" / "rosbot_patrol_pc.launch"))
    assert set(computer) == {"rgb_decompress", "darknet_ros", "esp_client1", "esp_client2", "esp_client3"}


def network_of(launch: str, *arguments: str, robot: bool = False) -> tuple[str, str, str]:
    """What the detector computes, its cfg's name, and the folder of the weights below the package."""
    config = parse(ROOT / "launch" / launch, *arguments, robot=robot)
    given = {name: value.value for name, value in config.params.items()}
    cfg = given.get("/darknet_ros/yolo_model/config_file/name", "")
    return given["/darknet_ros/network"], cfg, Path(given["/darknet_ros/weights_path"]).parts[-1]


def test_networks_by_name() -> None:
    house, hog, auto = ("darknet", "house.cfg", "models"), ("hog", "", "weights"), ("auto", "", "weights")
    tiny = ("darknet", "yolov2-tiny.cfg", "weights")
    assert network_of("rosbot_patrol.launch") == house
    assert network_of("rosbot_patrol.launch", robot=True) == auto
    assert network_of("rosbot_patrol.launch", "network:=yolov2-tiny") == tiny
    assert network_of("rosbot_patrol_pc.launch") == auto
    assert network_of("rosbot_patrol_pc.launch", "network:=house") == house
    assert network_of("darknet_yolo_simulation_only.launch") == house
    assert network_of("darknet_yolo_only.launch", "network:=hog") == hog
    assert network_of("darknet_yolo_only.launch", "network:=auto") == auto
    fastest = ("darknet", "yolo-fastest-1.1-xl.cfg", "weights")
    assert network_of("rosbot_patrol.launch", "network:=yolo-fastest-1.1-xl") == fastest
    yaml = ROOT / "drop_in/darknet_ros/config/yolov2-tiny.yaml"
    assert network_of("rosbot_patrol.launch", f"network_param_file:={yaml}", robot=True) == tiny


def test_a_hydrant_alarms_in_the_tutorial_s_profile_only() -> None:
    path, key = ROOT / "launch" / "rosbot_patrol.launch", "/patrolling_node/alarm_classes"
    assert parse(path, "profile:=tutorial").params[key].value == ["person", "fire hydrant"]
    for is_robot in (False, True):
        assert key not in parse(path, robot=is_robot).params
    assert NodeParams(path_to_params="").alarm_classes == ["person"]


def test_the_standby_on_a_robot_takes_what_is_ready() -> None:
    given = parse(ROOT / "launch" / "rosbot_patrol.launch", "detector:=pc", robot=True).params
    assert given["/darknet_ros_standby/network"].value == "auto"
    given = parse(
        ROOT / "launch" / "rosbot_patrol.launch", "detector:=pc", "second_opinion:=ssdlite", robot=True
    ).params
    assert given["/darknet_ros_standby/second_opinion"].value == "ssdlite"


@pytest.mark.parametrize("launch", ["rosbot_patrol", "rosbot_patrol_pc", "darknet_yolo_simulation_only"])
def test_a_second_opinion(launch: str) -> None:
    path, key = ROOT / "launch" / f"{launch}.launch", "/darknet_ros/second_opinion"
    assert parse(path).params[key].value == ""
    assert parse(path, "second_opinion:=ssdlite").params[key].value == "ssdlite"


def test_darknet_ros_own_launch_files() -> None:
    folder = ROOT / "drop_in" / "darknet_ros" / "launch"
    for name, cfg in (("darknet_ros", "yolov2-tiny.cfg"), ("yolo_v3", "yolov3.cfg")):
        config = parse(folder / f"{name}.launch", "image:=/usb_cam/image_raw")
        given = {key: value.value for key, value in config.params.items()}
        assert given["/darknet_ros/yolo_model/config_file/name"] == cfg
        assert given["/darknet_ros/config_path"].endswith("darknet_ros/yolo_network_config/cfg")
        (node,) = config.nodes
        assert ("/camera/rgb/image_raw", "/usb_cam/image_raw") in [tuple(pair) for pair in node.remap_args]
        assert given["/darknet_ros/subscribers/camera_reading/topic"] == "/camera/rgb/image_raw"


def test_another_camera() -> None:
    topic = "/darknet_ros/subscribers/camera_reading/topic"
    plain, other = (
        {
            name: value.value
            for name, value in parse(ROOT / "launch" / "darknet_yolo_only.launch", *words).params.items()
        }
        for words in ((), ("camera:=/usb_cam/image_raw", "image_transport:=compressed"))
    )
    assert (plain[topic], plain["/darknet_ros/image_transport"]) == ("/rgb_raw", "raw")
    assert (other[topic], other["/darknet_ros/image_transport"]) == ("/usb_cam/image_raw", "compressed")


def test_an_unknown_network_names_the_file_that_is_not_there() -> None:
    with pytest.raises(Exception, match=r"config/yolov9\.yaml"):
        parse(ROOT / "launch" / "darknet_yolo_only.launch", "network:=yolov9")


@pytest.mark.parametrize("profile", ["tuned", "tutorial"])
@pytest.mark.parametrize("simulation", ["true", "false"])
def test_profiles(profile: str, simulation: str) -> None:
    config = parse(ROOT / "launch" / "move_base_only.launch", f"profile:={profile}", f"simulation:={simulation}")
    given = {name: value.value for name, value in config.params.items()}
    rate = given["/move_base/controller_frequency"]
    if profile == "tutorial":
        assert rate == (25.0 if simulation == "true" else 10.0)
        assert given["/move_base/global_costmap/width"] == (35 if simulation == "true" else 15)
        assert given["/move_base/TrajectoryPlannerROS/max_vel_x"] == 0.1


def test_an_unknown_profile_names_the_two() -> None:
    with pytest.raises(Exception, match="tutorial-or-tuned-not-fast"):
        parse(ROOT / "launch" / "move_base_only.launch", "profile:=fast")


def test_an_unknown_place_of_the_detector_names_the_two() -> None:
    with pytest.raises(Exception, match="detector-is-local-or-pc-not-cloud"):
        parse(ROOT / "launch" / "rosbot_patrol.launch", "detector:=cloud")


def test_the_launch_ends_with_the_simulator() -> None:
    nodes = parse(ROOT / "launch" / "rosbot_patrol.launch").nodes
    assert [node.name for node in nodes if node.required] == ["simulator"]


def test_respawn_has_a_delay() -> None:
    for node in parse(ROOT / "launch" / "rosbot_patrol.launch").nodes:
        if node.respawn:
            assert node.respawn_delay >= 1.0, node.name


@pytest.mark.parametrize(
    ("house", "map_name", "points"),
    [
        ("house", "rosbot_map", "room_points"),
        ("flat", "flat_map", "flat_room_points"),
        ("office", "office_map", "office_room_points"),
    ],
)
def test_a_house_brings_its_world_map_points_and_sensors(house: str, map_name: str, points: str) -> None:
    config = parse(ROOT / "launch" / "demo.launch", f"house:={house}", "rviz:=true")
    given = {name: Path(str(value.value)) for name, value in config.params.items()}
    arguments = next(node.args for node in config.nodes if node.name == "map_server")
    for path, folder, name in (
        (given["/simulator/world"], "worlds", f"{house}.world"),
        (given["/simulator/motion_sensors"], "config", f"{house}_sensors.yaml"),
        (given["/patrolling_node/path_to_params"], "params", f"{points}.yaml"),
        (given["/house_markers/path_to_params"], "params", f"{points}.yaml"),
        (given["/demo_intruder/walks"], "config", f"{house}_demo.yaml"),
        (Path(arguments.strip('"')), "maps", f"{map_name}.yaml"),
    ):
        assert (path.parent.name, path.name) == (folder, name)
        assert path.is_file()


def test_what_is_given_wins_over_the_house() -> None:
    mine = ["house:=flat", "world:=/w", "map_file:=/m", "path_to_params:=/p", "motion_sensors:=/s"]
    config = parse(ROOT / "launch" / "rosbot_patrol.launch", *mine)
    given = {name: value.value for name, value in config.params.items()}
    assert given["/simulator/world"] == "/w"
    assert given["/simulator/motion_sensors"] == "/s"
    assert given["/patrolling_node/path_to_params"] == "/p"
    assert next(node.args for node in config.nodes if node.name == "map_server") == '"/m"'


@pytest.mark.parametrize("launch", ["rosbot_patrol", "mark_rooms"])
@pytest.mark.parametrize("robot", [False, True])
def test_the_path_of_a_map_may_hold_blanks(launch: str, robot: bool) -> None:
    """roslaunch splits a program's arguments as a shell does."""
    nodes = parse(ROOT / "launch" / f"{launch}.launch", "map_file:=/home/you/my (new) house's.yaml", robot=robot).nodes
    given = next(node.args for node in nodes if node.name == "map_server")
    assert shlex.split(given) == ["/home/you/my (new) house's.yaml"]


def test_rooms_are_marked_without_a_guard() -> None:
    """Marked beside the guard, one's own house was patrolled by the tutorial's rooms."""
    nodes = names(parse(ROOT / "launch" / "mark_rooms.launch", "map_file:=/m"))
    assert set(nodes) == {"map_server", "map_broadcaster", "rviz"}
    assert set(names(parse(ROOT / "launch" / "mark_rooms.launch", "rviz:=false"))) == {"map_server", "map_broadcaster"}


# What guards of one master share, and why.
SHARED = {
    "/use_sim_time",  # rospy knows one clock
    "/rosdistro",
    "/rosversion",
}
MODES = {
    "simulation": ("simulation:=true",),
    "robot": ("simulation:=false",),
    "tutorial": ("simulation:=true", "profile:=tutorial"),
    "pc": ("simulation:=true", "detector:=pc"),
}
WITH_NS = ["rosbot_patrol", "demo", "scenario", "rosbot_patrol_pc", "rviz"]
# Names that the tutorial's and darknet_ros's own files give from the root, and what stands for them in a namespace.
FROM_THE_ROOT = {"/tf", "/tf_static", "/map", "/motion_trigger", "/rgb_raw", "/camera/rgb/image_raw", "/base_scan"}


def strays(config: roslaunch.config.ROSLaunchConfig, inside: str) -> list[str]:
    """What of a launch lies outside a namespace: nodes, parameters, remaps, topics in the arguments of nodes."""
    found = [f"param {name}" for name in config.params if not name.startswith(inside) and name not in SHARED]
    for node in config.nodes:
        if not node.namespace.startswith(inside):
            found.append(f"node {node.namespace}{node.name}")
        found += [f"{node.name}: {word}" for word in re.findall(r"\S+:=/\S+", node.args or "")]
        for name, to in node.remap_args:
            is_known = name in FROM_THE_ROOT or name.startswith("/darknet_ros/")
            if to.startswith("/") or (name.startswith("/") and not is_known):
                found.append(f"{node.name}: remap from {name} to {to}")
    return found


def test_a_launch_outside_a_namespace_would_be_found() -> None:
    found = strays(parse(ROOT / "launch" / "rosbot_patrol.launch"), "/robot1/")
    assert "node /patrolling_node" in found
    assert "param /patrolling_node/state_dir" in found


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("way", ["ns:=robot1", "__ns:=robot1"])
def test_the_guard_lies_all_in_its_namespace(mode: str, way: str) -> None:
    config = parse(ROOT / "launch" / "rosbot_patrol.launch", way, "rviz:=true", *MODES[mode])
    assert strays(config, "/robot1/") == []
    plain = parse(ROOT / "launch" / "rosbot_patrol.launch", "rviz:=true", *MODES[mode])
    assert {(n.name, n.type) for n in config.nodes} == {(n.name, n.type) for n in plain.nodes}
    values = {name.removeprefix("/robot1"): value.value for name, value in config.params.items()}
    assert values == {name: value.value for name, value in plain.params.items()}


@pytest.mark.parametrize("name", WITH_NS)
def test_each_launch_file_with_ns_lies_in_it(name: str) -> None:
    assert strays(parse(ROOT / "launch" / f"{name}.launch", "ns:=home/robot1"), "/home/robot1/") == []


@pytest.mark.parametrize("path", OURS, ids=lambda p: p.name)
def test_each_launch_file_can_be_pushed_into_a_namespace(path: Path) -> None:
    config = parse(path, "__ns:=robot1")
    assert strays(config, "/robot1/") == []
    for node in config.nodes:
        if node.type in ("static_transform_publisher", "robot_state_publisher", "amcl", "move_base", "slam_gmapping"):
            assert ["/tf", "tf"] in node.remap_args, node.name


def test_without_a_namespace_every_remap_leads_where_it_led() -> None:
    config = parse(ROOT / "launch" / "rosbot_patrol.launch", "rviz:=true")
    led = {
        node.name: {name: "/" + to.lstrip("/") for name, to in node.remap_args if name.lstrip("/") != to.lstrip("/")}
        for node in config.nodes
    }
    assert {name: remaps for name, remaps in led.items() if remaps} == {
        "amcl": {"~cmd_vel": "/cmd_vel/amcl"},
        "move_base": {"cmd_vel": "/cmd_vel/move_base"},
        "twist_mux": {"cmd_vel_out": "/cmd_vel"},
        "teleop_twist_keyboard": {"cmd_vel": "/cmd_vel/teleop"},
        "patrolling_node": {"cmd_vel": "/cmd_vel/patrol"},
    }
    assert next(n.args for n in config.nodes if n.name == "rgb_compress").split() == [
        "raw", "in:=camera/rgb/image_raw", "compressed", "out:=rgb_republish"
    ]  # fmt: skip


@pytest.mark.parametrize("launch", ["rosbot_patrol", "rosbot_patrol_pc", "esp_connector"])
def test_bridges_take_three_ports_from_the_first(launch: str) -> None:
    for words, first in (((), 11411), (("bridge_port:=11511",), 11511)):
        given = {
            name: value.value for name, value in parse(ROOT / "launch" / f"{launch}.launch", *words).params.items()
        }
        assert [given[f"/esp_client{k}/tcp_port"] for k in (1, 2, 3)] == [first, first + 1, first + 2]
        assert given.get("/simulator/bridge_port", first) == first


def test_a_second_simulation_keeps_to_the_clock_of_the_first() -> None:
    for words, clock in (((), True), (("ns:=robot2", "clock:=false"), False)):
        config = parse(ROOT / "launch" / "demo.launch", *words)
        (value,) = [v.value for name, v in config.params.items() if name.endswith("/simulator/clock")]
        assert value is clock
