"""console: the owner's web page.

Publishes orders of people as any other program would: services and action of the patrol, `move_base_simple/goal`, and
`cmd_vel/teleop` for the twist_mux.

    rosrun rosbot_patrol console                              serves the page
    rosrun rosbot_patrol console --add NAME [--role owner]    adds somebody, or gives them a new password
"""

from __future__ import annotations

import argparse
import getpass
import logging
import os
import socket
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import rospy

from rosbot_patrol.alerts.channels.config import Surroundings
from rosbot_patrol.console.access.accounts import Accounts, Role
from rosbot_patrol.console.access.door import Door
from rosbot_patrol.console.access.order_log import OrderLog
from rosbot_patrol.console.access.secret import console_secret
from rosbot_patrol.console.house.files import Given, HouseFiles
from rosbot_patrol.console.live.acknowledge import Acknowledgements
from rosbot_patrol.console.live.day_log import DayLog
from rosbot_patrol.console.live.guide import Guide
from rosbot_patrol.console.live.hub import Hub
from rosbot_patrol.console.live.incident_desk import IncidentDesk
from rosbot_patrol.console.live.orders import Desk
from rosbot_patrol.console.pages.context import Context
from rosbot_patrol.console.web.app import make_app
from rosbot_patrol.console.web.server import ServerParams, WebServer
from rosbot_patrol.errors import PatrolError
from rosbot_patrol.files import write_atomic
from rosbot_patrol.params import declared, param
from rosbot_patrol.patrol.house.own_files import HOUSE, place_to_write
from rosbot_patrol.ros.console.exploration import RosExploration
from rosbot_patrol.ros.console.feed import Feed
from rosbot_patrol.ros.console.report import Reporter
from rosbot_patrol.ros.console.robot import RosRobot
from rosbot_patrol.ros.console.ways import Ways
from rosbot_patrol.ros.runtime.diagnostics import OK, Health
from rosbot_patrol.ros.runtime.node import load_params, ros_home, run_node
from rosbot_patrol.ros.runtime.private_files import use_private_umask
from rosbot_patrol.ros.runtime.state_folder import state_folder

log = logging.getLogger(__name__)

_FOLDER = "console"
READY = "ready"
"""Name of the file in the folder of the house that says that its set-up is over."""


@dataclass(frozen=True, kw_only=True)
class ConsoleParams:
    """Parameters of the console besides those of its web server."""

    state_dir: str = param("", doc="folder of the guard's state; empty: rosbot_patrol in ROS's home")
    path_to_params: str = param("", doc="points file with the names of the rooms")
    sensors: str = param("", doc="sensors file, as the patrol has it")
    schedule: str = param("", doc="file of the scheduled rounds, as the patrol has it")
    arming: str = param("", doc="file of the arming modes, as the patrol has it")
    channels: str = param("", doc="file of further channels, as the patrol has it")
    new_house: bool = param(False, doc="show the set-up guide, for a house without a map and rooms")
    map_file: str = param("", doc="with new_house: yaml of the map that the guard will use")


OWN = {name for name, *_ in declared(ConsoleParams)}


class ConsoleNode:
    """The console with its topics."""

    def __init__(self) -> None:
        others = {"address", "port", "certificate", "key"}
        params = load_params(ConsoleParams, ignore=others)
        server = load_params(ServerParams, ignore=OWN)
        folder = state_folder(params.state_dir, rospy.get_namespace())
        own = folder / _FOLDER
        accounts = Accounts(own / "accounts.json")
        secret = console_secret(folder)
        door = Door(accounts, secret, time.monotonic)
        incidents = IncidentDesk(folder, time.time)
        hub = Hub()
        given = Given(
            rooms=params.path_to_params,
            sensors=params.sensors,
            arming=params.arming,
            schedule=params.schedule,
            channels=params.channels,
        )
        around = Surroundings(home=ros_home(), environ=os.environ, host=socket.gethostname())
        house = HouseFiles(folder, given, around, is_new=params.new_house)
        ways = Ways(folder, house, around)

        def is_open() -> bool:
            accounts.follow()
            return accounts.is_open

        self._web = WebServer(server, is_open)
        day_log = DayLog(own / "day.jsonl", time.time)
        feed = Feed(hub, house, day_log)
        if params.new_house:
            feed.watch_devices()
        context = Context(
            hub=hub,
            door=door,
            desk=Desk(RosRobot(hub), door, OrderLog(own / "orders.jsonl"), time.time),
            incidents=incidents,
            seen=Acknowledgements(incidents, secret),
            state_dir=folder,
            house=house,
            follow_house=feed.follow_house,
            day_log=day_log,
            report=Reporter(hub, house, accounts, day_log),
            channels=ways.described,
            try_channel=ways.test,
            guide=self._guide(params.map_file, folder) if params.new_house else None,
        )
        self._app = make_app(context, is_secure=bool(server.certificate))
        Health().set("console", OK, f"the console is at {self._web.url}")
        log.info("the console is at %s", self._web.url)
        rospy.set_param("~url", self._web.url)

    def _guide(self, map_file: str, folder: Path) -> Guide:
        target = place_to_write(map_file, folder, "map.yaml")

        def finish() -> None:
            write_atomic(folder / HOUSE / READY, b"")
            exploration.stop()
            rospy.signal_shutdown("the house is set up")

        exploration = RosExploration(target)
        rospy.on_shutdown(exploration.stop)
        return Guide(exploration=exploration, map_file=target, finish=finish)

    def run(self) -> None:
        """Serve until shutdown."""
        rospy.on_shutdown(self._web.end)
        self._web.run(self._app)


def add_person(arguments: argparse.Namespace) -> int:
    """Add somebody, or change their password; the password comes from the terminal, or from stdin."""
    use_private_umask()
    folder = state_folder(arguments.state_dir, "/") / _FOLDER
    is_typed = sys.stdin.isatty()
    password = getpass.getpass("Password: ") if is_typed else sys.stdin.readline().rstrip("\n")
    if is_typed and getpass.getpass("Again: ") != password:
        print("console: the two passwords differ", file=sys.stderr)
        return 1
    try:
        accounts = Accounts(folder / "accounts.json")
        if accounts.find(arguments.add):
            accounts.change_password(arguments.add, password)
        else:
            accounts.add(arguments.add, Role(arguments.role), password)
    except (PatrolError, OSError) as err:
        print(f"console: {err}", file=sys.stderr)
        return 1
    print(f"{arguments.add} may sign in now.")
    return 0


def main() -> None:
    """Run the node, or the command."""
    parser = argparse.ArgumentParser(prog="console", description="The owner's web page.")
    parser.add_argument("--add", metavar="NAME", default="", help="add somebody, or give them a new password")
    roles = [role.value for role in Role]
    parser.add_argument("--role", default=Role.OWNER.value, choices=roles, help="of somebody new")
    parser.add_argument("--state-dir", default="", help="the guard's state_dir; rosbot_patrol in ROS's home")
    given = parser.parse_args([word for word in sys.argv[1:] if ":=" not in word and not word.startswith("__")])
    if given.add:
        sys.exit(add_person(given))
    use_private_umask()
    run_node("console", lambda: ConsoleNode().run(), by_hand=True)
