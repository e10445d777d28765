"""serial_node: the bridge between rosserial devices and ROS.

Matches rosserial_python 0.9.2 (`serial_node.py`): `~port` ("tcp" or a device), `~baud`, `~tcp_port` (else
`/rosserial_embeddedlinux/tcp_port`), arguments `[port [tcp_port]]`, negotiation, topics, services, time, log and
parameter requests, `/diagnostics`.

Differs:
- One process serves any number of clients per port, on IPv4 and IPv6; `~fork_server` is accepted and not needed.
- On TCP only `/motion_trigger` of type EspTrigger may be published, and nothing subscribed, unless the `~allow_*`
  lists permit more (`~restrict: never` lifts them); a serial device is not restricted.
- Topics are requested at once, not after 2 s; after a message before negotiation they are requested again.
- A client that is silent for 15 s is disconnected; a sensor's old connection is closed when the sensor reconnects.
- A service call that the device does not answer fails after 5 s; upstream waits forever.
- The allowed topics are advertised from the start, so that a sensor's first trigger reaches its subscribers.
- A port in use ends the program with one sentence.
"""

from __future__ import annotations

import gc
import logging
import resource
import sys
import threading
import time
from typing import Any

import rospy

from rosbot_patrol.counts import count_of
from rosbot_patrol.errors import ParamError, ProtocolError
from rosbot_patrol.ros.bridge.channels import DeviceService, ServiceCaller, Subscription, message_class
from rosbot_patrol.ros.bridge.links import LinkTeller
from rosbot_patrol.ros.bridge.publishers import SETTLING, Publishers
from rosbot_patrol.ros.bridge.report import Report, SerialTap
from rosbot_patrol.ros.runtime.node import Worker, load_params, private_params, run_node
from rosbot_patrol.rosserial.protocol.topics import ESP_TRIGGER_MD5, TopicId, TopicInfo, unpack_esp_trigger
from rosbot_patrol.rosserial.server.client import Client
from rosbot_patrol.rosserial.server.complaints import Complaints
from rosbot_patrol.rosserial.server.policy import Policy
from rosbot_patrol.rosserial.server.server import SerialServer
from rosbot_patrol.rosserial.server.settings import DEFAULT_TCP_PORT, SerialNodeParams
from rosbot_patrol.sensors.registry import Change, MotionSensors, SensorStatus

log = logging.getLogger(__name__)

GLOBAL_TCP_PORT = "/rosserial_embeddedlinux/tcp_port"
SWITCH_INTERVAL = 0.0005  # longest wait of a message for the diagnostics thread [s]; Python's own: 0.005
_LEVELS = (logging.DEBUG, logging.INFO, logging.WARNING, logging.ERROR, logging.CRITICAL)


