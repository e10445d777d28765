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
import sys
import time
from dataclasses import dataclass

import rospy

from rosbot_patrol.console.access.accounts import Accounts, Role
from rosbot_patrol.console.access.door import Door, session_secret
from rosbot_patrol.console.access.order_log import OrderLog
from rosbot_patrol.console.live.hub import Hub
from rosbot_patrol.console.live.incident_desk import IncidentDesk
from rosbot_patrol.console.live.orders import Desk
from rosbot_patrol.console.pages.context import Context
from rosbot_patrol.console.web.app import make_app
from rosbot_patrol.console.web.server import ServerParams, WebServer
from rosbot_patrol.errors import PatrolError
from rosbot_patrol.params import param
from rosbot_patrol.patrol.intruder.known_objects import FOUND_FALSE, add_known
from rosbot_patrol.ros.console.feed import Feed
from rosbot_patrol.ros.console.robot import RosRobot
from rosbot_patrol.ros.runtime.diagnostics import OK, Health
from rosbot_patrol.ros.runtime.node import load_params, run_node
from rosbot_patrol.ros.runtime.private_files import use_private_umask
from rosbot_patrol.ros.runtime.state_folder import state_folder

log = logging.getLogger(__name__)

_FOLDER = "console"


@dataclass(frozen=True, kw_only=True)
class ConsoleParams:
    """Parameters of the console besides those of its web server."""

    state_dir: str = param("", doc="folder of the guard's state; empty: rosbot_patrol in ROS's home")
    path_to_params: str = param("", doc="points file with the names of the rooms")


class ConsoleNode:
    """The console with its topics."""

    def __init__(self) -> None:
        others = {"address", "port", "certificate", "key"}
        params = load_params(ConsoleParams, ignore=others)
        server = load_params(ServerParams, ignore={"state_dir", "path_to_params"})
        folder = state_folder(params.state_dir, rospy.get_namespace())
        own = folder / _FOLDER
        accounts = Accounts(own / "accounts.json")
        door = Door(accounts, session_secret(own / "secret"), time.monotonic)
        hub = Hub()

        def is_open() -> bool:
            accounts.follow()
            return accounts.is_open

        self._web = WebServer(server, is_open)
        context = Context(
            hub=hub,
            door=door,
            desk=Desk(RosRobot(hub), door, OrderLog(own / "orders.jsonl"), time.time),
            incidents=IncidentDesk(folder, time.time),
            know=lambda thing: add_known(folder / FOUND_FALSE, thing),
            state_dir=folder,
        )
        Feed(hub, params.path_to_params)
        self._app = make_app(context, is_secure=bool(server.certificate))
        Health().set("console", OK, f"the console is at {self._web.url}")
        log.info("the console is at %s", self._web.url)
        rospy.set_param("~url", self._web.url)

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
