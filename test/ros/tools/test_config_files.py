"""Every file of config/ and params/ goes through the declarations of its node, as the launch files load it."""

from __future__ import annotations

import logging
from pathlib import Path
from typing import Any

import pytest
import yaml

pytest.importorskip("rospy", reason="ROS is not on the path: `. scripts/env` first")
import roslaunch.config
import roslaunch.xmlloader

from rosbot_patrol.amcl.parameters import AmclParams
from rosbot_patrol.costmap.params import read_costmap
from rosbot_patrol.detection.params import DarknetParams
from rosbot_patrol.gmapping.parameters import GmappingParams
from rosbot_patrol.navigation.params import MoveBaseParams
from rosbot_patrol.params import load
from rosbot_patrol.patrol.guard.arming import load_rules
from rosbot_patrol.patrol.guard.schedule import load_schedule
from rosbot_patrol.patrol.house.rooms import load_rooms
from rosbot_patrol.planning.local_planners.trajectory_planner import TrajectoryPlannerParams
from rosbot_patrol.planning.registry import make_global_planner
from rosbot_patrol.ros.drive.twist_mux_node import TwistMuxParams
from rosbot_patrol.ros.patrol.settings import NodeParams, load_flat
from rosbot_patrol.ros.sensors import watch_node as sensor_watch_node
from rosbot_patrol.ros.simulator.demo_intruder_node import read_walk
from rosbot_patrol.ros.simulator.node import SimulatorParams
from rosbot_patrol.ros.tools.launch_page import FILES
from rosbot_patrol.ros.tools.parameter_tables import pages
from rosbot_patrol.simulation.scenario.file import read_scenario
from rosbot_patrol.simulation.sensors.sensor_places import read_sensors

ROOT = Path(__file__).parents[3]


def given(launch: str, node: str, *arguments: str) -> dict[str, Any]:
    """The private parameters that a launch file gives a node, as `rospy.get_param("~")` would answer."""
    config = roslaunch.config.ROSLaunchConfig()
    loader = roslaunch.xmlloader.XmlLoader(resolve_anon=True)
    loader.load(str(ROOT / "launch" / launch), config, argv=list(arguments), verbose=False)
    tree: dict[str, Any] = {}
    for name, parameter in config.params.items():
        parts = name.strip("/").split("/")
        if parts[0] == node and len(parts) > 1:
            place = tree
            for part in parts[1:-1]:
                place = place.setdefault(part, {})
            place[parts[-1]] = parameter.value
    assert tree, f"{launch} gives {node} nothing"
    return tree


@pytest.fixture(autouse=True)
def no_unknown_names(caplog: pytest.LogCaptureFixture, request: pytest.FixtureRequest) -> Any:
    with caplog.at_level(logging.WARNING):
        yield
    if "tutorial" not in request.node.name:  # whose acc_lim_Y is a slip of its author
        assert "is not a parameter" not in caplog.text


@pytest.mark.parametrize("profile", ["tuned", "tutorial"])
@pytest.mark.parametrize("simulation", ["true", "false"])
def test_move_base(profile: str, simulation: str) -> None:
    tree = given("move_base_only.launch", "move_base", f"profile:={profile}", f"simulation:={simulation}")
    groups = [key for key, value in tree.items() if isinstance(value, dict)]
    load(MoveBaseParams, tree, name="/move_base/", ignore=groups)
    load(TrajectoryPlannerParams, tree["TrajectoryPlannerROS"], name="/move_base/TrajectoryPlannerROS/")
    make_global_planner("navfn/NavfnROS", tree, name="/move_base/")
    for costmap in ("global_costmap", "local_costmap"):
        assert read_costmap(tree[costmap], name=f"/move_base/{costmap}/").layers


@pytest.mark.parametrize("profile", ["tuned", "tutorial"])
def test_amcl(profile: str) -> None:
    load(AmclParams, given("amcl_only.launch", "amcl", f"profile:={profile}"), name="/amcl/")


def test_slam_gmapping() -> None:
    params = load(GmappingParams, given("gmapping_only.launch", "slam_gmapping"), name="/slam_gmapping/")
    assert params.particles == 30
    assert params.str_ == 0.1


def test_twist_mux() -> None:
    mux = load(TwistMuxParams, given("command_mux.launch", "twist_mux"), name="/twist_mux/")
    assert [s.name for s in sorted(mux.topics, key=lambda s: -s.priority)] == ["teleop", "patrol", "amcl", "move_base"]


def test_simulator() -> None:
    load(SimulatorParams, given("simulation_start.launch", "simulator"), name="/simulator/")


@pytest.mark.parametrize("launch", ["darknet_yolo_only.launch", "darknet_yolo_simulation_only.launch"])
def test_darknet(launch: str) -> None:
    loaded = load(DarknetParams, given(launch, "darknet_ros"), name="/darknet_ros/")
    assert loaded.yolo_model.detection_classes.names == ["person", "fire hydrant"]


