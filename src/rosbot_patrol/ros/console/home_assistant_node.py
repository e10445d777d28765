"""home_assistant: the guard in a smart home, by MQTT with Home Assistant's discovery.

    rosrun rosbot_patrol home_assistant _mqtt:=FILE

Orders that come by MQTT are written down as those of the console are. The broker's login decides who may give them; an
alarm code that the console has set is asked for, too.
"""

from __future__ import annotations

import logging
import os
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import rospy

from rosbot_patrol.alerts.channels.config import Surroundings
from rosbot_patrol.alerts.records.query import Query
from rosbot_patrol.console.access.accounts import Account, Accounts, Role
from rosbot_patrol.console.access.door import Door
from rosbot_patrol.console.access.order_log import Order, OrderLog
from rosbot_patrol.console.access.secret import console_secret
from rosbot_patrol.console.home_assistant.discovery import EVENTS, discovery
from rosbot_patrol.console.home_assistant.link import BrokerLink
from rosbot_patrol.console.home_assistant.messages import MqttOrder, order_of, states, status_of
from rosbot_patrol.console.home_assistant.settings import load_broker
from rosbot_patrol.console.house.files import Given, HouseFiles
from rosbot_patrol.console.live.hub import Hub
from rosbot_patrol.console.live.incident_desk import IncidentDesk
from rosbot_patrol.console.live.orders import DISARMED, Answer
from rosbot_patrol.errors import AccessError, ParamError, StoreError
from rosbot_patrol.params import param
from rosbot_patrol.ros.console.feed import Feed
from rosbot_patrol.ros.console.robot import RosRobot
from rosbot_patrol.ros.runtime.diagnostics import OK, WARN, Health
from rosbot_patrol.ros.runtime.node import load_params, ros_home, run_node
from rosbot_patrol.ros.runtime.private_files import use_private_umask
from rosbot_patrol.ros.runtime.state_folder import state_folder

log = logging.getLogger(__name__)

_PERIOD = 0.05  # [s] between two looks for news
_HEALTH = 1.0  # [s]
_RECORD = 20.0  # [s] after a verdict its record is complete
_WHO = Account(name="MQTT", role=Role.MEMBER)


@dataclass(frozen=True, kw_only=True)
class HomeAssistantParams:
    """Parameters of the node home_assistant."""

    mqtt: str = param("", doc="file of the MQTT broker (docs/home_assistant.md)")
    state_dir: str = param("", doc="folder of the guard's state; empty: rosbot_patrol in ROS's home")
    path_to_params: str = param("", doc="points file with the names of the rooms")


class HomeAssistantNode:
    """The guard's state to the broker, and orders back."""

    def __init__(self) -> None:
        params = load_params(HomeAssistantParams)
        if not params.mqtt:
            raise ParamError(f"{rospy.get_name()}/mqtt", "is empty, expected the file of the MQTT broker")
        self._broker = load_broker(Path(params.mqtt).expanduser(), os.environ)
        folder = state_folder(params.state_dir, rospy.get_namespace())
        self._accounts = Accounts(folder / "console" / "accounts.json")
        self._door = Door(self._accounts, console_secret(folder), time.monotonic)
        self._orders = OrderLog(folder / "console" / "orders.jsonl")
        self._incidents = IncidentDesk(folder, time.time)
        self._hub, self._health = Hub(), Health()
        self._robot = RosRobot(self._hub)
        around = Surroundings(home=ros_home(), environ=os.environ)
        Feed(self._hub, HouseFiles(folder, Given(rooms=params.path_to_params), around))
        self._link = BrokerLink(self._broker, self._on_order)
        self._newest = ""  # id of the last incident that was told
        self._is_first = True

    def run(self) -> None:
        """Tell until shutdown."""
        self._link.start()
        self._tell_incident()  # what is on record before the start is no news
        version, incidents, until, health_at = -1, 0, 0.0, 0.0
        while not rospy.is_shutdown():
            time.sleep(_PERIOD)
            if self._hub.version != version:
                version = self._hub.version
                self._tell()
            if self._hub.state.incidents != incidents:
                incidents, until = self._hub.state.incidents, time.monotonic() + _RECORD
            if time.monotonic() - health_at > _HEALTH:
                health_at = time.monotonic()
                if health_at < until:
                    self._tell_incident()
                problem = self._link.problem
                level, text = (WARN, problem) if problem else (OK, f"connected with {self._broker.where}")
                self._health.set("MQTT broker", level, text)
        self._link.stop()

    def _tell(self) -> None:
        state = self._hub.state
        self._accounts.follow()
        found = discovery(self._broker.spec, self._hub.rooms, state.sensors, has_code=self._accounts.has_code)
        prefix = f"{self._broker.spec.discovery}/"
        self._link.forget({topic for topic in self._link.said if topic.startswith(prefix)} - found.keys())
        self._link.tell(found)
        self._link.tell(states(state, self._link.topics))
        self._link.set_online(is_online=status_of(state))

    def _tell_incident(self) -> None:
        """Tell the newest incident with a complete record, and its picture."""
        try:
            cards = self._incidents.find(Query(limit=3))
            complete = (each for each in cards if each.found.closed is not None)
            card = next((each for each in complete if each.found.verdict in EVENTS), None)
            is_first, self._is_first = self._is_first, False
            if card is None or card.found.id == self._newest:
                return
            found, self._newest = card.found, card.found.id
            if card.picture and (data := self._incidents.file(found.id, card.picture)):
                self._link.tell({self._link.topics.state("incident_image"): data})
        except StoreError as err:
            log.warning("the last incident cannot be told: %s", err)
            return
        event = {"event_type": found.verdict, "room": found.room_name, "reason": found.reason, "id": found.id}
        if not is_first:
            self._link.tell_once(self._link.topics.state("incident"), event)

    def _on_order(self, topic: str, payload: bytes) -> None:
        try:
            order = order_of(topic, payload, self._link.topics, self._hub.rooms)
            what = f"{order.what} {order.mode or (order.room_id if order.room_id >= 0 else '')}".strip()
            answer = self._give(order)
        except AccessError as err:
            what, answer = f"an order on {topic}", Answer(accepted=False, text=f"{err}")
        (log.info if answer.accepted else log.warning)("by MQTT: %s: %s", what, answer.text)
        self._orders.add(
            Order(
                wall=time.time(),
                who=_WHO.name,
                peer=self._broker.where,
                what=what,
                accepted=answer.accepted,
                answer=answer.text,
            )
        )

    def _give(self, order: MqttOrder) -> Answer:
        robot = self._robot
        if order.what == "arm":
            if order.mode == DISARMED:
                self._accounts.follow()
                self._door.check_code(order.code, _WHO)
            return robot.arm(order.mode)
        orders: dict[str, Callable[[], Answer]] = {
            "home": robot.home,
            "all": robot.look_at_all,
            "cancel": robot.cancel,
            "stop": lambda: robot.stop(pressed=True),
            "look": lambda: robot.look(order.room_id),
        }
        return orders[order.what]()


def main() -> None:
    """Run the node."""
    use_private_umask()
    run_node("home_assistant", lambda: HomeAssistantNode().run(), by_hand=True)
