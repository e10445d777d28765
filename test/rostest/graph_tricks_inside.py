"""What a stranger does to an open graph, and whether the watch notices each; run by test_closed_graph.py, --long."""

import json
import sys
from pathlib import Path

import pytest
from network_hosts import ROOT, Host, make_switch
from ros_processes import wait_for

STRANGER = str(Path(__file__).with_name("graph_stranger.py"))
SPEAKERS = {  # stand-ins for camera, lidar, base and detector: what matters here is who publishes
    "/camera/rgb/image_raw": "sensor_msgs/Image",
    "/scan": "sensor_msgs/LaserScan",
    "/odom": "nav_msgs/Odometry",
    "/darknet_ros/bounding_boxes": "darknet_ros_msgs/BoundingBoxes",
}
SENSOR = (
    "from rosbot_patrol.rosserial.device.tcp_client import EspClient as E;"
    " E('127.0.0.1', 11411, 1).start()._thread.join()"
)
ROUNDS = [
    {
        "a second publisher of /cmd_vel": "topic /cmd_vel has 2 publishers",
        "a second camera": "topic /camera/rgb/image_raw has 2 publishers",
        "a service on another machine": "node /butler runs on 10.77.0.2",
        "the clock of all nodes": "every node would start with other settings",
        "a publisher on another machine": "node /thief runs on 10.77.0.2",
        "a listener on another machine": "node /spy runs on 10.77.0.2",
        "the camera is signed off": "the camera has gone",
        "the lidar is signed off": "the lidar has gone",
        "the odometry is signed off": "the odometry has gone",
        "the detector is signed off": "the detector has gone",
        "where the mails go": "node /patrolling_node would start with other settings",
        "the watch's mails": "node /sensor_watch would start with other settings",
        "limits of driving": "node /twist_mux would start with other settings",
        "the bridge's keys": "node /esp_client1 would start with other settings",
    },
    {
        "the bridge's topic is signed off": "the bridge of the motion sensors has gone",
        "the patrol's ear is signed off": "the patrol's ear for motion sensors has gone",
        "the command of the base is signed off": "the command of the base has gone",
    },
    {
        "the bridge gets an order to end": "bridge /esp_client1 has gone",
        "the patrol gets an order to end": "the patrol (patrolling_node) has gone",
        "a false node takes the patrol's name": "node /patrolling_node runs on 10.77.0.2",
    },
]


@pytest.fixture(scope="module")
def hosts():
    make_switch()
    made = [Host("robot", 1), Host("stranger", 2)]
    yield made
    for host in made:
        host.stop()


def test_each_is_noticed(hosts, tmp_path):
    robot, stranger = hosts
    env = {"ROS_IP": robot.address, "ROS_MASTER_URI": f"http://{robot.address}:11311", "ROS_HOME": str(tmp_path)}
    robot.start("roscore", **env).says("started core service")
    robot.ask("rosparam", "load", "config/twist_mux.yaml", "/twist_mux", **env)
    built = Path(ROOT, ".ws", "devel", "lib")

    def node(program, *words):
        return robot.start(str(next(built.glob(f"*/{program}"))), *words, **env)

    bridge = node("serial_node.py", "tcp", "11411", "__name:=esp_client1")
    bridge.says("waiting for sensors")
    robot.start(sys.executable, "-c", SENSOR, **env)
    node("twist_mux", "cmd_vel_out:=cmd_vel", "__name:=twist_mux")
    for topic, kind in SPEAKERS.items():
        robot.start("rostopic", "pub", "-r", "2", topic, kind, "{}", f"__name:=speaker{topic.replace('/', '_')}", **env)
    house = [f"_path_to_params:={ROOT}/params/room_points.yaml", f"_state_dir:={tmp_path}/state", "_transport:=maildir"]
    node("patrol_robot", *house, f"_maildir:={tmp_path}/mail", "__name:=patrolling_node", "cmd_vel:=cmd_vel/patrol")
    watch = node("sensor_watch", *house, f"_maildir:={tmp_path}/mail", "__name:=sensor_watch")
    watch.says("watching")

    def state():
        return robot.ask("rosnode", "list", **env)

    wait_for(lambda: "/patrolling_node" in state() and state().count("/speaker") == len(SPEAKERS), what="the nodes")
    robot.ask("sleep", "25", **env)  # links that were there for ten seconds, and parameters of the start
    noticed = {}
    for number, tricks in enumerate(ROUNDS):
        stranger.start(sys.executable, STRANGER, "trick", str(number), robot.address, stranger.address, **env)
        for what, sentence in tricks.items():
            try:
                wait_for(lambda sentence=sentence: sentence in watch.output, 60.0, sentence)
            except AssertionError:
                noticed[what] = False
            else:
                noticed[what] = True
    print(json.dumps(noticed, indent=1))
    mails = "\n".join(each.read_text() for each in Path(tmp_path, "mail", "new").iterdir())
    assert "second publisher" in mails or "guard's network" in mails or "things are wrong" in mails
    assert all(noticed.values()), watch.output[-4000:]