class RosSide:
    """The ROS side of the bridge: passes devices' messages to ROS and back (`rosserial.dispatch.Handler`)."""

    def __init__(self, sensor_timeout: float) -> None:
        self.server: SerialServer | None = None
        self.sensors = MotionSensors(sensor_timeout)
        self.sensors_lock = threading.Lock()
        self._motion_log = Complaints()
        self.links = LinkTeller()
        self._publishers = Publishers()
        self._channels: dict[Client, dict[tuple[str, str], Any]] = {}

    def advertise(self, policy: Policy) -> None:
        """Advertise the allowed topics before any device connects, so that its first message reaches subscribers."""
        for rule in policy.publish:
            if "*" not in (rule.name, rule.message_type):
                self._publishers.advertise(rule.name, message_class(rule.message_type))

    def open(self, client: Client, kind: TopicId, info: TopicInfo) -> None:
        """Advertise or subscribe; raises ProtocolError."""
        if kind == TopicId.PUBLISHER:
            self._publishers.open(info)
            return
        channels = self._channels.setdefault(client, {})
        if kind == TopicId.SUBSCRIBER:
            key = ("topic", info.name)
            if key in channels:
                channels.pop(key).close()
            channels[key] = Subscription(info, self._sender(client))
        elif kind in (TopicId.SERVICE_SERVER_PUBLISHER, TopicId.SERVICE_SERVER_SUBSCRIBER):
            service = self._channel(channels, ("offered", info.name), DeviceService, client, info)
            answers = kind == TopicId.SERVICE_SERVER_PUBLISHER
            (service.set_answer_topic if answers else service.set_request_topic)(info)
        else:
            caller = self._channel(channels, ("called", info.name), ServiceCaller, client, info)
            requests = kind == TopicId.SERVICE_CLIENT_PUBLISHER
            (caller.set_request_topic if requests else caller.set_answer_topic)(info)

    def receive(self, client: Client, kind: TopicId, info: TopicInfo, data: bytes) -> None:
        """Publish, answer or call; raises ProtocolError."""
        if kind == TopicId.PUBLISHER:
            if info.md5 == ESP_TRIGGER_MD5:
                self._note_sensor(client, data)
            self._publishers.put(info, data)
        elif kind == TopicId.SERVICE_SERVER_PUBLISHER:
            self._channels[client]["offered", info.name].receive(data)
        else:
            self._channels[client]["called", info.name].receive(data)

    def flush(self) -> None:
        """Publish the received messages."""
        self._publishers.flush()

    def tick(self) -> None:
        """Publish delayed messages."""
        self._publishers.tick()

    def closed(self, client: Client) -> None:
        """Remove the device's subscriptions and services."""
        self.links.closed(client)
        for channel in self._channels.pop(client, {}).values():
            channel.close()

    def time(self) -> tuple[int, int]:
        """ROS time."""
        stamp = rospy.Time.now()
        return stamp.secs, stamp.nsecs

    def device_log(self, client: Client, level: int, text: str) -> None:
        """Log on the console and /rosout, at the device's level."""
        self.links.logged(client, text)
        log.log(_LEVELS[min(level, len(_LEVELS) - 1)], "%s: %s", client.peer, text)

    def parameter(self, name: str) -> object:
        """Read a ROS parameter; raises ProtocolError if it is not set."""
        try:
            return rospy.get_param(name)
        except KeyError as err:
            raise ProtocolError("", f"parameter {name} is not set") from err

    def look_at_sensors(self, now: float) -> list[SensorStatus]:
        """State of all sensors; logs those that have just fallen silent."""
        with self.sensors_lock:
            events = self.sensors.tick(now)
            statuses = self.sensors.statuses(now)
        for event in events:
            log.log(logging.WARNING if event.change is Change.SILENT else logging.INFO, "%s", event)
        return statuses

    def _note_sensor(self, client: Client, data: bytes) -> None:
        sensor_id, move = unpack_esp_trigger(data)
        now = time.monotonic()
        self.links.heard(client, sensor_id, now, move=move)
        with self.sensors_lock:
            events = self.sensors.heard(sensor_id, client.address, now, move=move)
        for event in events:
            log.info("%s", event)
        if move and self._motion_log.may_speak(sensor_id, now):
            log.info("motion sensor %d: something moves", sensor_id)

    def _sender(self, client: Client) -> Any:
        def send(topic_id: int, data: bytes) -> None:
            if self.server is not None:
                self.server.send(client, topic_id, data)

        return send

    def _channel(
        self, channels: dict[tuple[str, str], Any], key: tuple[str, str], cls: Any, client: Client, info: TopicInfo
    ) -> Any:
        if key not in channels:
            channels[key] = cls(info, self._sender(client))
        return channels[key]


def _parameters() -> SerialNodeParams:
    """Private parameters, upstream's global ones and the arguments; the later ones take precedence."""
    tree = private_params()
    if "tcp_port" not in tree:
        tree["tcp_port"] = rospy.get_param(GLOBAL_TCP_PORT, DEFAULT_TCP_PORT)
    arguments = rospy.myargv()[1:]
    if arguments:
        tree["port"] = arguments[0]
    if len(arguments) > 1:
        if not arguments[1].isdigit():
            raise ParamError("argument 2", f"expected a TCP port, got {arguments[1]!r}")
        tree["tcp_port"] = int(arguments[1])
    return load_params(SerialNodeParams, tree=tree)


def _allow_many_files(clients: int) -> None:
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = clients + 256
    if soft < wanted:
        resource.setrlimit(resource.RLIMIT_NOFILE, (wanted if hard < 0 else min(wanted, hard), hard))


def body() -> None:
    """Build the server and serve until shutdown."""
    sys.setswitchinterval(SWITCH_INTERVAL)
    params = _parameters()
    policy = params.policy(rospy.get_name() + "/")
    _allow_many_files(params.max_clients)
    ros_side = RosSide(params.sensor_timeout)
    server = SerialServer(
        ros_side,
        policy,
        silence_timeout=params.silence_timeout,
        limits=params.limits,
        tap=SerialTap() if params.record_bytes else None,
    )
    ros_side.server = server
    if policy.restricted:
        ros_side.advertise(policy)
    if params.is_tcp:
        ports = server.listen(params.all_tcp_ports, params.host)
        what = "TCP port " + ", ".join(map(str, ports))
        ros_side.links.start()
        log.info(
            "waiting for sensors%s on %s",
            f" with one of {count_of(len(policy.keys), 'key')}" if policy.keys else "",
            what,
        )
    else:
        server.attach(params.port, params.baud)
        what = params.port
    gc.collect()
    gc.freeze()  # excludes existing objects from collection, which stopped everything for 40 ms
    rospy.on_shutdown(server.stop)
    Worker(Report(server, ros_side.look_at_sensors, what).run, name="report").start()
    if policy.restricted:
        time.sleep(SETTLING)  # sensors wait meanwhile: acknowledged messages must reach their subscribers
    server.run()
    server.close()


def main() -> None:
    """Run the node."""
    run_node("serial_node", body)