@pytest.mark.parametrize("name", sorted(p.name for p in (ROOT / "drop_in" / "darknet_ros" / "config").glob("*.yaml")))
def test_networks_of_darknet_ros(name: str) -> None:
    tree = yaml.safe_load((ROOT / "drop_in" / "darknet_ros" / "config" / name).read_text())
    loaded = load(DarknetParams, tree, name=f"{name}: ")
    if name in ("auto.yaml", "hog.yaml", "ssdlite.yaml"):
        assert f"{loaded.network}.yaml" == name
        return
    if name == "ros.yaml":
        assert loaded.subscribers.camera_reading.topic == "/camera/rgb/image_raw"
        assert loaded.publishers.detection_image.latch
        return
    assert loaded.yolo_model.weight_file.name.endswith(".weights")
    assert "person" in loaded.yolo_model.detection_classes.names


def test_patrol() -> None:
    load_flat(NodeParams, given("rosbot_patrol.launch", "patrolling_node"))


@pytest.mark.parametrize(("arguments", "threshold"), [([], 0.4), (["network:=yolo-fastest-1.1-xl"], 0.1)])
def test_the_patrol_weighs_weak_boxes_of_networks_for_a_real_camera(arguments: list[str], threshold: float) -> None:
    tree = given("rosbot_patrol.launch", "darknet_ros", *arguments)
    assert load(DarknetParams, tree, name="/darknet_ros/").yolo_model.threshold.value == threshold


@pytest.mark.parametrize(
    ("arguments", "sensors"),
    [
        ([], "house_sensors.yaml"),
        (["house:=flat"], "flat_sensors.yaml"),
        (["house:=office"], "office_sensors.yaml"),
        (["simulation:=false"], "sensors.yaml"),
        (["simulation:=false", "house:=flat"], "flat_sensors.yaml"),
        (["sensors:=none"], "none"),
        (["simulation:=false", f"path_to_params:={ROOT}/params/room_points_tutorial.yaml"], ""),
    ],
)
def test_sensor_watch(arguments: list[str], sensors: str) -> None:
    tree = given("rosbot_patrol.launch", "sensor_watch", *arguments)
    for group in sensor_watch_node.GROUPS:
        sensor_watch_node.load_group(group, tree)
    assert Path(tree["sensors"]).name == sensors
    assert given("rosbot_patrol.launch", "patrolling_node", *arguments)["sensors"] == tree["sensors"]
    listed = sensor_watch_node.load_list(sensor_watch_node.load_group(sensor_watch_node.SensorWatchParams, tree))
    assert listed.has_file == (sensors not in ("", "none"))
    assert [listed.room_of(room) for room in (1, 2, 3, 4)] == [1, 2, 3, 4]


def test_rooms_sensors_and_walks_agree() -> None:
    rooms = {room.id: room for room in load_rooms(ROOT / "params" / "room_points.yaml")}
    assert sorted(rooms) == list(range(8))
    assert len(list(load_rooms(ROOT / "params" / "room_points_tutorial.yaml"))) == 11
    sensors = read_sensors(str(ROOT / "config" / "house_sensors.yaml"))
    assert [s.id for s in sensors] == [s.room for s in sensors] == list(range(1, 8))
    for room in range(1, 8):
        assert read_walk(ROOT / "config" / "house_demo.yaml", room).path


def test_generated_pages_are_up_to_date() -> None:
    found = pages(ROOT)
    assert {path.name for path in found} == {"parameters.md", "launch.md", "architecture.md"}
    for path, text in found.items():
        assert path.read_text(encoding="utf-8") == text, "run scripts/parameter_tables"


def test_the_page_of_launch_files_has_all_of_them() -> None:
    assert set(FILES) == {path.stem for path in (ROOT / "launch").glob("*.launch")}


@pytest.mark.parametrize("scenario", sorted(p.name for p in (ROOT / "scenarios").glob("*.yaml")))
def test_every_scenario_can_be_played_where_it_says(scenario: str) -> None:
    play = read_scenario(ROOT / "scenarios" / scenario)
    tree = given("scenario.launch", "simulator", f"scenario:={play.file}")
    assert load(SimulatorParams, tree).scenario == play.file
    sensors = {place.id for place in read_sensors(play.setting.motion_sensors)}
    assert {t.sensor for t in play.triggers} <= sensors
    assert set(play.expect.verdicts if play.expect else ()) <= sensors


@pytest.mark.parametrize("points", ["room_points.yaml", "flat_room_points.yaml", "office_room_points.yaml"])
def test_modes_and_rounds_that_we_ship(points):
    rooms = load_rooms(ROOT / "params" / points)
    rules = load_rules(str(ROOT / "config" / "arming.yaml"), rooms)
    assert rules.first_mode == "armed_away"
    assert all(mode.rooms is None for name, mode in rules.modes.items() if name != "disarmed")
    assert load_schedule(str(ROOT / "config" / "patrol_schedule.yaml"), rooms) == ((), None)
